// Points and the free ranges of their lines as a row of floats.
#include "integrators/contours/sky_record.h"

#include <algorithm>

namespace limn {

void SkyRecord::add(const Rgb<double>& scale, const Vec3d& w, double offset) {
  const Vec3d upright{dot(w, grid_.quarter), dot(w, grid_.pole), -dot(w, grid_.zero)};
  for (const double v : {scale.r, scale.g, scale.b, upright.x, upright.y, upright.z, offset}) {
    numbers_.push_back(static_cast<float>(v));
  }
}

void SkyRecord::add_view(const Vec3d& direction, double weight) {
  add(grey(weight), direction, -1);
}

void SkyRecord::begin(const Rgb<double>& scale, const Vec3d& n, double offset, bool back) {
  add(scale, n, back ? 1 - offset : offset);
  back_ = back;
  ranges_.clear();
}

void SkyRecord::end() {
  std::sort(ranges_.begin(), ranges_.end(), [](const Range& a, const Range& b) {
    return a.line < b.line || (a.line == b.line && a.theta0 < b.theta0);
  });
  auto range = ranges_.begin();
  for (uint32_t j = 0; j < static_cast<uint32_t>(lines_); ++j) {
    const size_t first = numbers_.size();
    for (; range != ranges_.end() && range->line == j; ++range) {
      const auto from = static_cast<float>(range->theta0), to = static_cast<float>(range->theta1);
      const bool goes_on = numbers_.size() > first && numbers_.back() == from;
      if (goes_on) numbers_.pop_back();
      if (!goes_on && from > 0) numbers_.push_back(from);
      numbers_.push_back(to);
    }
    if (numbers_.size() == first) numbers_.push_back(0);
    numbers_.back() = -numbers_.back();
  }
}

}  // namespace limn
