// The principled BSDF as Mitsuba has it: a GGX lobe between dielectric and metal, which may pass
// light, a diffuse base, sheen and a clearcoat. Behind the surface only the main lobe is left.
#include <fmt/format.h>

#include <algorithm>

#include "src/bsdf/both_scalars.h"
#include "src/bsdf/cosine.h"
#include "src/bsdf/fresnel.h"
#include "src/bsdf/indices.h"
#include "src/bsdf/microfacet_reflection.h"
#include "src/bsdf/principled_parts.h"
#include "src/bsdf/types.h"

namespace limn {
namespace {

using microfacet::AnisotropicFacets, microfacet::Distribution, microfacet::Facets;
using microfacet::Reflection, principled::schlick_cosine, principled::schlick_weight;

// The numbers of the BSDF beside the index of refraction: constants or textures.
enum Number {
  kRoughness,
  kAnisotropic,
  kMetallic,
  kSpecTrans,
  kSpecTint,
  kSheen,
  kSheenTint,
  kFlatness,
  kClearcoat,
  kClearcoatGloss,
  kNumbers
};
constexpr const char* kNames[kNumbers] = {"roughness", "anisotropic",    "metallic",   "spec_trans",
                                          "spec_tint", "sheen",          "sheen_tint", "flatness",
                                          "clearcoat", "clearcoat_gloss"};

inline double log_of(double a) { return std::log(a); }
inline Dual log_of(const Dual& a) { return {std::log(a.v), a.d / a.v}; }

// The clearcoat's distribution of normals, GTR1, per solid angle; both squares f times as large
// give D / f.
template <class S>
S gtr1(const S& cos2, const S& sin2, const S& alpha) {
  const S a2 = alpha * alpha;
  return (a2 - 1.0) / (kPi * log_of(a2) * (a2 * cos2 + sin2));
}

class Principled final : public BothScalars<Principled> {
 public:
  explicit Principled(Properties& properties);

  bool is_constant() const override {
    bool constant = limn::is_constant(base_color_.constant) && limn::is_constant(eta_);
    for (const BsdfNumber& number : numbers_) constant &= limn::is_constant(number.constant);
    return constant;
  }
  std::vector<ParameterRef> parameters() override;
  std::string describe() const override;

  template <class S>
  Rgb<S> evaluate(bool front, const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo,
                  const Rgb<S>* at) const;

 private:
  double pdf_from(bool front, const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                  const Rgb<double>* at) const override;
  std::optional<Vec3d> sample_from(bool front, const Vec3d& n, const Vec3d& wi, double u1,
                                   double u2, const Rgb<double>* at) const override;
  double eta_from(bool front, const Rgb<double>*) const override { return eta<double>(front); }
  LobeSummary lobe_from(bool front, const Rgb<double>* at) const override;
  PassedLobe passed_lobe_from(bool front, const Vec3d& n, const Vec3d& wi,
                              const Rgb<double>* at) const override;

  template <class S>
  S of(Number which, const Rgb<S>* at) const {
    return numbers_[which].of(at);
  }
  bool passes() const { return lobes_.through; }
  // The index of refraction behind the surface over that in front, seen from a side.
  template <class S>
  S eta(bool front) const;
  template <class S>
  std::array<S, 2> alphas(const Rgb<S>* at) const {
    return principled::alphas(of(kRoughness, at), tangent_ < 0 ? S(0.0) : of(kAnisotropic, at));
  }
  template <class S, class Function>
  std::invoke_result_t<Function, Facets<S>> with_facets(const Vec3<S>& n, const Rgb<S>* at,
                                                        const Function& f) const {
    const std::array<S, 2> a = alphas(at);
    if (tangent_ < 0) return f(Facets<S>{Distribution::kGgx, a[0]});
    const Rgb<S> t = at ? at[tangent_] : Rgb<S>{};
    return f(AnisotropicFacets<S>(Distribution::kGgx, a[0], a[1], n, Vec3<S>{t.r, t.g, t.b}));
  }
  template <class S>
  S clearcoat_alpha(const Rgb<S>* at) const {
    return 0.1 - 0.099 * of(kClearcoatGloss, at);
  }
  template <class S>
  Rgb<S> passed(bool front, const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo,
                const Rgb<S>* at) const;
  template <class S>
  Rgb<S> fresnel(bool front, const S& cos_h, const Rgb<S>* at) const;
  template <class S>
  S clearcoat(const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo, const Rgb<S>* at) const;

  // Probabilities of drawing from the parts.
  struct Shares {
    double diffuse, clearcoat, main;
  };
  Shares shares(bool front, const Rgb<double>* at) const;
  // How the main lobe's is divided between its two sides.
  FacetSide facet_side(bool front, double cos_h, const Rgb<double>* at) const;

  BsdfColour base_color_;
  std::array<BsdfNumber, kNumbers> numbers_;
  Dual eta_;          // or specular
  bool by_specular_;  // eta_ is the parameter `specular`
  int tangent_ = -1;  // where it stands in `at`; -1 if isotropic
  double diffuse_rate_, specular_rate_, clearcoat_rate_;
};

// Where light passes, an index of 1 is none: Mitsuba takes the next best.
double read_eta(Properties& properties, bool by_specular, bool passes) {
  if (!by_specular) {
    const double eta = properties.number("eta", 1);
    if (!(eta >= kLeastIor && eta <= kMostIor)) {
      properties.fail("eta", fmt::format("must lie in [{:g}, {:g}]", kLeastIor, kMostIor));
    }
    return passes && eta == 1 ? 1.001 : eta;
  }
  const double specular = properties.number("specular", 0.5);
  if (!(specular >= 0 && specular <= 1)) properties.fail("specular", "must lie in [0, 1]");
  return passes && specular == 0 ? 1e-3 : specular;
}

// A luminance takes part where there is a tint, so base_color mixes channels.
Principled::Principled(Properties& properties) : by_specular_(!properties.has("eta")) {
  if (!by_specular_ && properties.has("specular")) {
    properties.fail("eta", "give either eta or specular");
  }
  const ConstantOrTexture color = read_reflectance(properties, "base_color", 0.5);
  if (color.texture) color.texture->set_mixes_channels();
  base_color_ = colour("base_color", color);
  bool passes = false;
  for (int k = 0; k < kNumbers; ++k) {
    const ConstantOrTexture source =
        principled::read_number(properties, kNames[k], k == kRoughness ? 0.5 : 0.0);
    numbers_[k] = number(kNames[k], source);
    const bool present = source.texture || source.constant.r != 0;
    if (k == kAnisotropic && present) tangent_ = add_tangent(kNames[k]);
    if (k == kSpecTrans) passes = present;
  }
  eta_ = read_eta(properties, by_specular_, passes);
  diffuse_rate_ = principled::read_rate(properties, "diffuse_reflectance_sampling_rate");
  specular_rate_ = principled::read_rate(properties, "main_specular_sampling_rate");
  clearcoat_rate_ = principled::read_rate(properties, "clearcoat_sampling_rate");
  if (!passes) return;
  lobes_ = {.below = true, .through = true};
  set_back(lobes_);
}

template <class S>
S Principled::eta(bool front) const {
  using std::sqrt;
  const S eta = by_specular_ ? 2.0 / (1.0 - sqrt(0.08 * as<S>(eta_))) - 1.0 : as<S>(eta_);
  return front ? eta : S(1.0 / eta);
}

// Of the main lobe: a dielectric, Schlick's metal and a tinted dielectric. Mitsuba has no such lobe
// at all where the dielectric reflects nothing (eta = 1).
template <class S>
Rgb<S> Principled::fresnel(bool front, const S& cos_h, const Rgb<S>* at) const {
  const S index = eta<S>(front), dielectric = fresnel_dielectric<S>(cos_h, index).reflected;
  const S metallic = of(kMetallic, at), tinted = of(kSpecTint, at);
  if (!front) return grey(S((1.0 - metallic) * of(kSpecTrans, at) * dielectric));
  if (!(value(dielectric) > 0)) return {};
  const S weight = schlick_weight(schlick_cosine(cos_h, index));
  const Rgb<S> color = base_color_.of(at);
  const Rgb<S> r0 = principled::tint(color) * principled::facing_reflectance(index);
  Rgb<S> f;
  for (int c = 0; c < 3; ++c) {
    const S metal = color[c] + (1.0 - color[c]) * weight;
    const S other = (1.0 - tinted) * dielectric + tinted * (r0[c] + (1.0 - r0[c]) * weight);
    f[c] = metallic * metal + (1.0 - metallic) * other;
  }
  return f;
}

template <class S>
S Principled::clearcoat(const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo,
                        const Rgb<S>* at) const {
  using std::sqrt;
  const Vec3<S> m = wi + wo;
  const S cos_i = dot(n, wi), cos_o = dot(n, wo), m2 = dot(m, m), cos_m = cos_i + cos_o;
  const S d = gtr1<S>(cos_m * cos_m, length_squared(cross(n, m)), clearcoat_alpha(at)) * m2;
  const S masking = microfacet::ggx_g1_over_cos(cos_i, S(0.25)) * cos_i *
                    microfacet::ggx_g1_over_cos(cos_o, S(0.25)) * cos_o;
  const S schlick = 0.04 + 0.96 * schlick_weight(schlick_cosine(S(0.5 * sqrt(m2)), eta<S>(true)));
  return 0.25 * of(kClearcoat, at) * schlick * d * masking * cos_o;
}

template <class S>
Rgb<S> Principled::evaluate(bool front, const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo,
                            const Rgb<S>* at) const {
  if (!(dot(value(n), value(wi)) > 0)) return {};
  if (!(dot(value(n), value(wo)) > 0)) {
    return passes() && dot(value(n), value(wo)) < 0 ? passed(front, n, wi, wo, at) : Rgb<S>{};
  }
  const S cos_h = 0.5 * length(wi + wo);
  const Rgb<S> main = with_facets(n, at, [&](const auto& facets) {
    return fresnel(front, cos_h, at) *
           Reflection<S, std::decay_t<decltype(facets)>>(facets, n, wi, wo).value();
  });
  if (!front) return main;
  const S cos_i = dot(n, wi), cos_o = dot(n, wo), nonmetal = 1.0 - of(kMetallic, at);
  const principled::Base<S> base{base_color_.of(at), of(kRoughness, at), of(kFlatness, at),
                                 of(kSheen, at), of(kSheenTint, at)};
  const S diffuse = passes() ? S(nonmetal * (1.0 - of(kSpecTrans, at))) : nonmetal;
  return main + base.value_over_cos(cos_i, cos_o, cos_h, diffuse, nonmetal) * cos_o +
         grey(clearcoat(n, wi, wo, at));
}

// Walter et al. 2007, (21), times the cosine of wo and (eta_i / eta_t)^2: with h along
// m = wi + eta wo,  (1 - F) D G1(wi) G1(wo) (wi.h) |wo.h| / (cos_i (wi.h + eta wo.h)^2).
template <class S>
Rgb<S> Principled::passed(bool front, const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo,
                          const Rgb<S>* at) const {
  using std::sqrt;
  const S index = eta<S>(front);
  Vec3<S> m = wi + wo * index;
  if (dot(value(n), value(m)) < 0) m = -m;
  const S m2 = dot(m, m), i_m = dot(wi, m), o_m = dot(wo, m);
  if (!(value(i_m) > 0 && value(o_m) < 0)) return {};
  const Fresnel<S> f = fresnel_dielectric<S>(i_m / sqrt(m2), index);
  const S cos_i = dot(n, wi), cos_o = -dot(n, wo);
  const S facet = with_facets(n, at, [&](const auto& facets) {
    // D is even and G1 depends on the angle from the normal alone.
    return S(facets.density(n, m, dot(n, m)) * (m2 * m2) * facets.masking_over_cos(wi, cos_i) *
             facets.masking_over_cos(wo, cos_o) * cos_o);
  });
  const S sum = i_m + index * o_m;
  const S weight = (1.0 - f.reflected) * facet * -(i_m * o_m) / (sum * sum) *
                   (1.0 - of(kMetallic, at)) * of(kSpecTrans, at);
  const Rgb<S> color = base_color_.of(at);
  return {sqrt(color.r) * weight, sqrt(color.g) * weight, sqrt(color.b) * weight};
}

// As in Mitsuba, but that the main lobe, which reaches all directions, is never left out.
Principled::Shares Principled::shares(bool front, const Rgb<double>* at) const {
  if (!front) return {0, 0, 1};
  const double nonmetal = std::max(0.0, 1 - of(kMetallic, at));
  const double through = passes() ? nonmetal * of(kSpecTrans, at) : 0;
  const double diffuse = diffuse_rate_ * (nonmetal - through);
  const double clearcoat = clearcoat_rate_ * 0.25 * std::max(0.0, of(kClearcoat, at));
  const double specular = std::max(specular_rate_, 0.1 * (diffuse + clearcoat));
  const double sum = diffuse + clearcoat + specular;
  if (!(sum > 0)) return {0, 0, 1};
  return {diffuse / sum, clearcoat / sum, specular / sum};
}

FacetSide Principled::facet_side(bool front, double cos_h, const Rgb<double>* at) const {
  if (!passes()) return {1, 0};
  const double passed = 1 - fresnel_dielectric<double>(cos_h, eta<double>(front)).reflected;
  const double through = std::max(0.0, 1 - of(kMetallic, at)) * of(kSpecTrans, at);
  const double share = (front ? std::max(through, 1e-300) : 1) * passed;
  return {1 - share, share};
}

double Principled::pdf_from(bool front, const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                            const Rgb<double>* at) const {
  const double cos_i = dot(n, wi), cos_o = dot(n, wo);
  if (!(cos_i > 0) || cos_o == 0) return 0;
  const Shares share = shares(front, at);
  if (cos_o < 0) {
    if (!passes()) return 0;
    const double index = eta<double>(front);
    Vec3d m = wi + wo * index;
    if (dot(n, m) < 0) m = -m;
    const double m2 = dot(m, m), i_m = dot(wi, m), o_m = dot(wo, m), sum = i_m + index * o_m;
    if (!(i_m > 0 && o_m < 0)) return 0;
    // Of visible normals D G1(wi) (wi.h) / cos_i, times dh / dwo = eta^2 |wo.h| / sum^2.
    const double visible = with_facets(n, at, [&](const auto& facets) {
      return facets.density(n, m, dot(n, m)) * (m2 * m2) * facets.exact_masking_over_cos(wi, cos_i);
    });
    const FacetSide side = facet_side(front, i_m / std::sqrt(m2), at);
    return share.main * side.passing() * visible * index * index * -(i_m * o_m) / (sum * sum);
  }
  const double glossy = with_facets(n, at, [&](const auto& facets) {
    return Reflection<double, std::decay_t<decltype(facets)>>(facets, n, wi, wo).pdf();
  });
  const double reflected = share.main * facet_side(front, 0.5 * length(wi + wo), at).reflecting();
  double pdf = share.diffuse * cos_o / kPi + reflected * glossy;
  if (share.clearcoat > 0) {
    // D (n.h) per solid angle of h, which reflection divides by 4 (wi.h).
    const Vec3d m = wi + wo;
    const double m2 = dot(m, m), cos_m = dot(n, m);
    const double d = gtr1(cos_m * cos_m, length_squared(cross(n, m)), clearcoat_alpha(at)) * m2;
    pdf += share.clearcoat * d * cos_m / (2 * m2);
  }
  return pdf;
}

std::optional<Vec3d> Principled::sample_from(bool front, const Vec3d& n, const Vec3d& wi, double u1,
                                             double u2, const Rgb<double>* at) const {
  if (!(dot(n, wi) > 0)) return std::nullopt;
  const Shares share = shares(front, at);
  if (u1 < share.diffuse) return sample_cosine(n, u1 / share.diffuse, u2);
  u1 -= share.diffuse;
  if (u1 < share.clearcoat) {
    const double a2 = std::pow(clearcoat_alpha(at), 2);
    const double cos2 = (1 - std::pow(a2, u1 / share.clearcoat)) / (1 - a2);
    const SinCos phi = sin_cos_of_turns(u2);
    const double sine = std::sqrt(std::max(0.0, 1 - cos2));
    const Frame frame(n);
    const Vec3d wo = microfacet::mirrored(frame, frame.to_local(wi),
                                          {sine * phi.cos, sine * phi.sin, std::sqrt(cos2)});
    return dot(n, wo) > 0 ? std::optional(wo) : std::nullopt;
  }
  u1 -= share.clearcoat;
  return with_facets(n, at, [&](const auto& facets) -> std::optional<Vec3d> {
    const double main = std::min(u1 / share.main, 1.0);
    if (!passes()) return microfacet::sample_reflection(facets, n, wi, main, u2);
    const FacetDigit u(main);
    const Frame frame = facets.frame(n);
    const Vec3d h = normalize(frame.to_world(facets.visible(frame.to_local(wi), u.rest, u2)));
    const double cos_h = dot(wi, h), index = eta<double>(front);
    if (facet_side(front, cos_h, at).reflects(u.digit)) {
      const Vec3d wo = reflected(wi, h);
      return dot(n, wo) > 0 ? std::optional(wo) : std::nullopt;
    }
    const Vec3d wo = refracted(wi, h, index, fresnel_dielectric<double>(cos_h, index).cos_t);
    return dot(n, wo) < 0 ? std::optional(wo) : std::nullopt;
  });
}

LobeSummary Principled::lobe_from(bool front, const Rgb<double>* at) const {
  const auto most = [&](Number which) {
    return numbers_[which].texture >= 0 && !at ? 1 : of(which, at);
  };
  const std::array<double, 2> a = alphas(at);
  const double ratio = std::max(a[0], a[1]) / std::min(a[0], a[1]), roughest = std::max(a[0], a[1]);
  if (!front) return {ggx_lobe(), roughest, ratio * ratio};
  const double tinted =
      at ? max_channel(principled::tint(base_color_.of(at))) : principled::kMostTint;
  const double r0 = tinted * principled::facing_reflectance(eta<double>(true));
  const bool flat = most(kFlatness) > 0, coat = most(kClearcoat) > 0;
  LobeSummary lobe(principled::lobe_model(flat, coat), roughest,
                   ratio * ratio * (most(kSpecTint) > 0 ? std::max(1.0, r0) : 1));
  lobe.diffuse = principled::bound_of_base(base_color_.bound(at), most(kRoughness), most(kSheen),
                                           most(kSheenTint) > 0 ? tinted : 1, flat);
  lobe.albedo += (flat ? 2 : 1) * lobe.diffuse + 2 * most(kClearcoat);
  lobe.facing = std::max(1e-3, max_channel(fresnel(true, 1.0, at)));
  return lobe;
}

// About the direction in which a smooth surface would pass the light; half vectors turn it
// |1 - cos_i / (eta cos_t)| times as far as they turn, in place of twice (roughdielectric.cpp).
Bsdf::PassedLobe Principled::passed_lobe_from(bool front, const Vec3d& n, const Vec3d& wi,
                                              const Rgb<double>* at) const {
  constexpr double kGrazing = 0.05, kNarrowest = 1e-3;  // not tuned
  const double cos_i = dot(n, wi), index = eta<double>(front);
  const double cos_t = std::max(kGrazing, fresnel_dielectric<double>(cos_i, index).cos_t);
  const Vec3d along = n * cos_i - wi;
  const double size = length(along);
  const Vec3d axis =
      size > 0 ? along * (std::sqrt(1 - cos_t * cos_t) / size) - n * cos_t : Vec3d(-n);
  const std::array<double, 2> a = alphas(at);
  const double turn = 0.5 * std::fabs(1 - cos_i / (index * cos_t));
  return {reflected(axis, Vec3d(-n)),
          {ggx_lobe(), std::min(1.0, std::max(a[0], a[1]) * turn + kNarrowest), 1}};
}

std::vector<ParameterRef> Principled::parameters() {
  std::vector<ParameterRef> list;
  add_parameter("base_color", base_color_, 0, 1, list);
  for (ParameterRef& p : list) p.mixes_channels = true;
  for (int k = 0; k < kNumbers; ++k) {
    if (k == kAnisotropic && tangent_ < 0) continue;
    if (k == kSpecTrans && !passes()) continue;
    add_parameter(kNames[k], numbers_[k], 0, 1, list);
  }
  using Unit = ParameterRef::Unit;
  list.push_back(by_specular_ ? ParameterRef{"specular", {&eta_}, Unit::kValue, 0, 1}
                              : ParameterRef{"eta", {&eta_}, Unit::kValue, kLeastIor, kMostIor});
  return list;
}

std::string Principled::describe() const {
  std::string text = fmt::format("principled, base_color {}, {} {:g}", text_of(base_color_),
                                 by_specular_ ? "specular" : "eta", eta_.v);
  for (int k = 0; k < kNumbers; ++k) {
    if (k == kRoughness || numbers_[k].texture >= 0 || numbers_[k].constant.v != 0) {
      text += fmt::format(", {} {}", kNames[k], text_of(numbers_[k]));
    }
  }
  return text;
}

}  // namespace

std::shared_ptr<Bsdf> read_principled(Properties& properties) {
  return std::make_shared<Principled>(properties);
}

}  // namespace limn
