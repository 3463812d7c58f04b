// A rough conductor: D G1(wi) G1(wo) F / (4 cos_i), which includes the cosine of wo.
#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "limn/core/make_bsdf.h"
#include "src/bsdf/both_scalars.h"
#include "src/bsdf/indices.h"
#include "src/bsdf/microfacet_reflection.h"
#include "src/bsdf/types.h"

namespace limn {
namespace {

using microfacet::AnisotropicFacets, microfacet::Distribution, microfacet::Facets;
using microfacet::is_seen, microfacet::kMaximumAlpha, microfacet::kMinimumAlpha;
using microfacet::Reflection;

class RoughConductor final : public BothScalars<RoughConductor, Bsdf> {
 public:
  explicit RoughConductor(const RoughConductorValues& v)
      : distribution_(v.distribution),
        alpha_(number(v.alpha_v ? "alpha_u" : "alpha", v.alpha)),
        alpha_v_(v.alpha_v ? number("alpha_v", *v.alpha_v) : BsdfNumber{}),
        tangent_(v.alpha_v ? add_tangent("alpha_u") : -1),
        eta_(colour("eta", v.eta)),
        k_(colour("k", v.k)),
        specular_reflectance_(colour("specular_reflectance", v.specular_reflectance)) {}

  double pdf_solid_angle(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                         const Rgb<double>* at) const override {
    if (!is_seen(n, wi, wo)) return 0;
    return with_facets(n, at, [&](const auto& facets) {
      return Reflection<double, std::decay_t<decltype(facets)>>(facets, n, wi, wo).pdf();
    });
  }
  BsdfValue eval_with_pdf(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                          const Rgb<double>* at) const override {
    if (!is_seen(n, wi, wo)) return {};
    return with_facets(n, at, [&](const auto& facets) -> BsdfValue {
      const Reflection<double, std::decay_t<decltype(facets)>> r(facets, n, wi, wo);
      return {coloured(r.cos_h, r.value(), specular(at)), r.pdf()};
    });
  }
  std::optional<Vec3d> sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                              const Rgb<double>* at) const override;
  void eval_with_pdf_each(std::span<const Evaluation> evaluations) const override;
  void sample_each(std::span<const Draw> draws) const override;

  bool is_constant() const override {
    return limn::is_constant(alpha_.constant) && limn::is_constant(alpha_v_.constant) &&
           index_is_constant() && limn::is_constant(specular_reflectance_.constant);
  }
  LobeSummary lobe(const Rgb<double>* at) const override;
  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list;
    add_parameter(is_anisotropic() ? "alpha_u" : "alpha", alpha_, 0, kMaximumAlpha, list);
    if (is_anisotropic()) add_parameter("alpha_v", alpha_v_, 0, kMaximumAlpha, list);
    constexpr double kMost = std::numeric_limits<double>::infinity();
    add_parameter("eta", eta_, 0, kMost, list);
    add_parameter("k", k_, 0, kMost, list);
    add_parameter("specular_reflectance", specular_reflectance_, 0, 1, list);
    return list;
  }
  std::string describe() const override;

  template <class S>
  Rgb<S> evaluate(const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo, const Rgb<S>* at) const {
    if (!is_seen(value(n), value(wi), value(wo))) return {};
    return with_facets(n, at, [&](const auto& facets) {
      const Reflection<S, std::decay_t<decltype(facets)>> r(facets, n, wi, wo);
      return coloured(r.cos_h, r.value(), specular(at));
    });
  }

 private:
  bool is_ggx() const { return distribution_ == Distribution::kGgx; }
  bool is_anisotropic() const { return tangent_ >= 0; }
  bool index_is_constant() const {
    return limn::is_constant(eta_.constant) && limn::is_constant(k_.constant);
  }
  template <class S>
  static S alpha(const BsdfNumber& number, const Rgb<S>* at) {
    const S a = number.of(at);
    return value(a) > kMinimumAlpha ? a : S(kMinimumAlpha);
  }
  template <class S>
  Rgb<S> specular(const Rgb<S>* at) const {
    return specular_reflectance_.of(at);
  }
  // Whether batches go through SIMD: constants alone do.
  bool is_wide() const { return is_ggx() && texture_count() == 0; }
  // f(facets), of either kind.
  template <class S, class Function>
  std::invoke_result_t<Function, Facets<S>> with_facets(const Vec3<S>& n, const Rgb<S>* at,
                                                        const Function& f) const {
    if (!is_anisotropic()) return f(Facets<S>{distribution_, alpha(alpha_, at)});
    const Rgb<S> tangent = at ? at[tangent_] : Rgb<S>{};
    return f(AnisotropicFacets<S>(distribution_, alpha(alpha_, at), alpha(alpha_v_, at), n,
                                  Vec3<S>{tangent.r, tangent.g, tangent.b}));
  }
  // Times Fresnel's factor. specular: S, or double for wide::Doubles.
  template <class S, class T>
  Rgb<S> coloured(const S& cos_h, const S& common, const Rgb<T>& specular) const;

  Distribution distribution_;
  BsdfNumber alpha_, alpha_v_;
  int tangent_;  // where it stands in `at`; -1 if isotropic
  BsdfColour eta_, k_, specular_reflectance_;
};

template <class S, class T>
Rgb<S> RoughConductor::coloured(const S& cos_h, const S& common, const Rgb<T>& specular) const {
  const Rgb<Dual>&n = eta_.constant, &m = k_.constant;
  if constexpr (std::is_same_v<S, Dual>) {
    if (!index_is_constant()) {
      Rgb<S> reflectance;
      for (int c = 0; c < 3; ++c) reflectance[c] = microfacet::fresnel_conductor(cos_h, n[c], m[c]);
      return specular * reflectance * common;
    }
  }
  // Arrays of four, so that the compiler vectorises doubles.
  const double eta[4] = {n.r.v, n.g.v, n.b.v, 1}, k[4] = {m.r.v, m.g.v, m.b.v, 1};
  constexpr int kCount = std::is_same_v<S, double> ? 4 : 3;
  S f[kCount];
  for (int i = 0; i < kCount; ++i) f[i] = microfacet::fresnel_conductor(cos_h, eta[i], k[i]);
  const Rgb<S> reflectance{f[0], f[1], f[2]};
  return specular * reflectance * common;
}

void RoughConductor::eval_with_pdf_each(std::span<const Evaluation> evaluations) const {
  if (!is_wide()) return Bsdf::eval_with_pdf_each(evaluations);
  const Facets<wide::Doubles> facets{distribution_, alpha<double>(alpha_, nullptr)};
  const Rgb<double> reflectance = specular<double>(nullptr);
  wide::for_blocks(evaluations.size(), [&](size_t first, size_t last) {
    const auto vectors = [&](const Vec3d* Evaluation::*of) {
      return wide::gather_vectors(
          [&](int i) { return evaluations[std::min(first + i, last - 1)].*of; });
    };
    const wide::Vec wi = vectors(&Evaluation::wi), wo = vectors(&Evaluation::wo);
    const Reflection<wide::Doubles> r(facets, vectors(&Evaluation::n), wi, wo);
    const Rgb<wide::Doubles> f = coloured(r.cos_h, r.value(), reflectance);
    const wide::Doubles pdf = r.pdf();
    for (size_t i = first; i < last; ++i) {
      const int k = static_cast<int>(i - first);
      const bool seen = r.cos_i[k] > 0 && r.cos_o[k] > 0;
      *evaluations[i].value = seen ? BsdfValue{{f.r[k], f.g[k], f.b[k]}, pdf[k]} : BsdfValue{};
    }
  });
}

std::optional<Vec3d> RoughConductor::sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                                            const Rgb<double>* at) const {
  if (!(dot(n, wi) > 0)) return std::nullopt;
  return with_facets(n, at, [&](const auto& facets) {
    return microfacet::sample_reflection(facets, n, wi, u1, u2);
  });
}

void RoughConductor::sample_each(std::span<const Draw> draws) const {
  if (!is_wide()) return Bsdf::sample_each(draws);
  const double a = alpha<double>(alpha_, nullptr);
  wide::for_blocks(draws.size(), [&](size_t first, size_t last) {
    const auto draw = [&](int i) -> const Draw& { return draws[std::min(first + i, last - 1)]; };
    const auto number = [&](int k) { return wide::gather([&](int i) { return draw(i).u[k]; }); };
    const wide::Vec n = wide::gather_vectors([&](int i) { return draw(i).n; });
    const wide::Vec wi = wide::gather_vectors([&](int i) { return draw(i).wi; });
    const FrameOf<wide::Doubles> frame(n);
    const wide::Vec v = frame.to_local(wi);
    const wide::Vec wo =
        microfacet::mirrored(frame, v, microfacet::ggx_visible(v, a, a, number(0), number(1)));
    const wide::Doubles cos_o = dot(n, wo);
    for (size_t i = first; i < last; ++i) {
      const int k = static_cast<int>(i - first);
      *draws[i].wo = v.z[k] > 0 && cos_o[k] > 0 ? wide::lane(wo, k) : Vec3d{};
    }
  });
}

LobeSummary RoughConductor::lobe(const Rgb<double>* at) const {
  double bound = specular_reflectance_.bound(at), a = alpha(alpha_, at);
  if (is_anisotropic()) {
    const double b = alpha(alpha_v_, at), ratio = std::max(a, b) / std::min(a, b);
    a = std::max(a, b);
    // With the larger roughness D is at most this ratio larger, and so is G1.
    bound *= ratio * ratio;
  }
  if (is_ggx()) return {ggx_lobe(), a, bound};
  return {beckmann_lobe(), a, bound * microfacet::kBeckmannRationalExcess};
}

std::string RoughConductor::describe() const {
  std::string text =
      fmt::format("roughconductor, {}, alpha {}{}, eta {}, k {}", is_ggx() ? "ggx" : "beckmann",
                  text_of(alpha_), is_anisotropic() ? " by " + text_of(alpha_v_) : "",
                  text_of(eta_), text_of(k_));
  if (specular_reflectance_.texture >= 0) {
    text += ", specular_reflectance " + text_of(specular_reflectance_);
  }
  return text;
}

}  // namespace

std::shared_ptr<Bsdf> make_roughconductor(const RoughConductorValues& values) {
  return std::make_shared<RoughConductor>(values);
}

std::shared_ptr<Bsdf> read_roughconductor(Properties& properties) {
  RoughConductorValues values;
  values.distribution = read_distribution(properties);
  const microfacet::Roughness roughness = microfacet::read_roughness(properties);
  values.alpha = roughness.u;
  values.alpha_v = roughness.v;
  values.specular_reflectance = read_reflectance(properties, "specular_reflectance", 1);
  const ConductorIndices indices = read_conductor_indices(properties);
  values.eta = indices.eta;
  values.k = indices.k;
  return make_roughconductor(values);
}

}  // namespace limn
