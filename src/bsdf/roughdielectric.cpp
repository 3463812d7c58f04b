// A rough border between two media without absorption (Walter et al. 2007): reflection at
// microfacets, F D G1(wi) G1(wo) / (4 cos_i), and refraction. With eta the index of refraction
// behind the surface over that in front, m = -(wi + eta wo) (its negative for eta < 1), h = m / |m|
// and the radiance that passes scaled by 1 / eta^2,
//   (1 - F) |wi.h| |wo.h| D G1(wi) G1(wo) / (cos_i |m|^2).
// Both include the cosine of wo.
#include <fmt/format.h>

#include <algorithm>

#include "src/bsdf/both_scalars.h"
#include "src/bsdf/fresnel.h"
#include "src/bsdf/indices.h"
#include "src/bsdf/microfacet_reflection.h"
#include "src/bsdf/types.h"

namespace limn {
namespace {

using microfacet::AnisotropicFacets;
using microfacet::Distribution;
using microfacet::Facets;
using microfacet::kMaximumAlpha;
using microfacet::kMinimumAlpha;

// What value and density have in common: of reflection if wo lies above the surface, else of
// refraction.
template <class S>
struct Facet {
  S cos_i, cos_o;  // cos_o < 0 below
  S cos_h;         // wi.h
  // D(h) / 4 for reflection; |wi.m| |wo.m| D(h) / |m|^4 for refraction.
  S d;
  bool above, possible;  // possible: some facet scatters so

  template <class F>
  Facet(const F& facets, const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo, const S& eta)
      : cos_i(dot(n, wi)), cos_o(dot(n, wo)), above(value(cos_o) > 0) {
    possible = value(cos_i) > 0 && value(cos_o) != 0;
    if (!possible) return;
    const Vec3<S> m = above ? wi + wo : (wi + wo * eta) * (value(eta) > 1 ? -1.0 : 1.0);
    const S cos_m = dot(n, m), i = dot(wi, m), o = dot(wo, m), m2 = dot(m, m);
    possible = value(cos_m) > 0 && value(i) > 0 && (above || value(o) < 0);
    if (!possible) return;
    using std::sqrt;
    cos_h = i / sqrt(m2);
    d = facets.density(n, m, cos_m) * (above ? 0.25 * m2 * m2 : -(i * o));
  }
};

class RoughDielectric final : public BothScalars<RoughDielectric> {
 public:
  explicit RoughDielectric(const RoughDielectricValues& v)
      : distribution_(v.distribution),
        alpha_(number(v.alpha_v ? "alpha_u" : "alpha", v.alpha)),
        alpha_v_(v.alpha_v ? number("alpha_v", *v.alpha_v) : BsdfNumber{}),
        tangent_(v.alpha_v ? add_tangent("alpha_u") : -1),
        eta_(v.eta),
        specular_reflectance_(colour("specular_reflectance", v.specular_reflectance)),
        specular_transmittance_(colour("specular_transmittance", v.specular_transmittance)) {
    lobes_ = {.below = true, .through = true};
    set_back(lobes_);
  }

  bool is_constant() const override {
    return limn::is_constant(alpha_.constant) && limn::is_constant(alpha_v_.constant) &&
           limn::is_constant(eta_) && limn::is_constant(specular_reflectance_.constant) &&
           limn::is_constant(specular_transmittance_.constant);
  }
  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list;
    list.push_back({"eta", {&eta_}, ParameterRef::Unit::kValue, kLeastIor, kMostIor});
    add_parameter(is_anisotropic() ? "alpha_u" : "alpha", alpha_, 0, kMaximumAlpha, list);
    if (is_anisotropic()) add_parameter("alpha_v", alpha_v_, 0, kMaximumAlpha, list);
    add_parameter("specular_reflectance", specular_reflectance_, 0, 1, list);
    add_parameter("specular_transmittance", specular_transmittance_, 0, 1, list);
    return list;
  }
  std::string describe() const override {
    return fmt::format(
        "roughdielectric, {}, alpha {}{}, eta {:g}, specular_reflectance {}, "
        "specular_transmittance {}",
        is_ggx() ? "ggx" : "beckmann", text_of(alpha_),
        is_anisotropic() ? " by " + text_of(alpha_v_) : "", eta_.v, text_of(specular_reflectance_),
        text_of(specular_transmittance_));
  }

  template <class S>
  Rgb<S> evaluate(bool front, const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo,
                  const Rgb<S>* at) const;

 private:
  bool is_ggx() const { return distribution_ == Distribution::kGgx; }
  bool is_anisotropic() const { return tangent_ >= 0; }
  template <class S>
  static S alpha(const BsdfNumber& number, const Rgb<S>* at) {
    const S a = number.of(at);
    return value(a) > kMinimumAlpha ? a : S(kMinimumAlpha);
  }
  double largest_alpha(const Rgb<double>* at) const {
    return std::max(alpha(alpha_, at), is_anisotropic() ? alpha(alpha_v_, at) : 0);
  }
  // f(facets), of either kind.
  template <class S, class Function>
  std::invoke_result_t<Function, Facets<S>> with_facets(const Vec3<S>& n, const Rgb<S>* at,
                                                        const Function& f) const {
    if (!is_anisotropic()) return f(Facets<S>{distribution_, alpha(alpha_, at)});
    const Rgb<S> tangent = at ? at[tangent_] : Rgb<S>{};
    return f(AnisotropicFacets<S>(distribution_, alpha(alpha_, at), alpha(alpha_v_, at), n,
                                  Vec3<S>{tangent.r, tangent.g, tangent.b}));
  }
  template <class S>
  S eta_of(bool front) const {
    return front ? as<S>(eta_) : 1.0 / as<S>(eta_);
  }
  FacetSide facet_side(bool front, double cos_h, const Rgb<double>* at) const;

  double pdf_from(bool front, const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                  const Rgb<double>* at) const override;
  std::optional<Vec3d> sample_from(bool front, const Vec3d& n, const Vec3d& wi, double u1,
                                   double u2, const Rgb<double>* at) const override;
  double eta_from(bool front, const Rgb<double>*) const override { return eta_of<double>(front); }
  LobeSummary lobe_from(bool, const Rgb<double>* at) const override {
    double bound = std::max(specular_reflectance_.bound(at), specular_transmittance_.bound(at));
    const double a = largest_alpha(at);
    if (is_anisotropic()) {  // as for roughconductor
      const double ratio = a / std::min(alpha(alpha_, at), alpha(alpha_v_, at));
      bound *= ratio * ratio;
    }
    if (is_ggx()) return {ggx_lobe(), a, bound};
    return {beckmann_lobe(), a, bound * microfacet::kBeckmannRationalExcess};
  }
  PassedLobe passed_lobe_from(bool front, const Vec3d& n, const Vec3d& wi,
                              const Rgb<double>* at) const override;

  Distribution distribution_;
  BsdfNumber alpha_, alpha_v_;
  int tangent_;  // where it stands in `at`; -1 if isotropic
  Dual eta_;     // the index of refraction inside over that outside, not 1
  BsdfColour specular_reflectance_, specular_transmittance_;
};

template <class S>
Rgb<S> RoughDielectric::evaluate(bool front, const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo,
                                 const Rgb<S>* at) const {
  const S eta = eta_of<S>(front);
  return with_facets(n, at, [&](const auto& facets) -> Rgb<S> {
    const Facet<S> facet(facets, n, wi, wo, eta);
    if (!facet.possible) return {};
    const S f = fresnel_dielectric(facet.cos_h, eta).reflected;
    const S cos_o = facet.above ? facet.cos_o : -facet.cos_o;
    const S common = facet.d * facets.masking_over_cos(wi, facet.cos_i) *
                     facets.masking_over_cos(wo, cos_o) * cos_o;
    return facet.above ? specular_reflectance_.of(at) * (common * f)
                       : specular_transmittance_.of(at) * (common * (1.0 - f));
  });
}

FacetSide RoughDielectric::facet_side(bool front, double cos_h, const Rgb<double>* at) const {
  const double f = fresnel_dielectric(cos_h, eta_of<double>(front)).reflected;
  const double passes = 1 - f;  // 0 only where nothing can
  return {f * luminance(specular_reflectance_.of(at)),
          passes > 0 ? std::max(passes * luminance(specular_transmittance_.of(at)), 1e-300) : 0};
}

double RoughDielectric::pdf_from(bool front, const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                                 const Rgb<double>* at) const {
  const double eta = eta_of<double>(front);
  return with_facets(n, at, [&](const auto& facets) -> double {
    const Facet<double> facet(facets, n, wi, wo, eta);
    if (!facet.possible) return 0;
    const FacetSide side = facet_side(front, facet.cos_h, at);
    return facet.d * facets.exact_masking_over_cos(wi, facet.cos_i) *
           (facet.above ? side.reflecting() : side.passing() * (eta * eta));
  });
}

std::optional<Vec3d> RoughDielectric::sample_from(bool front, const Vec3d& n, const Vec3d& wi,
                                                  double u1, double u2,
                                                  const Rgb<double>* at) const {
  if (!(dot(n, wi) > 0)) return std::nullopt;
  return with_facets(n, at, [&](const auto& facets) -> std::optional<Vec3d> {
    const Frame frame = facets.frame(n);
    const Vec3d v = frame.to_local(wi);
    const FacetDigit u(u1);
    const Vec3d h = normalize(facets.visible(v, u.rest, u2));
    const double cos_h = dot(v, h), eta = eta_of<double>(front);
    const bool above = facet_side(front, cos_h, at).reflects(u.digit);
    const Vec3d local =
        above ? reflected(v, h) : refracted(v, h, eta, fresnel_dielectric(cos_h, eta).cos_t);
    const Vec3d wo = normalize(frame.to_world(local));
    if ((dot(n, wo) > 0) != above || dot(n, wo) == 0) return std::nullopt;
    return wo;
  });
}

// The lobe lies about the direction in which a smooth surface would pass the light; half vectors
// turn it |1 - cos_i / (eta cos_t)| times as far as they turn, in place of twice.
Bsdf::PassedLobe RoughDielectric::passed_lobe_from(bool front, const Vec3d& n, const Vec3d& wi,
                                                   const Rgb<double>* at) const {
  constexpr double kGrazing = 0.05, kNarrowest = 1e-3;  // not tuned
  const double cos_i = dot(n, wi), eta = eta_of<double>(front);
  const double cos_t = std::max(kGrazing, fresnel_dielectric(cos_i, eta).cos_t);
  const Vec3d along = n * cos_i - wi;
  const double sine = std::sqrt(1 - cos_t * cos_t), size = length(along);
  const Vec3d axis = size > 0 ? along * (sine / size) - n * cos_t : -n;
  const double turn = 0.5 * std::fabs(1 - cos_i / (eta * cos_t));
  PassedLobe passed{reflected(axis, -n), lobe_from(front, at)};
  passed.lobe.alpha = std::min(1.0, largest_alpha(at) * turn + kNarrowest);
  return passed;
}

}  // namespace

std::shared_ptr<Bsdf> make_roughdielectric(const RoughDielectricValues& values) {
  return std::make_shared<RoughDielectric>(values);
}

std::shared_ptr<Bsdf> read_roughdielectric(Properties& properties) {
  RoughDielectricValues values;
  values.eta = read_relative_ior(properties, "bk7");
  if (values.eta == 1) properties.fail("int_ior", "int_ior and ext_ior must differ");
  values.distribution = read_distribution(properties);
  const microfacet::Roughness roughness = microfacet::read_roughness(properties);
  values.alpha = roughness.u;
  values.alpha_v = roughness.v;
  values.specular_reflectance = read_reflectance(properties, "specular_reflectance", 1);
  values.specular_transmittance = read_reflectance(properties, "specular_transmittance", 1);
  return make_roughdielectric(values);
}

}  // namespace limn
