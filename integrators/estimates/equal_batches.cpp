// Equal batches, in a number of samples or in a time.
#include "integrators/estimates/equal_batches.h"

#include <algorithm>

namespace limn {

// Standard errors need two batches, so that each takes half of the time at most.
void EqualBatches::set_size(double one_sample) {
  const double now = watch_.seconds();
  const int most = std::max(2, std::min(most_, settings_.spp));
  const double fitting = (settings_.seconds - now) / std::max(one_sample, 1e-9) / most;
  size_ = static_cast<int>(std::clamp(fitting, 1.0, std::max(1.0, double(settings_.spp) / most)));
  while (settings_.spp / size_ * size_ < std::min(settings_.least_spp, settings_.spp)) --size_;
  expected_ = size_ * one_sample;
  since_ = size_ == 1 ? now - one_sample : now;
}

bool EqualBatches::next() {
  int end = end_ + size_;
  if (needs_size()) {
    const double now = watch_.seconds();
    const double each = begun_ > 0 ? (now - since_) / begun_ : expected_;
    const bool needed = end_ < settings_.least_spp || begun_ < 2;
    if (end > settings_.spp || (!needed && now + each > settings_.seconds)) return false;
  } else {
    if (end_ == settings_.spp) return false;
    const int count = std::clamp(most_, 1, settings_.spp);
    end = static_cast<int>(int64_t{settings_.spp} * (begun_ + 1) / count);
  }
  first_ = end_;
  end_ = end;
  ++begun_;
  return true;
}

}  // namespace limn
