// Counting samples, scheduling batches, reporting progress.
#include "limn/integrators/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

namespace limn {

void NonFinite::add(const SampleId& place) {
  ++count;
  if (first.size() < 10) first.push_back(place);
}

void NonFinite::merge(const NonFinite& other) {
  count += other.count;
  for (const SampleId& place : other.first) {
    if (first.size() < 10) first.push_back(place);
  }
}

void LargestSample::add(double squared_magnitude, const NonFinite::SampleId& where) {
  squares += squared_magnitude;
  if (!(squared_magnitude > square)) return;
  square = squared_magnitude;
  place = where;
}

void LargestSample::merge(const LargestSample& other) {
  squares += other.squares;
  if (!(other.square > square)) return;
  square = other.square;
  place = other.place;
}

void TermCost::merge(const TermCost& other) {
  seconds += other.seconds;
  rays += other.rays;
  shadow_rays += other.shadow_rays;
  samples += other.samples;
  no_edge += other.no_edge;
  zero_weight += other.zero_weight;
  left_out += other.left_out;
  occluded += other.occluded;
  counted += other.counted;
  warped += other.warped;
  dominated += other.dominated;
  dropped += other.dropped;
  largest.merge(other.largest);
}

std::string NonFinite::message() const {
  std::string text =
      fmt::format("{} non-finite sample{} counted as zero:", count, count == 1 ? "" : "s");
  for (const SampleId& place : first) {
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

int Schedule::batch_size(int first, bool even) {
  if (!even) return 1 + first / 32;
  const int wished = std::max({1, std::min(first / 4, 4), std::min(first / 8, 16), first / 32});
  return static_cast<int>(std::bit_floor(static_cast<unsigned>(wished)));
}

int Schedule::samples_in_time(double now) const {
  const double left = settings_.seconds - now;
  if (left <= 0) return 0;
  const int done = samples() + before_;
  const double spent = now - (before_ > 0 ? began_[1] : began_[0]);
  return spent > 0 ? static_cast<int>(std::min(left * done / spent, 1e9)) : settings_.spp;
}

bool Schedule::next() {
  if (last_) return false;
  const double now = watch_.seconds();
  const int64_t wished = int64_t{end_} + batch_size(end_, even_);
  int end = static_cast<int>(std::min<int64_t>(wished, settings_.spp));
  if (settings_.seconds > 0 && end_ >= settings_.least_spp) {
    const int fitting = samples_in_time(now);
    last_ = fitting < end - end_;
    end = std::min(end, end_ + fitting);
  }
  if (end == end_) return false;
  before_ = samples();
  began_[1] = began_[0];
  began_[0] = now;
  first_ = end_;
  end_ = end;
  return true;
}

void ProgressCounter::step(size_t count) {
  const std::scoped_lock lock(mutex_);
  done_ += count;
  if (!settings_.progress) return;
  double done = static_cast<double>(done_) / steps_;
  if (settings_.seconds > 0) done = std::max(done, watch_.seconds() / settings_.seconds);
  settings_.progress(std::min(done, 1.0));
}

}  // namespace limn
