// A rough plastic: a diffuse base under a rough dielectric boundary, as in Mitsuba,
//   rho T(cos_i) T(cos_o) cos_o / ((1 - rho R) pi eta^2) + ks F D G1(wi) G1(wo) / (4 cos_i),
// with the boundary's transmittance T and inner reflectance R; without `nonlinear`, 1 - R stands
// for 1 - rho R.
#include <fmt/format.h>

#include <algorithm>

#include "limn/core/make_bsdf.h"
#include "src/bsdf/both_scalars.h"
#include "src/bsdf/cosine.h"
#include "src/bsdf/fresnel.h"
#include "src/bsdf/indices.h"
#include "src/bsdf/rough_boundary.h"
#include "src/bsdf/types.h"

namespace limn {
namespace {

using microfacet::Facets, microfacet::Reflection;
using microfacet::is_seen, microfacet::kMaximumAlpha, microfacet::kMinimumAlpha;

class RoughPlastic final : public BothScalars<RoughPlastic, Bsdf> {
 public:
  explicit RoughPlastic(const RoughPlasticValues& v)
      : distribution_(v.distribution),
        alpha_(v.alpha),
        eta_(v.eta),
        nonlinear_(v.nonlinear),
        diffuse_(colour("diffuse_reflectance", v.diffuse_reflectance)),
        specular_(colour("specular_reflectance", v.specular_reflectance)),
        boundary_(v.distribution, alpha<double>(), v.eta) {}

  double pdf_solid_angle(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                         const Rgb<double>* at) const override {
    if (!is_seen(n, wi, wo)) return 0;
    const Facets<double> f = facets<double>();
    return density(Reflection<double>(f, n, wi, wo), at);
  }
  BsdfValue eval_with_pdf(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                          const Rgb<double>* at) const override {
    if (!is_seen(n, wi, wo)) return {};
    const Facets<double> f = facets<double>();
    const Reflection<double> r(f, n, wi, wo);
    return {both(r, at), density(r, at)};
  }
  std::optional<Vec3d> sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                              const Rgb<double>* at) const override;

  bool is_constant() const override {
    return limn::is_constant(alpha_) && limn::is_constant(eta_) &&
           limn::is_constant(diffuse_.constant) && limn::is_constant(specular_.constant);
  }
  LobeSummary lobe(const Rgb<double>* at) const override;
  std::vector<ParameterRef> parameters() override;
  std::string describe() const override;

  template <class S>
  Rgb<S> evaluate(const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo, const Rgb<S>* at) const {
    if (!is_seen(value(n), value(wi), value(wo))) return {};
    const Facets<S> f = facets<S>();
    return both(Reflection<S>(f, n, wi, wo), at);
  }

 private:
  template <class S>
  S alpha() const {
    return value(alpha_) > kMinimumAlpha ? as<S>(alpha_) : S(kMinimumAlpha);
  }
  template <class S>
  Facets<S> facets() const {
    return {distribution_, alpha<S>()};
  }
  // The two parts.
  template <class S>
  Rgb<S> both(const Reflection<S>& r, const Rgb<S>* at) const;
  double density(const Reflection<double>& r, const Rgb<double>* at) const {
    const double p = glossy_probability(r.cos_i, at);
    return p * r.pdf() + (1 - p) * r.cos_o / kPi;
  }
  double glossy_probability(double cos_i, const Rgb<double>* at) const;
  // Factor of T(cos_i) T(cos_o) cos_o in the diffuse part of one channel.
  template <class S>
  S base(const S& reflectance) const {
    const S inner = boundary_.inner_reflectance(alpha<S>(), as<S>(eta_));
    const S eta = as<S>(eta_);
    return reflectance / ((1.0 - (nonlinear_ ? reflectance * inner : inner)) * (kPi * eta * eta));
  }

  microfacet::Distribution distribution_;
  Dual alpha_, eta_;
  bool nonlinear_;
  BsdfColour diffuse_, specular_;
  RoughBoundary boundary_;  // of the values of alpha and eta
};

template <class S>
Rgb<S> RoughPlastic::both(const Reflection<S>& r, const Rgb<S>* at) const {
  const S a = alpha<S>(), eta = as<S>(eta_);
  const S passes =
      boundary_.transmittance(r.cos_i, a, eta) * boundary_.transmittance(r.cos_o, a, eta) * r.cos_o;
  const S glossy = fresnel_dielectric<S>(r.cos_h, eta).reflected * r.value();
  const Rgb<S> rho = diffuse_.of(at);
  return Rgb<S>{base(rho.r), base(rho.g), base(rho.b)} * passes + specular_.of(at) * glossy;
}

// By the light that each part reflects, about. Neither is left out: both have derivatives where
// they are black. Not tuned.
double RoughPlastic::glossy_probability(double cos_i, const Rgb<double>* at) const {
  const auto mean = [](const Rgb<double>& c) { return c.r + c.g + c.b; };
  const double passes = boundary_.transmittance(cos_i, alpha_.v, eta_.v);
  const double glossy = (1 - passes) * mean(specular_.of<double>(at));
  const double diffuse = passes * mean(diffuse_.of<double>(at));
  return glossy + diffuse > 0 ? std::clamp(glossy / (glossy + diffuse), 0.1, 0.9) : 0.5;
}

std::optional<Vec3d> RoughPlastic::sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                                          const Rgb<double>* at) const {
  const double cos_i = dot(n, wi);
  if (!(cos_i > 0)) return std::nullopt;
  const double p = glossy_probability(cos_i, at);
  if (u1 < p) return microfacet::sample_reflection(facets<double>(), n, wi, u1 / p, u2);
  return sample_cosine(n, (u1 - p) / (1 - p), u2);
}

LobeSummary RoughPlastic::lobe(const Rgb<double>* at) const {
  const bool ggx = distribution_ == microfacet::Distribution::kGgx;
  const double passes = boundary_.most();
  LobeSummary lobe(ggx ? ggx_lobe() : beckmann_lobe(), alpha<double>(),
                   specular_.bound(at) * (ggx ? 1 : microfacet::kBeckmannRationalExcess));
  lobe.diffuse = kPi * base(diffuse_.bound(at)) * passes * passes;
  lobe.albedo += lobe.diffuse;
  lobe.facing = specular_.bound(at) * fresnel_dielectric<double>(1, eta_.v).reflected;
  return lobe;
}

std::vector<ParameterRef> RoughPlastic::parameters() {
  std::vector<ParameterRef> list;
  add_parameter("diffuse_reflectance", diffuse_, 0, 1, list);
  add_parameter("specular_reflectance", specular_, 0, 1, list);
  const auto update = [this] { boundary_ = RoughBoundary(distribution_, alpha<double>(), eta_.v); };
  list.push_back({"alpha", {&alpha_}, ParameterRef::Unit::kValue, 0, kMaximumAlpha});
  list.back().changed = update;
  list.push_back({"eta", {&eta_}, ParameterRef::Unit::kValue, kLeastIor, kMostIor});
  list.back().changed = update;
  return list;
}

std::string RoughPlastic::describe() const {
  std::string text =
      fmt::format("roughplastic, {}, alpha {:g}, eta {:g}, diffuse_reflectance {}",
                  distribution_ == microfacet::Distribution::kGgx ? "ggx" : "beckmann", alpha_.v,
                  eta_.v, text_of(diffuse_));
  if (nonlinear_) text += " (nonlinear)";
  const Rgb<double> ks = value(specular_.constant);
  if (specular_.texture >= 0 || ks.r != 1 || ks.g != 1 || ks.b != 1) {
    text += ", specular_reflectance " + text_of(specular_);
  }
  return text;
}

}  // namespace

std::shared_ptr<Bsdf> make_roughplastic(const RoughPlasticValues& values) {
  return std::make_shared<RoughPlastic>(values);
}

std::shared_ptr<Bsdf> read_roughplastic(Properties& properties) {
  RoughPlasticValues values;
  values.distribution = read_distribution(properties);
  const ConstantOrTexture alpha = read_alpha(properties);
  if (alpha.texture) properties.fail("alpha", "the roughness of a roughplastic is a number");
  values.alpha = alpha.constant.r;
  values.eta = read_relative_ior(properties, "polypropylene");
  values.nonlinear = properties.boolean("nonlinear", false);
  values.diffuse_reflectance = read_reflectance(properties, "diffuse_reflectance", 0.5);
  values.specular_reflectance = read_reflectance(properties, "specular_reflectance", 1);
  return make_roughplastic(values);
}

}  // namespace limn
