#pragma once
// Scattering at a surface, seen from the front. BSDFs are functions of world-space
// directions and the shading normal. A tangent enters as a value of `at` (tangent.h), of those that
// ask for one alone.
//
// A BSDF has rough lobes, of which eval, pdf and sample are, smooth (delta) ones, which turn a ray
// into rays, or both. Radiance that passes from an index of refraction eta_t into eta_i, the
// viewer's, is scaled by (eta_i / eta_t)^2.
//
// What varies over the surface comes as an argument `at`: the values of the BSDF's textures at the
// point, texture_count() of them, texture(k) at index k. Constants are no part of it. A null `at`
// lets the textures' means stand for them, where a density is wanted and the point is unknown.
#include <algorithm>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "limn/core/bsdf_value.h"
#include "limn/core/lobe.h"
#include "limn/core/parameter_ref.h"
#include "limn/core/texture.h"

namespace limn {

class Bsdf {
 public:
  virtual ~Bsdf() = default;

  // Which lobes there are, of all points and directions.
  struct Lobes {
    bool above = true;     // rough ones in front, n.wo > 0
    bool below = false;    // rough ones behind
    bool smooth = false;   // smooth ones
    bool through = false;  // any behind
  };
  const Lobes& lobes() const { return lobes_; }
  bool is_rough() const { return lobes_.above || lobes_.below; }

  // Value of the rough lobes times |cos(n, wo)| [1/sr]. n: unit shading normal; wi: unit, towards
  // the viewer, n.wi > 0; wo: unit, towards the light. Zero if n.wo <= 0 unless lobes().below, and
  // continuous there.
  virtual Rgb<double> eval(const Vec3<double>& n, const Vec3<double>& wi, const Vec3<double>& wo,
                           const Rgb<double>* at = nullptr) const = 0;
  virtual Rgb<Dual> eval(const Vec3<Dual>& n, const Vec3<Dual>& wi, const Vec3<Dual>& wo,
                         const Rgb<Dual>* at = nullptr) const = 0;

  // Density of `sample` with respect to solid angle [1/sr]; 0 where eval is.
  virtual double pdf_solid_angle(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                                 const Rgb<double>* at = nullptr) const = 0;
  // Both of the above, at little more than the cost of one.
  virtual BsdfValue eval_with_pdf(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                                  const Rgb<double>* at = nullptr) const = 0;
  // Samples wo from two uniform numbers in [0, 1). Returns nothing if the sample falls where eval
  // is 0; pdf_solid_angle then integrates to less than 1 by that probability.
  virtual std::optional<Vec3d> sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                                      const Rgb<double>* at = nullptr) const = 0;

  // Batched versions for SIMD. An element's result does not depend on the other elements; it may
  // differ from the scalar functions by rounding.
  struct Evaluation {
    const Vec3d *n, *wi, *wo;
    BsdfValue* value;
    const Rgb<double>* at = nullptr;
  };
  virtual void eval_with_pdf_each(std::span<const Evaluation> evaluations) const;
  struct Draw {
    const Vec3d *n, *wi;
    const double* u;  // two numbers in [0, 1)
    Vec3d* wo;        // zero if nothing was sampled
    const Rgb<double>* at = nullptr;
  };
  virtual void sample_each(std::span<const Draw> draws) const;

  // Writes the rays that the smooth lobes see from wi and returns their number, which is the same
  // for all points and directions. Arguments as of eval.
  virtual int smooth_rays(const Vec3<double>& /*n*/, const Vec3<double>& /*wi*/,
                          SmoothRays<double>& /*rays*/, const Rgb<double>* /*at*/ = nullptr) const {
    return 0;
  }
  virtual int smooth_rays(const Vec3<Dual>& /*n*/, const Vec3<Dual>& /*wi*/,
                          SmoothRays<Dual>& /*rays*/, const Rgb<Dual>* /*at*/ = nullptr) const {
    return 0;
  }
  // The index of refraction behind the surface over that in front, for light that the rough lobes
  // pass.
  virtual double eta(const Rgb<double>* /*at*/ = nullptr) const { return 1; }
  // Lambert's law with a constant reflectance, and nothing else.
  virtual bool is_lambertian() const { return false; }

  // The BSDF of the front or the back; null if that side is black. The back is evaluated as a front
  // with reversed normals.
  virtual const Bsdf* side(bool front) const { return front ? this : nullptr; }

  // True if no parameter of the pass changes this BSDF: `eval` on doubles is then exact where its
  // arguments are constant, too (what `at` holds is one of them). False is always a safe answer.
  virtual bool is_constant() const { return false; }

  // The unit normal about which it scatters, and its lobe lies: n but for mapped normals.
  virtual Vec3d scattering_normal(const Vec3d& n, const Vec3d& /*wi*/,
                                  const Rgb<double>* /*at*/) const {
    return n;
  }
  // Whether this BSDF, or one nested in it, scatters about another normal than n.
  virtual bool maps_normals() {
    const auto inside = nested();
    return std::any_of(inside.begin(), inside.end(), [](auto& b) { return b->maps_normals(); });
  }
  // The summary of the rough lobes that edge samplers use as importance. By default the hemisphere
  // with albedo 1. With a null `at` its albedo bounds that at all points.
  virtual LobeSummary lobe(const Rgb<double>* /*at*/ = nullptr) const { return {}; }
  // The summary of the rough lobes behind the surface, where there are any, as if they lay in front
  // of the reversed normal for another viewer.
  struct PassedLobe {
    Vec3d wi;  // unit, towards that viewer
    LobeSummary lobe;
  };
  virtual PassedLobe passed_lobe(const Vec3d& n, const Vec3d& /*wi*/,
                                 const Rgb<double>* /*at*/) const {
    return {-n, {}};
  }
  // Constants, and the values of textures that are not texels ("reflectance.color0").
  virtual std::vector<ParameterRef> parameters() = 0;

  int texture_count() const { return texture_count_; }
  // 0 <= k < texture_count(). Nested BSDFs' textures follow the BSDF's own.
  virtual Texture& texture(int k) const { return *textures_[k]; }
  // The name of the colour or number that texture k gives ("reflectance").
  virtual std::string texture_name(int k) const { return texture_names_[k]; }
  // True if one of the textures is the tangent of the surface.
  bool needs_tangent() const;
  // at: of texture_count() elements.
  template <class S>
  void resolve(const TexturePoint<S>& point, Rgb<S>* at) const {
    for (int k = 0; k < texture_count_; ++k) at[k] = texture(k).eval(point);
  }

  // Brings what `resolve` reads into the cache.
  void fetch(const TexturePoint<double>& point) const {
    for (int k = 0; k < texture_count_; ++k) texture(k).fetch(point);
  }

  virtual std::shared_ptr<Bsdf> clone() const = 0;  // deep
  // Nested BSDFs. deep_copy() uses them to preserve sharing.
  virtual std::span<std::shared_ptr<Bsdf>> nested() { return {}; }
  // Lets mapped normals be used as in Mitsuba (see ShadingModel), also by nested BSDFs.
  virtual void set_mitsuba_shading(bool mitsuba) {
    for (const auto& bsdf : nested()) bsdf->set_mitsuba_shading(mitsuba);
  }
  // One line of description, printed by `limn info`.
  virtual std::string describe() const = 0;

 protected:
  Bsdf() = default;
  Bsdf(const Bsdf& other);  // copies textures
  Bsdf& operator=(const Bsdf&) = delete;

  // For constructors: keep the texture, if it is one, under this name.
  BsdfColour colour(const char* name, const ConstantOrTexture& source);
  BsdfNumber number(const char* name, const ConstantOrTexture& source);
  // Likewise, the tangent of the surface (tangent.h), for the parameter of this name: its index.
  int add_tangent(const char* name);
  // For parameters(): the constant, or what the texture has in its place.
  void add_parameter(const char* name, BsdfColour& colour, double least, double most,
                     std::vector<ParameterRef>& list);
  void add_parameter(const char* name, BsdfNumber& number, double least, double most,
                     std::vector<ParameterRef>& list);
  // For describe(): "0.5 0.5 0.5", or what the texture says.
  std::string text_of(const BsdfColour& colour) const;
  std::string text_of(const BsdfNumber& number) const;

  int texture_count_ = 0;  // those of nested BSDFs included
  Lobes lobes_;

 private:
  void add_texture_parameters(int texture, std::vector<ParameterRef>& list);

  std::vector<std::shared_ptr<Texture>> textures_;
  std::vector<std::string> texture_names_;
};

}  // namespace limn
