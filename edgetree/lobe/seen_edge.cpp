// An inexpensive density on short edges.
#include "edgetree/lobe/seen_edge.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

double density_at(const LtcLobe& lobe, const Vec3d& w) {
  const double distance2 = length_squared(w), distance = std::sqrt(distance2);
  return lobe.value(w / distance) / (distance2 * distance);
}

// The density varies over lengths of about |M^-1 w|.
bool is_short(const LtcLobe& lobe, const Vec3d& w_0, const Vec3d& w_1) {
  constexpr double kShort = 0.25;  // not tuned
  const Vec3d a = lobe.transform(w_0), e = lobe.transform(w_1 - w_0);
  return length_squared(e) < kShort * kShort * length_squared(a);
}

}  // namespace

SeenEdge::SeenEdge(const LtcLobe& lobe, const Vec3d& w_0, const Vec3d& w_1) {
  const double h_0 = dot(lobe.n(), w_0), h_1 = dot(lobe.n(), w_1);
  if (h_0 <= 0 && h_1 <= 0) return;
  if (h_0 <= 0 || h_1 <= 0 || !is_short(lobe, w_0, w_1)) {
    exact_.emplace(lobe, w_0, w_1);
    return;
  }
  if (length_squared(cross(w_0, w_1)) == 0) return;
  end_0_ = density_at(lobe, w_0);
  end_1_ = density_at(lobe, w_1);
}

// Inverts (end_0 t + (end_1 - end_0) t^2 / 2) / mean = u.
double SeenEdge::sample_t(double u) const {
  if (exact_) return exact_->sample_t(u);
  const double target = u * (end_0_ + end_1_);
  const double root = std::sqrt(end_0_ * end_0_ + (end_1_ - end_0_) * target);
  return std::clamp(target / (end_0_ + root), 0.0, 1.0);
}

double SeenEdge::pdf_t(double t) const {
  if (exact_) return exact_->pdf_t(t);
  if (t < 0 || t > 1) return 0;
  return 2 * (end_0_ + (end_1_ - end_0_) * t) / (end_0_ + end_1_);
}

}  // namespace limn
