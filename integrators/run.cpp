#include "limn/integrators/run.h"

#include <fmt/format.h>

#include <algorithm>

namespace limn {

void NonFinite::add(const Place& place) {
  ++count;
  if (first.size() < 10) first.push_back(place);
}

void NonFinite::merge(const NonFinite& other) {
  count += other.count;
  for (const Place& place : other.first) {
    if (first.size() < 10) first.push_back(place);
  }
}

std::string NonFinite::message() const {
  std::string text =
      fmt::format("{} non-finite sample{} counted as zero:", count, count == 1 ? "" : "s");
  for (const Place& place : first) {
    if (place.x < 0) {
      text += fmt::format(" (sample {}, {})", place.sample, place.term);
    } else {
      text +=
          fmt::format(" (pixel {} {}, sample {}, {})", place.x, place.y, place.sample, place.term);
    }
  }
  if (count > first.size()) text += " ...";
  return text;
}

Batches::Batches(int spp) : ends_{0} {
  while (ends_.back() < spp) {
    const int done = ends_.back();
    ends_.push_back(std::min(spp, done + 1 + done / 32));
  }
  count = static_cast<int>(ends_.size()) - 1;
}

void ProgressCounter::step() {
  const std::scoped_lock lock(mutex_);
  ++done_;
  if (settings_.progress) settings_.progress(static_cast<double>(done_) / steps_);
}

}  // namespace limn
