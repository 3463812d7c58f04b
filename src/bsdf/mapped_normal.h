#pragma once
// What normal maps and bump maps share: a BSDF about another normal.
#include <memory>

#include "src/bsdf/types.h"

namespace limn {

// How the normal of a map is used.
struct MappedNormalOptions {
  bool flips = true;    // Mitsuba's shading: where it turns from the viewer, by half a turn about n
  bool shadows = true;  // Mitsuba's shading; any other has them always
};
MappedNormalOptions read_mapped_normal_options(Properties& properties);
// The BSDF inside, opaque and of the front alone or alike on both sides, beside `own` textures.
std::shared_ptr<Bsdf> read_mapped_bsdf(Properties& properties, int own);

// The nested BSDF about the normal n_b of a map. Where n_b turns from the viewer, n_b.wi < e, it is
// bent as interpolated normals are (shading.h). What lies above one of the two normals only is
// zero; towards the horizon of the surface's normal n the factor
//     2 / (1 + sqrt(1 + a tan^2(n, wo))),   a = min(1, tan^2(n, n_b) / 8)
// makes the value vanish (Estevez et al. 2019, "A microfacet-based shadowing function to solve the
// bump terminator problem"; Mitsuba has it, too). So the value is continuous wherever the map is.
// Map: derives from this and has normal(n, at), n_b from n and the values of its own textures, and
// map_is_constant(), true if its own numbers are as in is_constant.
template <class Map>
class MappedNormal : public Bsdf {
 public:
  Rgb<double> eval(const Vec3<double>& n, const Vec3<double>& wi, const Vec3<double>& wo,
                   const Rgb<double>* at) const final {
    return evaluate(n, wi, wo, at);
  }
  Rgb<Dual> eval(const Vec3<Dual>& n, const Vec3<Dual>& wi, const Vec3<Dual>& wo,
                 const Rgb<Dual>* at) const final {
    return evaluate(n, wi, wo, at);
  }
  double pdf_solid_angle(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                         const Rgb<double>* at) const final {
    if (!is_seen(n, wi, wo)) return 0;
    return nested_->pdf_solid_angle(bent(n, wi, at), wi, wo, inner(at));
  }
  BsdfValue eval_with_pdf(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                          const Rgb<double>* at) const final {
    if (!is_seen(n, wi, wo)) return {};
    const Vec3d n_b = bent(n, wi, at);
    BsdfValue f = nested_->eval_with_pdf(n_b, wi, wo, inner(at));
    f.value = f.value * shadow(n, n_b, wo);
    return f;
  }
  std::optional<Vec3d> sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                              const Rgb<double>* at) const final {
    if (!(dot(n, wi) > 0)) return std::nullopt;
    const auto wo = nested_->sample(bent(n, wi, at), wi, u1, u2, inner(at));
    return wo && dot(n, *wo) > 0 ? wo : std::nullopt;
  }

  int smooth_rays(const Vec3<double>& n, const Vec3<double>& wi, SmoothRays<double>& rays,
                  const Rgb<double>* at) const final {
    return mapped_rays(n, wi, rays, at);
  }
  int smooth_rays(const Vec3<Dual>& n, const Vec3<Dual>& wi, SmoothRays<Dual>& rays,
                  const Rgb<Dual>* at) const final {
    return mapped_rays(n, wi, rays, at);
  }

  bool is_constant() const final {
    return static_cast<const Map&>(*this).map_is_constant() && nested_->is_constant();
  }
  Vec3d scattering_normal(const Vec3d& n, const Vec3d& wi, const Rgb<double>* at) const final {
    return nested_->scattering_normal(bent(n, wi, at), wi, inner(at));
  }
  LobeSummary lobe(const Rgb<double>* at) const final { return nested_->lobe(inner(at)); }
  const Bsdf* side(bool front) const final { return front || two_sided_ ? this : nullptr; }
  // Its own textures, then those of the nested BSDF.
  Texture& texture(int k) const final {
    return k < own_ ? Bsdf::texture(k) : nested_->texture(k - own_);
  }
  std::string texture_name(int k) const final {
    return k < own_ ? Bsdf::texture_name(k) : nested_->texture_name(k - own_);
  }
  std::span<std::shared_ptr<Bsdf>> nested() final { return {&nested_, 1}; }
  void set_mitsuba_shading(bool mitsuba) final {
    mitsuba_ = mitsuba;
    Bsdf::set_mitsuba_shading(mitsuba);
  }

 protected:
  MappedNormal(std::shared_ptr<Bsdf> nested, const MappedNormalOptions& options)
      : nested_(std::move(nested)), options_(options) {
    lobes_ = nested_->lobes();
    two_sided_ = nested_->side(false) != nullptr;
  }
  // For clone(), of a copy.
  void clone_nested() { nested_ = nested_->clone(); }
  // For constructors, after the map's own textures.
  void add_nested_textures() {
    own_ = texture_count_;
    texture_count_ += nested_->texture_count();
  }
  const Bsdf& inside() const { return *nested_; }
  // -1 where the surface is seen from the back, else 1. outward: the value of make_outward().
  template <class S>
  static double side_of(const Vec3<S>& n, const Vec3<S>& outward) {
    return dot(value(n), value(outward)) < 0 ? -1 : 1;
  }
  // -1 where the map's slopes count the other way: from the back, where the map bends the normal
  // first and the BSDF inside turns it. Inside twosided, the surface is turned first (Mitsuba).
  double turned(double side) const { return two_sided_ ? side : 1; }

 private:
  static bool is_seen(const Vec3d& n, const Vec3d& wi, const Vec3d& wo) {
    return dot(n, wi) > 0 && dot(n, wo) > 0;
  }
  template <class S>
  const Rgb<S>* inner(const Rgb<S>* at) const {
    return at ? at + own_ : nullptr;
  }
  template <class S>
  Vec3<S> bent(const Vec3<S>& n, const Vec3<S>& wi, const Rgb<S>* at) const {
    if (!at) return n;
    const Vec3<S> n_b = static_cast<const Map&>(*this).normal(n, at);
    const S c = dot(n_b, wi);
    if (mitsuba_) {
      return options_.flips && !(value(c) > 0) ? n * (2.0 * dot(n, n_b)) - n_b : n_b;
    }
    const double limit = 0.01;  // e above, as in shading.h
    return value(c) < limit ? normalize(n_b + wi * (limit - c)) : n_b;
  }
  template <class S>
  S shadow(const Vec3<S>& n, const Vec3<S>& n_b, const Vec3<S>& wo) const {
    using std::sqrt;
    if (mitsuba_ && !options_.shadows) return 1.0;
    const S cos_d = dot(n, n_b), cos_o = dot(n, wo);
    const S d2 = cos_d * cos_d, o2 = cos_o * cos_o;
    // a tan^2(n, wo) = a (1 - o2) / o2, written as a fraction that stays finite.
    const S a = 9.0 * value(d2) < 1 ? S(1.0) : (1.0 - d2) / (8.0 * d2);
    return 2.0 * cos_o / (cos_o + sqrt(o2 + a * (1.0 - o2)));
  }
  template <class S>
  Rgb<S> evaluate(const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo, const Rgb<S>* at) const {
    if (!is_seen(value(n), value(wi), value(wo))) return {};
    const Vec3<S> n_b = bent(n, wi, at);
    return nested_->eval(n_b, wi, wo, inner(at)) * shadow(n, n_b, wo);
  }

  // What would leave below n is zero.
  template <class S>
  int mapped_rays(const Vec3<S>& n, const Vec3<S>& wi, SmoothRays<S>& rays,
                  const Rgb<S>* at) const {
    const Vec3<S> n_b = bent(n, wi, at);
    const int count = nested_->smooth_rays(n_b, wi, rays, inner(at));
    for (int k = 0; k < count; ++k) {
      SmoothRay<S>& ray = rays[k];
      const bool seen = is_seen(value(n), value(wi), value(ray.wo));
      ray.weight = seen ? ray.weight * shadow(n, n_b, ray.wo) : Rgb<S>{};
    }
    return count;
  }

  std::shared_ptr<Bsdf> nested_;
  MappedNormalOptions options_;
  bool mitsuba_ = false, two_sided_ = false;  // two_sided_: the BSDF inside is
  int own_ = 0;                               // number of its own textures
};

}  // namespace limn
