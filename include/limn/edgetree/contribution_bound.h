#pragma once
// An upper bound of an edge's contribution to the boundary integral at a shading point, without
// visibility and radiance, and a density on the edge in proportion to it.
#include <array>

#include "limn/core/lobe.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// An edge relative to a shading point p.
struct EdgeSegment {
  Vec3d w_0, w_1;        // end points minus p
  Vec3<Lanes> v_0, v_1;  // velocities of the ends minus that of p
};
EdgeSegment segment_of(const EdgeMesh& mesh, EdgeId edge, const EdgeQuery& query);

// Upper bound of the scattering function over an arc of directions, for a given viewer.
class LobeBound {
 public:
  // n: unit; wi: unit, n.wi > 0
  LobeBound(const Vec3d& n, const Vec3d& wi, const LobeSummary& lobe);

  // Bound over the shorter great arc from u_a to u_b (unit) [1/sr].
  double over_arc(const Vec3d& u_a, const Vec3d& u_b) const;
  // See LobeModel.
  const Vec3d& axis() const { return axis_; }
  double width() const { return width_; }
  const Vec3d& n() const { return n_; }

 private:
  Vec3d n_, axis_;
  LobeSummary lobe_;
  double width_, cos_i_;
};

// The part of an edge above the horizon n.w > 0, cut into pieces that are short compared with the
// lobe. A piece's weight is max f_s * max |det(w_0, w_1, v)| * integral of dt / |w|^3, summed over
// lanes. Within a piece the density is uniform in the angle at p.
class EdgeBound {
 public:
  EdgeBound(const LobeBound& lobe, const EdgeSegment& segment);

  // Sum over lanes of a bound of the integral of f_s |J| over the edge [1 / parameter unit]. Zero
  // only where that integral is zero, or p lies on the edge's line.
  double total() const { return total_; }
  // sample_t and pdf_t require total() > 0. u_piece, u_angle in [0,
  // 1)
  double sample_t(double u_piece, double u_angle) const;
  double pdf_t(double t) const;  // with respect to t

 private:
  // Steps double from at least 2^-26 at the peak: 28 on each side exceed any arc.
  static constexpr int kMaxPieces = 64;

  bool clip_to_horizon(const LobeBound& lobe, const EdgeSegment& segment);
  void cut(const LobeBound& lobe);
  void add_cut(double angle);
  struct Point {
    double s;  // fraction of the clipped segment
    double length;
    Vec3d u;  // direction from p
  };
  double whole_bound(const LobeBound& lobe) const;
  double piece_bound(const LobeBound& lobe, int i) const;
  double jacobian_bound(const Point& a, const Point& b) const;
  double angle() const;  // angle of the whole arc
  double piece_end(int i) const;
  double fraction_at(double angle, double end) const;

  // The clipped segment, from w_a = w(t_begin) to w_b = w(t_end).
  Vec3d w_a_, w_b_, u_a_, u_b_;
  double t_begin_ = 0, t_end_ = 1;
  double length_a_ = 0, length_b_ = 0;
  Lanes determinant_a_, determinant_b_;  // det(w_0, w_1, v) at the two ends; linear in t between
  double sin_angle_ = 0;                 // of the whole arc
  Vec3d tangent_{};                      // unit, at u_a towards u_b

  int pieces_ = 0;
  // Angles from u_a, ascending; the last only if there are several pieces.
  std::array<double, kMaxPieces + 1> cuts_;
  std::array<double, kMaxPieces> weights_;
  std::array<double, kMaxPieces + 1> cumulative_;  // of the weights, from 0
  double total_ = 0;
};

}  // namespace limn
