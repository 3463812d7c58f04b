#pragma once
// Reflection at microfacets, D G1(wi) G1(wo) / (4 cos_i) with the cosine of wo included and without
// Fresnel's factor: values, densities and directions, over double or Dual (isotropic GGX also over
// wide::Doubles).
#include <optional>
#include <type_traits>

#include "limn/core/bsdf.h"
#include "limn/core/make_bsdf.h"
#include "limn/core/properties.h"
#include "src/bsdf/microfacet.h"
#include "src/bsdf/tangent_frame.h"

namespace limn::microfacet {

using Distribution = RoughConductorValues::Distribution;

inline constexpr double kMinimumAlpha = 1e-4;  // as in Mitsuba
inline constexpr double kMaximumAlpha = 1e6;

inline bool is_seen(const Vec3d& n, const Vec3d& wi, const Vec3d& wo) {
  return dot(n, wi) > 0 && dot(n, wo) > 0;
}

inline double sine_of(double cosine) { return std::sqrt(std::max(0.0, 1 - cosine * cosine)); }

// Facets that are alike in all directions along the surface.
template <class S>
struct Facets {
  Distribution distribution;  // GGX for wide::Doubles
  S alpha;

  bool is_ggx() const { return distribution == Distribution::kGgx; }
  // D(h) for h along m, over |m|^4. cos_m: n.m. The sine is that of a cross product: 1 - cos^2
  // would cancel at small roughness.
  S density(const Vec3<S>& n, const Vec3<S>& m, const S& cos_m) const {
    const S cos2 = cos_m * cos_m, sin2 = length_squared(cross(n, m));
    if constexpr (std::is_same_v<S, wide::Doubles>) {
      return ggx_d<S>(cos2, sin2, alpha);
    } else {
      return is_ggx() ? ggx_d(cos2, sin2, alpha) : beckmann_d(cos2, sin2, alpha);
    }
  }
  // G1(v) / cos_v.
  S masking_over_cos(const Vec3<S>& /*v*/, const S& cos_v) const {
    if constexpr (std::is_same_v<S, wide::Doubles>) {
      return ggx_g1_over_cos<S>(cos_v, alpha);
    } else {
      return is_ggx() ? ggx_g1_over_cos(cos_v, alpha) : beckmann_g1_over_cos(cos_v, alpha);
    }
  }
  // The same, exactly: the normalisation of the density of visible normals. Beckmann's rational fit
  // does not integrate to 1.
  S exact_masking_over_cos(const Vec3<S>& v, const S& cos_v) const {
    if constexpr (std::is_same_v<S, double>) {
      if (!is_ggx()) return beckmann_exact_g1_over_cos(cos_v, alpha * sine_of(cos_v));
    }
    return masking_over_cos(v, cos_v);
  }
  Frame frame(const Vec3d& n) const { return Frame(n); }
  Vec3d visible(const Vec3d& v, double u1, double u2) const {
    return is_ggx() ? ggx_visible(v, alpha, alpha, u1, u2)
                    : beckmann_visible(v, alpha, alpha, u1, u2);
  }
};

// Facets whose roughness is u along a tangent and v across it.
template <class S>
struct AnisotropicFacets {
  Distribution distribution;
  S u, v;
  Vec3<S> s, t;  // along and across, unit, orthogonal to the normal

  AnisotropicFacets(Distribution d, const S& alpha_u, const S& alpha_v, const Vec3<S>& n,
                    const Vec3<S>& tangent)
      : distribution(d), u(alpha_u), v(alpha_v), s(along_surface(n, tangent)), t(cross(n, s)) {}
  bool is_ggx() const { return distribution == Distribution::kGgx; }
  S density(const Vec3<S>& /*n*/, const Vec3<S>& m, const S& cos_m) const {
    const S x = dot(m, s) / u, y = dot(m, t) / v;
    const S sin2 = x * x + y * y, cos2 = cos_m * cos_m;
    return (is_ggx() ? ggx_d(cos2, sin2, S(1.0)) : beckmann_d(cos2, sin2, S(1.0))) / (u * v);
  }
  S masking_over_cos(const Vec3<S>& w, const S& cos_w) const {
    return is_ggx() ? ggx_g1_over_cos_scaled(cos_w, scaled_sin2(w))
                    : beckmann_g1_over_cos_scaled(cos_w, scaled_sin2(w));
  }
  S exact_masking_over_cos(const Vec3<S>& w, const S& cos_w) const {
    return is_ggx() ? masking_over_cos(w, cos_w)
                    : S(beckmann_exact_g1_over_cos(value(cos_w), std::sqrt(value(scaled_sin2(w)))));
  }
  FrameOf<S> frame(const Vec3<S>& n) const {
    FrameOf<S> frame(n);
    frame.s = s;
    frame.t = t;
    return frame;
  }
  Vec3d visible(const Vec3d& w, double u1, double u2) const {
    return is_ggx() ? ggx_visible(w, u, v, u1, u2) : beckmann_visible(w, u, v, u1, u2);
  }

 private:
  // alpha^2 sin^2 for the roughness alpha along the plane of n and w.
  S scaled_sin2(const Vec3<S>& w) const {
    const S x = u * dot(w, s), y = v * dot(w, t);
    return x * x + y * y;
  }
};

// Terms shared by value and density for a pair of directions in front of the surface. With
// m = wi + wo: h = m / |m| and wi.h = |m| / 2. F: Facets<S> or AnisotropicFacets<S>, which outlive
// it, as do wi and wo.
template <class S, class F = Facets<S>>
struct Reflection {
  const F& facets;
  const Vec3<S>&wi, &wo;
  S cos_i, cos_o;
  S cos_h;  // wi.h
  S d;      // D(h)

  Reflection(const F& f, const Vec3<S>& n, const Vec3<S>& i, const Vec3<S>& o)
      : facets(f), wi(i), wo(o), cos_i(dot(n, i)), cos_o(dot(n, o)) {
    using std::sqrt;
    const Vec3<S> m = wi + wo;
    const S m2 = dot(m, m);
    cos_h = 0.5 * sqrt(m2);
    d = facets.density(n, m, cos_i + cos_o) * (m2 * m2);
  }
  S value() const {
    const S masking = facets.masking_over_cos(wi, cos_i) * facets.masking_over_cos(wo, cos_o);
    return d * masking * cos_o * 0.25;
  }
  // The density of visible normals is D G1(wi) (wi.h) / cos_i per solid angle of h; reflection
  // divides it by 4 (wi.h).
  S pdf() const { return 0.25 * d * facets.exact_masking_over_cos(wi, cos_i); }
};

// Reflects v (in the frame) at a facet whose normal h may have any length.
template <class S>
Vec3<S> mirrored(const FrameOf<S>& frame, const Vec3<S>& v, const Vec3<S>& h) {
  return normalize(frame.to_world(h * (2.0 * dot(v, h) / dot(h, h)) - v));
}

// Samples wo by visible normals; nothing if it falls below the surface. Requires n.wi > 0.
template <class F>
std::optional<Vec3d> sample_reflection(const F& facets, const Vec3d& n, const Vec3d& wi, double u1,
                                       double u2) {
  const Frame frame = facets.frame(n);
  const Vec3d v = frame.to_local(wi);
  const Vec3d wo = mirrored(frame, v, facets.visible(v, u1, u2));
  if (!(dot(n, wo) > 0)) return std::nullopt;
  return wo;
}

// Along the tangent and across; no v if both are the same number.
struct Roughness {
  ConstantOrTexture u;
  std::optional<ConstantOrTexture> v;
};
// Reads alpha (0.1), or alpha_u and alpha_v.
Roughness read_roughness(Properties& properties);

}  // namespace limn::microfacet
