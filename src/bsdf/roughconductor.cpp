// A rough conductor: D G1(wi) G1(wo) F / (4 cos_i), which includes the cosine of wo.
#include <fmt/format.h>

#include <algorithm>

#include "limn/core/names.h"
#include "src/bsdf/indices.h"
#include "src/bsdf/microfacet.h"
#include "src/bsdf/types.h"

namespace limn {
namespace {

using Distribution = RoughConductorValues::Distribution;

constexpr double kMinimumAlpha = 1e-4;  // as in Mitsuba
constexpr double kMaximumAlpha = 1e6;

// Terms shared by value and density for a pair of directions in front of the surface.
template <class S>
struct Reflection {
  S cos_i, cos_o;
  S cos_h;  // wi.h
  S d;      // D(h)
  S alpha;  // roughness
};

class RoughConductor final : public Bsdf {
 public:
  explicit RoughConductor(const RoughConductorValues& v)
      : distribution_(v.distribution),
        alpha_(number("alpha", v.alpha)),
        eta_(v.eta),
        k_(v.k),
        specular_reflectance_(colour("specular_reflectance", v.specular_reflectance)) {}

  Rgb<double> eval(const Vec3<double>& n, const Vec3<double>& wi, const Vec3<double>& wo,
                   const Rgb<double>* at) const override {
    return is_seen(n, wi, wo) ? evaluate(reflect(alpha(at), n, wi, wo), specular(at))
                              : Rgb<double>();
  }
  Rgb<Dual> eval(const Vec3<Dual>& n, const Vec3<Dual>& wi, const Vec3<Dual>& wo,
                 const Rgb<Dual>* at) const override {
    return is_seen(value(n), value(wi), value(wo))
               ? evaluate(reflect(alpha(at), n, wi, wo), specular(at))
               : Rgb<Dual>();
  }
  double pdf_solid_angle(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                         const Rgb<double>* at) const override {
    return is_seen(n, wi, wo) ? density(reflect(alpha(at), n, wi, wo)) : 0;
  }
  BsdfValue eval_with_pdf(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                          const Rgb<double>* at) const override {
    if (!is_seen(n, wi, wo)) return {};
    const Reflection<double> r = reflect(alpha(at), n, wi, wo);
    return {evaluate(r, specular(at)), density(r)};
  }
  std::optional<Vec3d> sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                              const Rgb<double>* at) const override;
  void eval_with_pdf_each(std::span<const Evaluation> evaluations) const override;
  void sample_each(std::span<const Draw> draws) const override;

  bool is_constant() const override {
    return limn::is_constant(alpha_.constant) && limn::is_constant(specular_reflectance_.constant);
  }
  LobeSummary lobe(const Rgb<double>* at) const override;
  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list;
    add_parameter("alpha", alpha_, 0, kMaximumAlpha, list);
    add_parameter("specular_reflectance", specular_reflectance_, 0, 1, list);
    return list;
  }
  std::shared_ptr<Bsdf> clone() const override { return std::make_shared<RoughConductor>(*this); }
  std::string describe() const override;

 private:
  bool is_ggx() const { return distribution_ == Distribution::kGgx; }
  template <class S>
  S alpha(const Rgb<S>* at) const {
    const S a = alpha_.of(at);
    return value(a) > kMinimumAlpha ? a : S(kMinimumAlpha);
  }
  template <class S>
  Rgb<S> specular(const Rgb<S>* at) const {
    return specular_reflectance_.of(at);
  }
  // Whether batches go through SIMD: constants alone do.
  bool is_wide() const { return is_ggx() && texture_count() == 0; }
  static bool is_seen(const Vec3d& n, const Vec3d& wi, const Vec3d& wo) {
    return dot(n, wi) > 0 && dot(n, wo) > 0;
  }
  template <class S>
  Reflection<S> reflect(const S& alpha, const Vec3<S>& n, const Vec3<S>& wi,
                        const Vec3<S>& wo) const;
  // specular: S, or double for wide::Doubles.
  template <class S, class T>
  Rgb<S> evaluate(const Reflection<S>& r, const Rgb<T>& specular) const;
  template <class S>
  S density(const Reflection<S>& r) const;
  // GGX or Beckmann functions of microfacet.h; only GGX for wide::Doubles.
  template <class S>
  S distribution(const S& cos2, const S& sin2, const S& alpha) const {
    if constexpr (std::is_same_v<S, wide::Doubles>) {
      return microfacet::ggx_d<S>(cos2, sin2, alpha);
    } else {
      return is_ggx() ? microfacet::ggx_d(cos2, sin2, alpha)
                      : microfacet::beckmann_d(cos2, sin2, alpha);
    }
  }
  template <class S>
  S masking_over_cos(const S& cos_v, const S& alpha) const {
    if constexpr (std::is_same_v<S, wide::Doubles>) {
      return microfacet::ggx_g1_over_cos<S>(cos_v, alpha);
    } else {
      return is_ggx() ? microfacet::ggx_g1_over_cos(cos_v, alpha)
                      : microfacet::beckmann_g1_over_cos(cos_v, alpha);
    }
  }
  // Reflects wi at a facet whose normal may have any length.
  template <class S>
  static Vec3<S> mirrored(const FrameOf<S>& frame, const Vec3<S>& v, const Vec3<S>& h) {
    return normalize(frame.to_world(h * (2.0 * dot(v, h) / dot(h, h)) - v));
  }

  Distribution distribution_;
  BsdfNumber alpha_;
  Rgb<double> eta_, k_;
  BsdfColour specular_reflectance_;
};

// The sine of the half vector is computed by a cross product: 1 - cos^2 would cancel at small
// roughness. With m = wi + wo: h = m / |m| and wi.h = |m| / 2.
template <class S>
Reflection<S> RoughConductor::reflect(const S& alpha, const Vec3<S>& n, const Vec3<S>& wi,
                                      const Vec3<S>& wo) const {
  using std::sqrt;
  Reflection<S> r;
  r.alpha = alpha;
  r.cos_i = dot(n, wi);
  r.cos_o = dot(n, wo);
  const Vec3<S> m = wi + wo;
  const S m2 = dot(m, m);
  const S cos_m = r.cos_i + r.cos_o;
  const S cos2 = cos_m * cos_m, sin2 = length_squared(cross(n, m));  // times m2
  r.cos_h = 0.5 * sqrt(m2);
  r.d = distribution(cos2, sin2, alpha) * (m2 * m2);
  return r;
}

template <class S, class T>
Rgb<S> RoughConductor::evaluate(const Reflection<S>& r, const Rgb<T>& specular) const {
  const S masking = masking_over_cos(r.cos_i, r.alpha) * masking_over_cos(r.cos_o, r.alpha);
  const S common = r.d * masking * r.cos_o * 0.25;
  // Arrays of four, so that the compiler vectorises doubles.
  const double eta[4] = {eta_.r, eta_.g, eta_.b, 1}, k[4] = {k_.r, k_.g, k_.b, 1};
  constexpr int kCount = std::is_same_v<S, double> ? 4 : 3;
  S f[kCount];
  for (int i = 0; i < kCount; ++i) f[i] = microfacet::fresnel_conductor(r.cos_h, eta[i], k[i]);
  const Rgb<S> reflectance{f[0], f[1], f[2]};
  return specular * reflectance * common;
}

// The density of visible normals is D G1(wi) (wi.h) / cos_i per solid angle of h; reflection
// divides it by 4 (wi.h). For Beckmann it uses the exact G1, since the rational fit in `evaluate`
// does not integrate to 1.
template <class S>
S RoughConductor::density(const Reflection<S>& r) const {
  if constexpr (std::is_same_v<S, double>) {
    if (!is_ggx()) {
      return 0.25 * r.d * microfacet::beckmann_exact_g1_over_cos(r.cos_i, r.alpha);
    }
  }
  return 0.25 * r.d * masking_over_cos(r.cos_i, r.alpha);
}

void RoughConductor::eval_with_pdf_each(std::span<const Evaluation> evaluations) const {
  if (!is_wide()) return Bsdf::eval_with_pdf_each(evaluations);
  const wide::Doubles roughness = alpha<double>(nullptr);
  const Rgb<double> reflectance = specular<double>(nullptr);
  wide::for_blocks(evaluations.size(), [&](size_t first, size_t last) {
    const auto vectors = [&](const Vec3d* Evaluation::*of) {
      return wide::gather_vectors(
          [&](int i) { return evaluations[std::min(first + i, last - 1)].*of; });
    };
    const Reflection<wide::Doubles> r = reflect(roughness, vectors(&Evaluation::n),
                                                vectors(&Evaluation::wi), vectors(&Evaluation::wo));
    const Rgb<wide::Doubles> f = evaluate(r, reflectance);
    const wide::Doubles pdf = density(r);
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
  const double a = alpha(at);
  const Frame frame(n);
  const Vec3d v = frame.to_local(wi);
  const Vec3d wo = mirrored(frame, v,
                            is_ggx() ? microfacet::ggx_visible(v, a, u1, u2)
                                     : microfacet::beckmann_visible(v, a, u1, u2));
  if (!(dot(n, wo) > 0)) return std::nullopt;
  return wo;
}

void RoughConductor::sample_each(std::span<const Draw> draws) const {
  if (!is_wide()) return Bsdf::sample_each(draws);
  const double a = alpha<double>(nullptr);
  wide::for_blocks(draws.size(), [&](size_t first, size_t last) {
    const auto draw = [&](int i) -> const Draw& { return draws[std::min(first + i, last - 1)]; };
    const auto number = [&](int k) { return wide::gather([&](int i) { return draw(i).u[k]; }); };
    const wide::Vec n = wide::gather_vectors([&](int i) { return draw(i).n; });
    const wide::Vec wi = wide::gather_vectors([&](int i) { return draw(i).wi; });
    const FrameOf<wide::Doubles> frame(n);
    const wide::Vec v = frame.to_local(wi);
    const wide::Vec wo = mirrored(frame, v, microfacet::ggx_visible(v, a, number(0), number(1)));
    const wide::Doubles cos_o = dot(n, wo);
    for (size_t i = first; i < last; ++i) {
      const int k = static_cast<int>(i - first);
      *draws[i].wo = v.z[k] > 0 && cos_o[k] > 0 ? wide::lane(wo, k) : Vec3d{};
    }
  });
}

LobeSummary RoughConductor::lobe(const Rgb<double>* at) const {
  const double bound = specular_reflectance_.bound(at);
  if (is_ggx()) return {ggx_lobe(), alpha(at), bound};
  return {beckmann_lobe(), alpha(at), bound * microfacet::kBeckmannRationalExcess};
}

std::string RoughConductor::describe() const {
  std::string text = fmt::format(
      "roughconductor, {}, alpha {}, eta {:g} {:g} {:g}, k {:g} {:g} {:g}",
      is_ggx() ? "ggx" : "beckmann", text_of(alpha_), eta_.r, eta_.g, eta_.b, k_.r, k_.g, k_.b);
  if (specular_reflectance_.texture >= 0) {
    text += ", specular_reflectance " + text_of(specular_reflectance_);
  }
  return text;
}

}  // namespace

ConstantOrTexture read_alpha(Properties& properties) {
  if (auto texture = properties.texture("alpha")) return texture;
  const char* name = "alpha";
  if (properties.has("alpha_u") || properties.has("alpha_v")) {
    name = properties.has("alpha_u") ? "alpha_u" : "alpha_v";
    if (!(properties.has("alpha_u") && properties.has("alpha_v"))) {
      properties.fail(name, "alpha_u and alpha_v come together");
    }
    if (properties.has("alpha")) properties.fail("alpha", "give either alpha or alpha_u, alpha_v");
    if (properties.number("alpha_u", 0) != properties.number("alpha_v", 0)) {
      properties.fail(name, "anisotropic roughness is not supported: alpha_u must equal alpha_v");
    }
  }
  const double alpha = properties.number(name, 0.1);
  if (!(alpha >= 0)) properties.fail(name, "the roughness must not be negative");
  if (!(alpha < kMaximumAlpha)) {
    properties.fail(name, fmt::format("the roughness must be less than {:g}", kMaximumAlpha));
  }
  return std::max(alpha, kMinimumAlpha);
}

Distribution read_distribution(Properties& properties) {
  const std::string name = properties.string("distribution", "beckmann");
  if (name == "beckmann") return Distribution::kBeckmann;
  if (name == "ggx") return Distribution::kGgx;
  properties.fail("distribution", unknown_name("distribution", name, {"beckmann", "ggx"}));
}

std::shared_ptr<Bsdf> make_roughconductor(const RoughConductorValues& values) {
  return std::make_shared<RoughConductor>(values);
}

std::shared_ptr<Bsdf> read_roughconductor(Properties& properties) {
  RoughConductorValues values;
  values.distribution = read_distribution(properties);
  values.alpha = read_alpha(properties);
  values.specular_reflectance = read_reflectance(properties, "specular_reflectance", 1);
  const ConductorIndices indices = read_conductor_indices(properties);
  values.eta = indices.eta;
  values.k = indices.k;
  if (!properties.boolean("sample_visible", true)) {
    properties.fail("sample_visible",
                    "only sampling of visible normals is supported (it changes the noise alone)");
  }
  return make_roughconductor(values);
}

}  // namespace limn
