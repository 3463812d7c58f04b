#pragma once
// A density on an edge, with an inexpensive approximation for short edges.
#include <optional>

#include "edgetree/lobe/ltc.h"

namespace limn {

// In proportion to value(w_t) / |w_t|^3 (see LtcEdge). Linear between the values at the ends if the
// edge is above the horizon and short relative to its distance and the lobe.
class SeenEdge {
 public:
  // w_0, w_1: the ends minus p.
  SeenEdge(const LtcLobe& lobe, const Vec3d& w_0, const Vec3d& w_1);

  // False if the edge is below the horizon or on a line through p: there is no density then.
  bool is_seen() const { return end_0_ + end_1_ > 0 || (exact_ && exact_->integral() > 0); }
  // sample_t and pdf_t require is_seen(). u in [0, 1), t in [0, 1].
  double sample_t(double u) const;
  double pdf_t(double t) const;

 private:
  double end_0_ = 0, end_1_ = 0;  // relative densities at t = 0 and 1; both 0 if exact_ is set
  std::optional<LtcEdge> exact_;
};

}  // namespace limn
