#pragma once
// The scattering function as a linearly transformed cosine (Heitz et al. 2016): an importance that
// is cheap over boxes and can be sampled along edges (Peters 2021).
//
//   ltc(w) = max(0, z') |det M^-1| / (pi |w'|^4),   w' = M^-1 w, w unit,
//   value(w) = (1 - cosine) ltc(w) + cosine (n.w) / pi   where n.w > 0, else 0  [1/sr].
//
// with the share of the cosine that the lobe has (LobeSummary::cosine_share), which keeps the value
// positive wherever the scattering function is. Diffuse: M = identity,
// and value is the scattering function over its albedo. Which transformed cosine it is the lobe
// says (LobeModel::ltc); one that says none is taken for diffuse.
#include "edgetree/simd.h"
#include "limn/core/lobe.h"

namespace limn {

class LtcLobe {
 public:
  // n, wi: unit, world space, n.wi > 0. A diffuse lobe needs no table.
  LtcLobe(const LobeSummary& lobe, const Vec3d& n, const Vec3d& wi);

  // Densities [1/sr] for unit w; ltc integrates to 1 over the sphere, value to at most 1.
  double ltc(const Vec3d& w) const;
  double value(const Vec3d& w) const;
  // value(w / |w|) / |w|^3 for w of any nonzero length, without a square root.
  double homogeneous_value(const Vec3d& w) const;

  // Estimated mean of `value` over the directions of each box [1/sr], given its center minus p and
  // half extents (>= 0). Conservative with respect to rounding: positive if some point of the box
  // is above the horizon.
  Floats mean_over_boxes(Floats3 center, Floats3 half) const;
  // Likewise for segments, given their centers minus p and their ends minus their centers.
  Floats mean_over_segments(Floats3 center, Floats3 half) const;
  // Approximate maximum of `value` in each box [1/sr]; several times too large at grazing
  // incidence. Indicates where means are unreliable; not a bound.
  Floats most_in_boxes(Floats3 center, Floats3 half) const;

  bool diffuse() const { return diffuse_; }
  const Vec3d& n() const { return n_; }
  // M^-1 w for any w; for diffuse lobes w in the frame of n.
  Vec3d transform(const Vec3d& w) const {
    return {dot(rows_[0], w), dot(rows_[1], w), dot(rows_[2], w)};
  }
  double det() const { return det_; }        // of M^-1, > 0
  double cosine() const { return cosine_; }  // its share; 1 if diffuse
  // Integral of the scattering function over w without the albedo: norm() ltc(w) approximates
  // it.
  double norm() const { return norm_; }

 private:
  void read_table(const LtcRow& row, const Vec3d& wi);
  void prepare_boxes();
  template <class Shape>
  Floats mean_over(Floats3 center, Floats3 half) const;
  template <class Shape>
  Floats ltc_mean(const Floats3& center, const Floats3& half) const;

  bool diffuse_;
  Vec3d n_;
  Vec3d rows_[3];
  double det_ = 1;
  double norm_ = 1;
  double cosine_ = 1;
  // In floats, for boxes: n, the rows of M^-1, det, the shares of cosine and ltc.
  float n_f_[3], rows_f_[3][3], det_f_, cosine_f_, rest_f_;
};

// The part of an edge above the horizon, with a density in proportion to value(w_t) / |w_t|^3 with
// respect to t: the scattering function times the Jacobian det(w_0, w_1, v) / |w|^3 for a uniform
// velocity.
class LtcEdge {
 public:
  // w_0, w_1: the ends minus p.
  LtcEdge(const LtcLobe& lobe, const Vec3d& w_0, const Vec3d& w_1);

  // Integral of value(w_t) / |w_t|^3 over t in [0, 1]. Zero only if the edge is below the horizon
  // or on a line through p (where the Jacobian is zero). Always finite.
  double integral() const { return arcs_[0].integral + arcs_[1].integral; }
  // sample_t and pdf_t require integral() > 0. u in [0, 1), t in [0, 1]. The density at the horizon
  // is 0; rounding may produce that t, and the sample then has value zero.
  double sample_t(double u) const;
  double pdf_t(double t) const;

 private:
  // One of the two cosines over a part of the edge, in its own space. At the angle psi from the
  // part's start, as seen from p, the unit direction has the z coordinate zeta = zeta_a cos psi +
  // zeta_t sin psi, and the inverse distance is k = k_a cos psi + k_t sin psi (a line in polar
  // coordinates). With z = zeta / k, |w'| = 1 / k and ds = |w'|^2 dpsi / area, area = |w'_a x
  // w'_b|:
  // integral of z / |w'|^4 ds = 1 / area * integral of zeta k dpsi, which is elementary.
  struct Arc {
    double integral = 0;
    double t_begin = 0, t_end = 0;
    Vec3d start, along;  // w'(s) = start + s along, s in [0, 1]
    double scale = 0;    // the integrand is scale z' / |w'|^4 per unit t
    double zeta_a = 0, zeta_t = 0, k_a = 0, k_t = 0;
    double angle = 0, area = 0;

    // w_0, w_along: of the whole edge, in this space; requires t_begin < t_end.
    void set(const Vec3d& w_0, const Vec3d& w_along, double factor);
    double cumulative(double psi, double sine, double cosine) const;
    double sample_t(double u) const;
    double value(double t) const;
  };

  Arc arcs_[2];  // the LTC (empty if diffuse) and the cosine
};

}  // namespace limn
