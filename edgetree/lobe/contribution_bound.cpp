// Upper bounds of an edge's contribution.
#include "limn/edgetree/contribution_bound.h"

#include <algorithm>
#include <cmath>

// The Jacobian. With w(t) = w_0 + t e, the determinant det(w_0, w_1, v(t)) is linear in t because v
// is, so its modulus is largest at an end. The rest has a closed form: with lengths l_a, l_b at the
// ends of a part of the edge that is dt long, and the angle gamma between them at p,
//   integral of dt / |w|^3 = dt (l_a + l_b) / (l_a^2 l_b^2 (1 + cos gamma)),
// from the antiderivative (w.e) / (|w| |w x e|^2), with (u_b - u_a).(w_b - w_a) = (l_a + l_b)
// (1 - cos gamma) and |w_a x w_b|^2 = l_a^2 l_b^2 (1 - cos gamma)(1 + cos gamma).
//
// Along an arc the cosine to an axis is A cos(phi - phi_0): largest at an end, or A where it peaks
// inside.

namespace limn {
namespace {

// The largest cosine between an axis and the arc from u_a to u_b.
double max_cosine(const Vec3d& axis, const Vec3d& u_a, const Vec3d& u_b) {
  const double a = dot(axis, u_a), b = dot(axis, u_b), c = dot(u_a, u_b);
  const double along_a = b - a * c, along_b = a - b * c;  // slopes into the arc, times sin gamma
  if (along_a <= 0 || along_b <= 0) return std::max(a, b);
  const double sin_squared = length_squared(cross(u_a, u_b));
  const double peak = sin_squared > 0 ? std::sqrt(a * a + along_a * along_a / sin_squared) : 0;
  return std::clamp(peak, std::max(a, b), 1.0);
}

Lanes component_along(const Vec3<Lanes>& v, const Vec3d& c) {
  return v.x * c.x + v.y * c.y + v.z * c.z;
}

}  // namespace

EdgeSegment segment_of(const EdgeMesh& mesh, EdgeId edge, const EdgeQuery& query) {
  const auto [a, b] = mesh.edge(edge).vertices;
  return {mesh.position(a) - query.p, mesh.position(b) - query.p, relative_velocity(mesh, a, query),
          relative_velocity(mesh, b, query)};
}

LobeBound::LobeBound(const Vec3d& n, const Vec3d& wi, const LobeSummary& lobe)
    : n_(n),
      axis_(lobe.model->axis(n, wi)),
      lobe_(lobe),
      width_(lobe.model->width(lobe)),
      cos_i_(dot(n, wi)) {}

double LobeBound::over_arc(const Vec3d& u_a, const Vec3d& u_b) const {
  const double cos_o = max_cosine(n_, u_a, u_b);
  if (cos_o <= 0) return 0;
  const double cos_axis = axis_ == n_ ? cos_o : max_cosine(axis_, u_a, u_b);
  return lobe_.model->bound(lobe_, cos_i_, cos_o, cos_axis);
}

EdgeBound::EdgeBound(const LobeBound& lobe, const EdgeSegment& segment) {
  if (!clip_to_horizon(lobe, segment)) return;
  cut(lobe);
  cumulative_[0] = 0;
  for (int i = 0; i < pieces_; ++i) {
    weights_[i] = pieces_ == 1 ? whole_bound(lobe) : piece_bound(lobe, i);
    cumulative_[i + 1] = cumulative_[i] + weights_[i];
  }
  if (std::isfinite(cumulative_[pieces_])) total_ = cumulative_[pieces_];
}

bool EdgeBound::clip_to_horizon(const LobeBound& lobe, const EdgeSegment& s) {
  const double h_0 = dot(lobe.n(), s.w_0), h_1 = dot(lobe.n(), s.w_1);
  if (h_0 <= 0 && h_1 <= 0) return false;
  const Vec3d e = s.w_1 - s.w_0, c = cross(s.w_0, e);
  const Lanes d_0 = component_along(s.v_0, c), d_1 = component_along(s.v_1, c);
  if (is_zero(d_0) && is_zero(d_1)) return false;

  if (h_0 < 0) t_begin_ = h_0 / (h_0 - h_1);
  if (h_1 < 0) t_end_ = h_0 / (h_0 - h_1);
  w_a_ = h_0 < 0 ? s.w_0 + e * t_begin_ : s.w_0;
  w_b_ = h_1 < 0 ? s.w_0 + e * t_end_ : s.w_1;
  determinant_a_ = d_0 * (1 - t_begin_) + d_1 * t_begin_;
  determinant_b_ = d_0 * (1 - t_end_) + d_1 * t_end_;
  length_a_ = length(w_a_);
  length_b_ = length(w_b_);
  u_a_ = w_a_ / length_a_;
  u_b_ = w_b_ / length_b_;
  sin_angle_ = length(c) * (t_end_ - t_begin_) / (length_a_ * length_b_);
  return sin_angle_ > 0;
}

// Cuts at distances step * (2^k - 1) from the point closest to the lobe's axis. The step is half
// the larger of the lobe's width and the sine of that closest angle.
void EdgeBound::cut(const LobeBound& lobe) {
  cuts_[0] = 0;
  pieces_ = 1;
  const double peak_cosine = max_cosine(lobe.axis(), u_a_, u_b_);
  const double sine = std::sqrt(std::max(0.0, 1 - peak_cosine * peak_cosine));
  const double step = std::max({0.5 * lobe.width(), 0.5 * sine, 0x1.0p-26});
  if (length_squared(u_b_ - u_a_) <= step * step) return;

  const double end = angle();
  tangent_ = normalize(cross(cross(u_a_, w_b_ - w_a_), u_a_));
  const double a = dot(lobe.axis(), u_a_), b = dot(lobe.axis(), u_b_);
  double peak = std::atan2(dot(lobe.axis(), tangent_), a);
  if (peak < 0 || peak > end) peak = a > b ? 0 : end;
  pieces_ = 0;
  int k = 0;
  while (peak - step * (std::exp2(k + 1) - 1) > 0) ++k;
  for (; k > 0; --k) add_cut(peak - step * (std::exp2(k) - 1));
  add_cut(peak);
  for (k = 1; peak + step * (std::exp2(k) - 1) < end; ++k)
    add_cut(peak + step * (std::exp2(k) - 1));
  add_cut(end);
}

void EdgeBound::add_cut(double angle) {
  if (angle > cuts_[pieces_]) cuts_[++pieces_] = angle;
}

double EdgeBound::angle() const { return std::atan2(sin_angle_, dot(u_a_, u_b_)); }

// The end of a single piece is computed on demand: most bounds are never sampled.
double EdgeBound::piece_end(int i) const { return pieces_ == 1 ? angle() : cuts_[i + 1]; }

// The fraction of the clipped segment (0 at w_a, 1 at w_b) seen at `angle` from u_a; end: the angle
// of the whole arc.
double EdgeBound::fraction_at(double angle, double end) const {
  if (angle >= end) return 1;
  const double near = length_a_ * std::sin(angle);
  return near / (near + length_b_ * std::sin(end - angle));
}

double EdgeBound::whole_bound(const LobeBound& lobe) const {
  return lobe.over_arc(u_a_, u_b_) * jacobian_bound({0, length_a_, u_a_}, {1, length_b_, u_b_});
}

double EdgeBound::piece_bound(const LobeBound& lobe, int i) const {
  const auto point_at = [&](double angle) {
    const double s = fraction_at(angle, cuts_[pieces_]);
    return Point{s, length(w_a_ + (w_b_ - w_a_) * s),
                 u_a_ * std::cos(angle) + tangent_ * std::sin(angle)};
  };
  const Point a = point_at(cuts_[i]), b = point_at(cuts_[i + 1]);
  return lobe.over_arc(a.u, b.u) * jacobian_bound(a, b);
}

double EdgeBound::jacobian_bound(const Point& a, const Point& b) const {
  double determinants = 0;
  for (int i = 0; i < kLanes; ++i) {
    const double difference = determinant_b_[i] - determinant_a_[i];
    determinants += std::max(std::fabs(determinant_a_[i] + difference * a.s),
                             std::fabs(determinant_a_[i] + difference * b.s));
  }
  const double one_plus_cosine = 0.5 * length_squared(a.u + b.u);
  const double squares = a.length * a.length * b.length * b.length;
  const double integral =
      (t_end_ - t_begin_) * (b.s - a.s) * (a.length + b.length) / (squares * one_plus_cosine);
  return determinants * integral;
}

double EdgeBound::sample_t(double u_piece, double u_angle) const {
  const double* first = cumulative_.data() + 1;
  const double* found = std::upper_bound(first, first + pieces_, u_piece * total_);
  const int i = static_cast<int>(std::min<long>(found - first, pieces_ - 1));
  const double angle_at = cuts_[i] + (piece_end(i) - cuts_[i]) * u_angle;
  return t_begin_ + (t_end_ - t_begin_) * fraction_at(angle_at, angle());
}

double EdgeBound::pdf_t(double t) const {
  if (t < t_begin_ || t > t_end_) return 0;
  const double s = (t - t_begin_) / (t_end_ - t_begin_);
  const Vec3d w = w_a_ + (w_b_ - w_a_) * s;
  const double sine = s * length_b_ * sin_angle_;  // |u_a x w|
  const double angle_at = std::atan2(sine, dot(u_a_, w));
  const double* inner = cuts_.data() + 1;
  const int i = static_cast<int>(std::upper_bound(inner, inner + pieces_ - 1, angle_at) - inner);
  const double pdf_angle = weights_[i] / (total_ * (piece_end(i) - cuts_[i]));
  // d angle / ds = |w_a x w_b| / |w|^2
  const double angle_per_t =
      length_a_ * length_b_ * sin_angle_ / (length_squared(w) * (t_end_ - t_begin_));
  return pdf_angle * angle_per_t;
}

}  // namespace limn
