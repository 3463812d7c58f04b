#pragma once
// What the principled BSDFs share.
// Burley 2012, "Physically based shading at Disney"; Burley 2015, "Extending the Disney BRDF to a
// BSDF with integrated subsurface scattering". Values are Mitsuba's.
#include <array>
#include <cmath>

#include "limn/core/bsdf.h"
#include "limn/core/properties.h"

namespace limn::principled {

template <class S>
S larger(const S& a, double b) {
  return value(a) > b ? a : S(b);
}

// The roughness of a main lobe along the tangent and across.
template <class S>
std::array<S, 2> alphas(const S& roughness, const S& anisotropic) {
  using std::sqrt;
  constexpr double kLeast = 0.001;
  const S r2 = roughness * roughness, aspect = sqrt(1.0 - 0.9 * anisotropic);
  return {larger(S(r2 / aspect), kLeast), larger(S(r2 * aspect), kLeast)};
}

// Schlick's weight (1 - cos)^5.
template <class S>
S schlick_weight(const S& cosine) {
  const S m = 1.0 - cosine, m2 = m * m;
  return value(m) > 0 ? m2 * m2 * m : S(0.0);
}

// The cosine that Schlick's reflectance takes: from the denser side that of the refracted light.
template <class S>
S schlick_cosine(const S& cos_h, const S& eta) {
  using std::sqrt;
  if (value(eta) > 1) return cos_h;
  const S cos2 = 1.0 - (1.0 - cos_h * cos_h) / (eta * eta);
  return value(cos2) > 0 ? sqrt(cos2) : S(0.0);
}

// A colour over its luminance; white if it is black. Never more than kMostTint.
template <class S>
Rgb<S> tint(const Rgb<S>& color) {
  const S y = luminance(color);
  return value(y) > 0 ? color * (1.0 / y) : grey(S(1.0));
}
inline constexpr double kMostTint = 1 / 0.072169;  // 1 over the least weight of a luminance

// The reflectance of a dielectric of index eta at normal incidence.
template <class S>
S facing_reflectance(const S& eta) {
  const S r = (eta - 1.0) / (eta + 1.0);
  return r * r;
}

// Diffuse light with retro-reflection, or the flat look of light from below the surface, and sheen.
template <class S>
struct Base {
  Rgb<S> color;
  S roughness, flatness, sheen, sheen_tint;

  // Without the cosine of wo. diffuse, sheen_share: what of each is left beside other lobes.
  Rgb<S> value_over_cos(const S& cos_i, const S& cos_o, const S& cos_h, const S& diffuse,
                        const S& sheen_share) const {
    const S f_i = schlick_weight(cos_i), f_o = schlick_weight(cos_o);
    const S retro = 2.0 * roughness * cos_h * cos_h;
    const S rough =
        (1.0 - 0.5 * f_i) * (1.0 - 0.5 * f_o) + retro * (f_o + f_i + f_o * f_i * (retro - 1.0));
    const S flat_retro = 0.5 * retro - 1.0;
    const S both = (1.0 + flat_retro * f_o) * (1.0 + flat_retro * f_i);
    const S flat = 1.25 * (both * (1.0 / (cos_o + cos_i) - 0.5) + 0.5);
    const S of_color = (rough + flatness * (flat - rough)) * (1 / kPi) * diffuse;
    const S of_sheen = sheen * schlick_weight(cos_h) * sheen_share;
    const Rgb<S> tint_of = tint(color);
    Rgb<S> sum;
    for (int c = 0; c < 3; ++c) {
      sum[c] = color[c] * of_color + of_sheen * (1.0 + sheen_tint * (tint_of[c] - 1.0));
    }
    return sum;
  }
};

// The bound of the flat look, over the colour.
inline constexpr double kFlat = 1.875;
// Bounds of value_over_cos times pi, from those of its parts; with a flat look it holds for
// min(1 / cos_o, 1 + 1 / cos_i) times this.
double bound_of_base(double color, double roughness, double sheen, double sheen_tint, bool flat);

// GGX and diffuse light; the flat look and a clearcoat add bounds. They have no importance of their
// own: the share of the cosine covers them.
const LobeModel& lobe_model(bool flat, bool coat);

// Read a number in [0, most], or a texture; a factor of probabilities (1).
ConstantOrTexture read_number(Properties& properties, const char* name, double absent,
                              double most = 1);
double read_rate(Properties& properties, const char* name);

}  // namespace limn::principled
