// Upper bounds of microfacet lobes D G1(wi) G1(wo) F / (4 cos_i), which include the cosine of wo.
//
// Let r be the mirror image of wi about n. The rotation from r to wo is the product of the
// reflections about n and h, a rotation by 2 theta_h. So the angle between r and wo is at most 2
// theta_h, and D(theta_h) is at most the maximum of D from half that angle on. G is at most the
// smaller of its two factors, and F at most the albedo. Diffuse light beside it adds its own bound.
#include <algorithm>
#include <cmath>

#include "limn/core/lobe.h"

namespace limn {
namespace {

class MicrofacetLobe : public LobeModel {
 public:
  Vec3d axis(const Vec3d& n, const Vec3d& wi) const override {
    return normalize(n * (2 * dot(n, wi)) - wi);
  }
  double width(const LobeSummary& lobe) const override { return std::min(1.0, lobe.alpha); }
  double bound(const LobeSummary& lobe, double cos_i, double cos_o,
               double cos_axis) const override {
    const double masked = std::min(masking(cos_i, lobe.alpha), masking(cos_o, lobe.alpha));
    return (lobe.albedo - lobe.diffuse) / (4 * cos_i) *
               distribution(0.5 * (1 + cos_axis), lobe.alpha) * masked +
           lobe.diffuse / kPi * cos_o;
  }

 protected:
  // Maximum of D over angles >= theta, with cos_squared = cos^2 theta.
  virtual double distribution(double cos_squared, double alpha) const = 0;
  // Upper bound of Smith's G1, increasing with the cosine.
  virtual double masking(double cos_theta, double alpha) const = 0;
  static double scaled_tangent(double cos_theta, double alpha) {
    return alpha * (std::sqrt(std::max(0.0, 1 - cos_theta * cos_theta)) / cos_theta);
  }
};

class GgxLobe final : public MicrofacetLobe {
 public:
  std::optional<LtcRow> ltc(const LobeSummary& lobe) const override {
    return LtcRow{LtcRow::Table::kGgx, lobe.alpha};
  }

 private:
  double distribution(double cos_squared, double alpha) const override {
    const double a2 = alpha * alpha, k = cos_squared * a2 + (1 - cos_squared);
    return a2 / (kPi * std::min(k * k, 1.0));  // falls with theta if alpha < 1, else rises to 1
  }
  double masking(double cos_theta, double alpha) const override {
    if (cos_theta <= 0) return 0;
    const double x = scaled_tangent(cos_theta, alpha);
    return 2 / (1 + std::sqrt(1 + x * x));
  }
};

class BeckmannLobe final : public MicrofacetLobe {
 public:
  std::optional<LtcRow> ltc(const LobeSummary& lobe) const override {
    return LtcRow{LtcRow::Table::kBeckmann, lobe.alpha};
  }

 private:
  // log D peaks at cos^2 = 1 / (2 alpha^2).
  double distribution(double cos_squared, double alpha) const override {
    const double a2 = alpha * alpha, c2 = std::min(cos_squared, 1 / (2 * a2));
    return c2 > 0 ? std::exp(-(1 - c2) / (c2 * a2)) / (kPi * a2 * c2 * c2) : 0;
  }
  // 1 / (1 + Lambda(a)) and its rational fit by Walter et al. 2007 stay below 2 sqrt(pi) a,
  // a = 1 / (alpha tan theta).
  double masking(double cos_theta, double alpha) const override {
    if (cos_theta <= 0) return 0;
    const double x = scaled_tangent(cos_theta, alpha), slope = 2 * std::sqrt(kPi);
    return x <= slope ? 1 : slope / x;
  }
};

constexpr GgxLobe kGgx;
constexpr BeckmannLobe kBeckmann;

}  // namespace

const LobeModel& ggx_lobe() { return kGgx; }
const LobeModel& beckmann_lobe() { return kBeckmann; }

}  // namespace limn
