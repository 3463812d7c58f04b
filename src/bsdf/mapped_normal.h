#pragma once
// What normal maps and bump maps share: a BSDF about another normal.
#include <memory>

#include "src/bsdf/both_scalars.h"
#include "src/bsdf/nested.h"

namespace limn {

// How the normal of a map is used.
struct MappedNormalOptions {
  bool flips = true;    // Mitsuba's shading: where it turns from the viewer, by half a turn about n
  bool shadows = true;  // Mitsuba's shading; any other has them always
};
MappedNormalOptions read_mapped_normal_options(Properties& properties);

// The nested BSDF about the normal n_b of a map. Where n_b turns from the viewer, n_b.wi < e, it is
// bent as interpolated normals are (shading.h). What lies on different sides of the two normals is
// zero; towards the horizon of the surface's normal n the factor
//     2 / (1 + sqrt(1 + a tan^2(n, wo))),   a = min(1, tan^2(n, n_b) / 8)
// makes the value vanish (Estevez et al. 2019, "A microfacet-based shadowing function to solve the
// bump terminator problem"; Mitsuba has it, too). So the value is continuous wherever the map is.
// Map: derives from this and has normal(n, at), n_b from n and the values of its own textures.
template <class Map>
class MappedNormal : public BothScalars<Map, NestingBsdf> {
 public:
  template <class S>
  Rgb<S> evaluate(bool front, const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo,
                  const Rgb<S>* at) const {
    if (!is_seen(front, value(n), value(wi), value(wo))) return {};
    const Vec3<S> n_b = bent(n, wi, at);
    if (!is_on_one_side(value(n), value(n_b), value(wo))) return {};
    return this->side_of(0, front)->eval(n_b, wi, wo, this->at_of(0, front, at)) *
           shadow(n, n_b, wo);
  }
  // Rays that leave on different sides of n and n_b have the weight zero.
  template <class S>
  int rays(bool front, const Vec3<S>& n, const Vec3<S>& wi, SmoothRays<S>& rays,
           const Rgb<S>* at) const {
    const Vec3<S> n_b = bent(n, wi, at);
    const int count =
        this->side_of(0, front)->smooth_rays(n_b, wi, rays, this->at_of(0, front, at));
    for (int k = 0; k < count; ++k) {
      SmoothRay<S>& ray = rays[k];
      const bool seen = is_on_one_side(value(n), value(n_b), value(ray.wo));
      ray.weight = seen ? ray.weight * shadow(n, n_b, ray.wo) : Rgb<S>{};
    }
    return count;
  }
  bool maps_normals() final { return true; }
  void set_mitsuba_shading(bool mitsuba) final {
    mitsuba_ = mitsuba;
    Bsdf::set_mitsuba_shading(mitsuba);
  }

 protected:
  MappedNormal(std::shared_ptr<Bsdf> nested, const MappedNormalOptions& options)
      : BothScalars<Map, NestingBsdf>(std::vector<std::shared_ptr<Bsdf>>{std::move(nested)}),
        options_(options) {}
  // -1 where the surface is seen from the back, else 1. outward: the value of make_outward().
  template <class S>
  static double side_seen(const Vec3<S>& n, const Vec3<S>& outward) {
    return dot(value(n), value(outward)) < 0 ? -1 : 1;
  }
  // -1 where the map's slopes count the other way: from the back, where the map bends the normal
  // first and the BSDF inside turns it. Inside twosided, the surface is turned first (Mitsuba).
  double turned(double side) const { return this->side(false) ? side : 1; }
  // What the map does that is no default, and the BSDF inside.
  std::string text_of_inside() const {
    return std::string(options_.flips ? "" : ", not flipped") +
           (options_.shadows ? "" : ", without shadows") + " (" +
           const_cast<MappedNormal*>(this)->nested()[0]->describe() + ")";  // NOLINT
  }

 private:
  bool is_seen(bool front, const Vec3d& n, const Vec3d& wi, const Vec3d& wo) const {
    return dot(n, wi) > 0 && (dot(n, wo) > 0 || this->side_of(0, front)->lobes().below);
  }
  static bool is_on_one_side(const Vec3d& n, const Vec3d& n_b, const Vec3d& wo) {
    return dot(n, wo) * dot(n_b, wo) > 0;
  }

  double pdf_from(bool front, const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                  const Rgb<double>* at) const final {
    if (!is_seen(front, n, wi, wo)) return 0;
    const Vec3d n_b = bent(n, wi, at);
    if (!is_on_one_side(n, n_b, wo)) return 0;
    return this->side_of(0, front)->pdf_solid_angle(n_b, wi, wo, this->at_of(0, front, at));
  }
  BsdfValue eval_with_pdf_from(bool front, const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                               const Rgb<double>* at) const final {
    if (!is_seen(front, n, wi, wo)) return {};
    const Vec3d n_b = bent(n, wi, at);
    if (!is_on_one_side(n, n_b, wo)) return {};
    BsdfValue f = this->side_of(0, front)->eval_with_pdf(n_b, wi, wo, this->at_of(0, front, at));
    f.value = f.value * shadow(n, n_b, wo);
    return f;
  }
  std::optional<Vec3d> sample_from(bool front, const Vec3d& n, const Vec3d& wi, double u1,
                                   double u2, const Rgb<double>* at) const final {
    if (!(dot(n, wi) > 0)) return std::nullopt;
    const Vec3d n_b = bent(n, wi, at);
    const auto wo = this->side_of(0, front)->sample(n_b, wi, u1, u2, this->at_of(0, front, at));
    return wo && is_on_one_side(n, n_b, *wo) ? wo : std::nullopt;
  }
  double eta_from(bool front, const Rgb<double>* at) const final {
    return this->side_of(0, front)->eta(this->at_of(0, front, at));
  }
  LobeSummary lobe_from(bool front, const Rgb<double>* at) const final {
    return this->side_of(0, front)->lobe(this->at_of(0, front, at));
  }
  Bsdf::PassedLobe passed_lobe_from(bool front, const Vec3d& n, const Vec3d& wi,
                                    const Rgb<double>* at) const final {
    return this->side_of(0, front)->passed_lobe(bent(n, wi, at), wi, this->at_of(0, front, at));
  }
  Vec3d scattering_normal_from(bool front, const Vec3d& n, const Vec3d& wi,
                               const Rgb<double>* at) const final {
    return this->side_of(0, front)->scattering_normal(bent(n, wi, at), wi,
                                                      this->at_of(0, front, at));
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
    const S cos_d = dot(n, n_b), cos = dot(n, wo);
    const S cos_o = value(cos) < 0 ? S(-cos) : cos;
    const S d2 = cos_d * cos_d, o2 = cos_o * cos_o;
    // a tan^2(n, wo) = a (1 - o2) / o2, written as a fraction that stays finite.
    const S a = 9.0 * value(d2) < 1 ? S(1.0) : (1.0 - d2) / (8.0 * d2);
    return 2.0 * cos_o / (cos_o + sqrt(o2 + a * (1.0 - o2)));
  }

  MappedNormalOptions options_;
  bool mitsuba_ = false;
};

}  // namespace limn
