// The thin principled BSDF as Mitsuba has it, alike from both sides: a GGX lobe of a thin
// dielectric and its image behind, a diffuse base with sheen, and diffuse light that passes.
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
using microfacet::Reflection;

// The numbers of the BSDF: constants or textures, and the range of each.
enum Number {
  kRoughness,
  kAnisotropic,
  kSpecTrans,
  kSpecTint,
  kSheen,
  kSheenTint,
  kFlatness,
  kDiffTrans,
  kEta,
  kNumbers
};
struct NumberType {
  const char* name;
  double absent, least, most;
};
constexpr NumberType kTypes[kNumbers] = {
    {"roughness", 0.5, 0, 1}, {"anisotropic", 0, 0, 1}, {"spec_trans", 0, 0, 1},
    {"spec_tint", 0, 0, 1},   {"sheen", 0, 0, 1},       {"sheen_tint", 0, 0, 1},
    {"flatness", 0, 0, 1},    {"diff_trans", 0, 0, 2},  {"eta", 1.5, kLeastIor, kMostIor}};

class PrincipledThin final : public BothScalars<PrincipledThin> {
 public:
  explicit PrincipledThin(Properties& properties);

  bool is_constant() const override {
    bool constant = limn::is_constant(base_color_.constant);
    for (const BsdfNumber& number : numbers_) constant &= limn::is_constant(number.constant);
    return constant;
  }
  std::vector<ParameterRef> parameters() override;
  std::string describe() const override;

  template <class S>
  Rgb<S> evaluate(const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo, const Rgb<S>* at) const;

 private:
  double pdf_from(bool, const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                  const Rgb<double>* at) const override;
  std::optional<Vec3d> sample_from(bool, const Vec3d& n, const Vec3d& wi, double u1, double u2,
                                   const Rgb<double>* at) const override;
  LobeSummary lobe_from(bool, const Rgb<double>* at) const override;
  // Straight behind the viewer.
  PassedLobe passed_lobe_from(bool front, const Vec3d& n, const Vec3d& wi,
                              const Rgb<double>* at) const override {
    const std::array<double, 2> a = alphas(true, at);
    PassedLobe passed{reflected(Vec3d(-wi), Vec3d(-n)), lobe_from(front, at)};
    passed.lobe.alpha = std::max(a[0], a[1]);
    passed.lobe.facing = of(kSpecTrans, at);
    return passed;
  }

  template <class S>
  S of(Number which, const Rgb<S>* at) const {
    return numbers_[which].of(at);
  }
  // passed: of the lobe behind, which is rougher or finer by the index (Burley 2015, figure 15).
  template <class S>
  std::array<S, 2> alphas(bool passed, const Rgb<S>* at) const {
    const S roughness = of(kRoughness, at);
    const S scaled = passed ? S((0.65 * of(kEta, at) - 0.35) * roughness) : roughness;
    return principled::alphas(scaled, tangent_ < 0 ? S(0.0) : of(kAnisotropic, at));
  }
  template <class S, class Function>
  std::invoke_result_t<Function, Facets<S>> with_facets(bool passed, const Vec3<S>& n,
                                                        const Rgb<S>* at, const Function& f) const {
    const std::array<S, 2> a = alphas(passed, at);
    if (tangent_ < 0) return f(Facets<S>{Distribution::kGgx, a[0]});
    const Rgb<S> t = at ? at[tangent_] : Rgb<S>{};
    return f(AnisotropicFacets<S>(Distribution::kGgx, a[0], a[1], n, Vec3<S>{t.r, t.g, t.b}));
  }
  // wo in front of the surface, or its mirror image there.
  template <class S>
  static Vec3<S> in_front(const Vec3<S>& n, const Vec3<S>& wo) {
    const S cos_o = dot(n, wo);
    return value(cos_o) < 0 ? wo - n * (2.0 * cos_o) : wo;
  }
  // Probabilities of drawing from the parts.
  struct Shares {
    double diffuse, diffuse_passed, glossy, glossy_passed;
  };
  Shares shares(const Rgb<double>* at) const;

  BsdfColour base_color_;
  std::array<BsdfNumber, kNumbers> numbers_;
  int tangent_ = -1;  // where it stands in `at`; -1 if isotropic
  double rates_[4];   // of diffuse light and the main lobe in front, of those behind
};

PrincipledThin::PrincipledThin(Properties& properties) {
  const ConstantOrTexture color = read_reflectance(properties, "base_color", 0.5);
  if (color.texture) color.texture->set_mixes_channels();
  base_color_ = colour("base_color", color);
  for (int k = 0; k < kNumbers; ++k) {
    const NumberType& type = kTypes[k];
    const ConstantOrTexture source =
        principled::read_number(properties, type.name, type.absent, type.most);
    if (!source.texture && source.constant.r < type.least) {
      properties.fail(type.name, fmt::format("must lie in [{:g}, {:g}]", type.least, type.most));
    }
    numbers_[k] = number(type.name, source);
    if (k == kAnisotropic && (source.texture || source.constant.r != 0)) {
      tangent_ = add_tangent(type.name);
    }
  }
  int k = 0;
  for (const char* name :
       {"diffuse_reflectance_sampling_rate", "specular_reflectance_sampling_rate",
        "diffuse_transmittance_sampling_rate", "specular_transmittance_sampling_rate"}) {
    rates_[k++] = principled::read_rate(properties, name);
  }
  lobes_ = {.below = true, .through = true};
  set_back(lobes_);
}

template <class S>
Rgb<S> PrincipledThin::evaluate(const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo,
                                const Rgb<S>* at) const {
  const S cos_i = dot(n, wi);
  if (!(value(cos_i) > 0) || dot(value(n), value(wo)) == 0) return {};
  const bool passed = dot(value(n), value(wo)) < 0;
  const Vec3<S> front = in_front(n, wo);
  const S cos_o = dot(n, front), cos_h = 0.5 * length(wi + front);
  const S glossy = of(kSpecTrans, at), through = 0.5 * of(kDiffTrans, at);
  const S index = of(kEta, at), tinted = of(kSpecTint, at);
  const S dielectric = fresnel_dielectric<S>(cos_h, index).reflected;
  const Rgb<S> color = base_color_.of(at);
  const S lobe = with_facets(passed, n, at, [&](const auto& facets) {
    return Reflection<S, std::decay_t<decltype(facets)>>(facets, n, wi, front).value();
  });
  if (passed) {
    return color *
           (glossy * (1.0 - dielectric) * lobe + (1.0 - glossy) * through * cos_o * (1 / kPi));
  }
  const S weight = principled::schlick_weight(principled::schlick_cosine(cos_h, index));
  const Rgb<S> r0 = principled::tint(color) * principled::facing_reflectance(index);
  const principled::Base<S> base{color, of(kRoughness, at), of(kFlatness, at), of(kSheen, at),
                                 of(kSheenTint, at)};
  const S rest = (1.0 - glossy) * (1.0 - through);
  Rgb<S> f = base.value_over_cos(cos_i, cos_o, cos_h, rest, rest) * cos_o;
  for (int c = 0; c < 3; ++c) {
    const S schlick = r0[c] + (1.0 - r0[c]) * weight;
    f[c] = f[c] + glossy * (dielectric + tinted * (schlick - dielectric)) * lobe;
  }
  return f;
}

// As in Mitsuba, but that every part is drawn with 0.05 at least of what its side needs.
PrincipledThin::Shares PrincipledThin::shares(const Rgb<double>* at) const {
  const double glossy = std::clamp(of(kSpecTrans, at), 0.0, 1.0);
  const double through = std::clamp(0.5 * of(kDiffTrans, at), 0.0, 1.0);
  constexpr double kLeast = 0.05;  // not tuned
  double p[4] = {rates_[0] * (1 - glossy) * (1 - through), 0.5 * rates_[1] * glossy,
                 rates_[2] * (1 - glossy) * through, 0.5 * rates_[3] * glossy};
  double sum = 0;
  for (double& share : p) sum += share = std::max(share, kLeast);
  return {p[0] / sum, p[2] / sum, p[1] / sum, p[3] / sum};
}

double PrincipledThin::pdf_from(bool, const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                                const Rgb<double>* at) const {
  if (!(dot(n, wi) > 0) || dot(n, wo) == 0) return 0;
  const bool passed = dot(n, wo) < 0;
  const Vec3d front = in_front(n, wo);
  const Shares share = shares(at);
  const double glossy = with_facets(passed, n, at, [&](const auto& facets) {
    return Reflection<double, std::decay_t<decltype(facets)>>(facets, n, wi, front).pdf();
  });
  return (passed ? share.diffuse_passed : share.diffuse) * dot(n, front) / kPi +
         (passed ? share.glossy_passed : share.glossy) * glossy;
}

std::optional<Vec3d> PrincipledThin::sample_from(bool, const Vec3d& n, const Vec3d& wi, double u1,
                                                 double u2, const Rgb<double>* at) const {
  if (!(dot(n, wi) > 0)) return std::nullopt;
  const Shares share = shares(at);
  const auto takes = [&u1](double probability) {
    if (u1 < probability) {
      u1 /= probability;
      return true;
    }
    u1 -= probability;
    return false;
  };
  const auto behind = [&](const Vec3d& w) { return w - n * (2 * dot(n, w)); };
  if (takes(share.diffuse)) return sample_cosine(n, u1, u2);
  if (takes(share.diffuse_passed)) return behind(sample_cosine(n, u1, u2));
  const bool passed = !takes(share.glossy);
  if (passed) u1 = std::min(u1 / share.glossy_passed, 1.0);
  const auto wo = with_facets(passed, n, at, [&](const auto& facets) {
    return microfacet::sample_reflection(facets, n, wi, u1, u2);
  });
  return wo && passed ? behind(*wo) : wo;
}

LobeSummary PrincipledThin::lobe_from(bool, const Rgb<double>* at) const {
  const auto most = [&](Number which) {
    return numbers_[which].texture >= 0 && !at ? kTypes[which].most : of(which, at);
  };
  const std::array<double, 2> a = alphas(false, at);
  const double ratio = std::max(a[0], a[1]) / std::min(a[0], a[1]);
  const double tinted =
      at ? max_channel(principled::tint(base_color_.of(at))) : principled::kMostTint;
  const double r0 = tinted * principled::facing_reflectance(most(kEta));
  const bool flat = most(kFlatness) > 0;
  LobeSummary lobe(principled::lobe_model(flat, false), std::max(a[0], a[1]),
                   ratio * ratio * (most(kSpecTint) > 0 ? std::max(1.0, r0) : 1));
  lobe.diffuse = principled::bound_of_base(base_color_.bound(at), most(kRoughness), most(kSheen),
                                           most(kSheenTint) > 0 ? tinted : 1, flat);
  lobe.albedo += (flat ? 2 : 1) * lobe.diffuse;
  lobe.facing = std::max(1e-3, of(kSpecTrans, at) * principled::facing_reflectance(of(kEta, at)));
  return lobe;
}

std::vector<ParameterRef> PrincipledThin::parameters() {
  std::vector<ParameterRef> list;
  add_parameter("base_color", base_color_, 0, 1, list);
  for (ParameterRef& p : list) p.mixes_channels = true;
  for (int k = 0; k < kNumbers; ++k) {
    if (k == kAnisotropic && tangent_ < 0) continue;
    add_parameter(kTypes[k].name, numbers_[k], kTypes[k].least, kTypes[k].most, list);
  }
  return list;
}

std::string PrincipledThin::describe() const {
  std::string text = "principledthin, base_color " + text_of(base_color_);
  for (int k = 0; k < kNumbers; ++k) {
    if (numbers_[k].texture >= 0 || numbers_[k].constant.v != 0) {
      text += fmt::format(", {} {}", kTypes[k].name, text_of(numbers_[k]));
    }
  }
  return text;
}

}  // namespace

std::shared_ptr<Bsdf> read_principledthin(Properties& properties) {
  return std::make_shared<PrincipledThin>(properties);
}

}  // namespace limn
