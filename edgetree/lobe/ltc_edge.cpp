// Integrals of a transformed cosine along an edge, and sampling in proportion.
#include <algorithm>
#include <cmath>
#include <limits>

#include "edgetree/lobe/ltc.h"
#include "edgetree/lobe/ltc_table.h"

namespace limn {
namespace {

// The error after a Newton step is about its square, after a bisection the step itself; bisection
// alone takes 48 steps to this precision.
constexpr double kPrecision = 0x1p-48;
constexpr int kMaxSteps = 60;  // not reached: the bracket ends the iteration
// Sine of the smallest angle that a cross product of rounded vectors resolves.
constexpr double kParallel = 0x1p-50;

// psi - sin(psi) cos(psi), without cancellation.
double angle_minus_product(double psi, double sine, double cosine) {
  if (psi > 0.4) return psi - sine * cosine;
  // (y - sin y) / 2 for y = 2 psi, by its series; the next term is below 1e-17 of the sum.
  const double y2 = 4 * psi * psi;
  double sum = 0;
  for (int k = 15; k >= 3; k -= 2) sum = y2 / (k * (k - 1)) * (1 - sum);
  return psi * sum;
}

// The part of [begin, end] where a linear function with values h_0, h_1 at 0 and 1 is positive.
void clip(double h_0, double h_1, double& begin, double& end) {
  if (h_0 <= 0 && h_1 <= 0) end = begin;
  if (h_0 < 0 && h_1 > 0) begin = std::max(begin, h_0 / (h_0 - h_1));
  if (h_1 < 0 && h_0 > 0) end = std::min(end, h_0 / (h_0 - h_1));
}

}  // namespace

LtcEdge::LtcEdge(const LtcLobe& lobe, const Vec3d& w_0, const Vec3d& w_1) {
  double begin = 0, end = 1;
  const Vec3d along = w_1 - w_0;
  clip(dot(lobe.n(), w_0), dot(lobe.n(), w_1), begin, end);
  if (!(end > begin)) return;
  const Frame frame(lobe.n());
  arcs_[1].t_begin = begin;
  arcs_[1].t_end = end;
  arcs_[1].set(frame.to_local(w_0), frame.to_local(along), lobe.cosine() / kPi);
  if (lobe.diffuse()) return;

  const Vec3d v_0 = lobe.transform(w_0), v_along = lobe.transform(along);
  clip(v_0.z, v_0.z + v_along.z, begin, end);
  if (!(end > begin)) return;
  arcs_[0].t_begin = begin;
  arcs_[0].t_end = end;
  arcs_[0].set(v_0, v_along, (1 - lobe.cosine()) * lobe.det() / kPi);
}

void LtcEdge::Arc::set(const Vec3d& w_0, const Vec3d& w_along, double factor) {
  start = w_0 + w_along * t_begin;
  along = w_along * (t_end - t_begin);
  area = length(cross(start, along));
  // On p's line up to rounding, where the Jacobian is rounding, too.
  const double length_a = length(start);
  if (!(area > kParallel * length_a * length(along))) return;
  const double projection = dot(start, along) / length_a;
  zeta_a = std::max(0.0, start.z) / length_a;
  zeta_t = (along.z - zeta_a * projection) * length_a / area;
  k_a = 1 / length_a;
  k_t = -projection / area;
  angle = std::atan2(area, dot(start, start + along));
  scale = factor;
  const double sum = cumulative(angle, std::sin(angle), std::cos(angle));
  integral = factor * (t_end - t_begin) / area * sum;
  if (!(integral > 0 && integral <= std::numeric_limits<double>::max())) integral = 0;
}

// Integral of zeta k over [0, psi].
double LtcEdge::Arc::cumulative(double psi, double sine, double cosine) const {
  return 0.5 * (zeta_a * k_a * (psi + sine * cosine) + (zeta_a * k_t + zeta_t * k_a) * sine * sine +
                zeta_t * k_t * angle_minus_product(psi, sine, cosine));
}

// Newton's method on the cumulative, safeguarded by a bracket; starts from a linear zeta k.
double LtcEdge::Arc::sample_t(double u) const {
  const double target = u * integral * area / (scale * (t_end - t_begin));
  const double sin_end = std::sin(angle), cos_end = std::cos(angle);
  const double f_0 = zeta_a * k_a;
  const double f_1 =
      std::max(0.0, (zeta_a * cos_end + zeta_t * sin_end) * (k_a * cos_end + k_t * sin_end));
  const double root = std::sqrt(f_0 * f_0 + u * (f_1 * f_1 - f_0 * f_0));
  double low = 0, high = angle;
  double psi = angle * (f_0 + f_1 > 0 ? u * (f_0 + f_1) / (f_0 + root) : u);
  for (int i = 0; i < kMaxSteps; ++i) {
    const double s = std::sin(psi), c = std::cos(psi);
    const double error = cumulative(psi, s, c) - target;
    (error > 0 ? high : low) = psi;
    const double slope = (zeta_a * c + zeta_t * s) * (k_a * c + k_t * s);
    double next = psi - error / slope;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    const double step = std::fabs(next - psi);
    psi = next;
    if (step <= kPrecision * angle) break;
  }
  // |start x w'| = s area = |start| |w'| sin(psi)
  const double sine = std::sin(psi);
  const double fraction = sine / (k_a * area * (k_a * std::cos(psi) + k_t * sine));
  return t_begin + (t_end - t_begin) * (fraction >= 0 && fraction <= 1 ? fraction : 1);
}

double LtcEdge::Arc::value(double t) const {
  if (integral == 0 || t < t_begin || t > t_end) return 0;
  const Vec3d w = start + along * ((t - t_begin) / (t_end - t_begin));
  const double r2 = length_squared(w);
  return scale * std::max(0.0, w.z) / (r2 * r2);
}

double LtcEdge::sample_t(double u) const {
  const double at = u * integral();
  if (at < arcs_[0].integral) return arcs_[0].sample_t(at / arcs_[0].integral);
  return arcs_[1].sample_t(std::min(1.0, (at - arcs_[0].integral) / arcs_[1].integral));
}

double LtcEdge::pdf_t(double t) const {
  return (arcs_[0].value(t) + arcs_[1].value(t)) / integral();
}

}  // namespace limn
