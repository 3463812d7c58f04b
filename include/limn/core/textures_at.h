#pragma once
// The textures of a BSDF at a surface point, over any scalar, and the BSDF with them.
#include <type_traits>

#include "limn/core/slots.h"
#include "limn/core/surface_point.h"

namespace limn {

// Nothing is looked up, nor even written, for BSDFs without textures.
template <class S>
class TexturesAt {
 public:
  TexturesAt() {}  // NOLINT: the values are not initialised

  void resolve(const Bsdf& bsdf, const SurfacePoint<S>& point) {
    count_ = bsdf.texture_count();
    const Mesh& mesh = point.shape->mesh;
    bsdf.resolve(texture_point<S>(mesh, point.face.face, point.b), moving_.values);
    for (int k = 0; k < count_; ++k) held_.values[k] = value(moving_.values[k]);
  }
  const Rgb<double>* held() const { return held_.values; }
  const Rgb<S>* moving() const { return moving_.values; }
  // Whether no derivative of the values is other than zero.
  bool constant() const {
    for (int k = 0; k < count_; ++k)
      if (!is_constant(moving_.values[k])) return false;
    return true;
  }
  void hold() {
    for (int k = 0; k < count_; ++k) {
      const Rgb<double>& c = held_.values[k];
      moving_.values[k] = {c.r, c.g, c.b};
    }
  }
  int count() const { return count_; }
  // Var: the point, with derivatives along its barycentric coordinates in the first two lanes.
  const TexturePoint<Dual>& point() const { return point_; }

 private:
  template <class T>
  union Values {
    Values() {}  // NOLINT
    Rgb<T> values[kMostTextures];
  };
  int count_ = 0;
  Values<S> moving_;
  Values<double> held_;
  struct Nothing {};
  std::conditional_t<std::is_same_v<S, Var>, TexturePoint<Dual>, Nothing> point_;
};
template <>
void TexturesAt<Var>::resolve(const Bsdf& bsdf, const SurfacePoint<Var>& point);

template <>
class TexturesAt<double> {
 public:
  TexturesAt() {}  // NOLINT
  void resolve(const Bsdf& bsdf, const SurfacePoint<double>& point) {
    const Mesh& mesh = point.shape->mesh;
    bsdf.resolve(texture_point<double>(mesh, point.face.face, point.b), values_);
  }
  const Rgb<double>* held() const { return values_; }
  const Rgb<double>* moving() const { return values_; }

 private:
  union {
    Rgb<double> values_[kMostTextures];
  };
};

namespace detail {

// Bsdf::eval with derivatives with respect to its arguments and parameters. copies: null if the
// parameters are constant.
template <class S>
Rgb<S> eval_bsdf(const Bsdf& bsdf, const SeededCopies<Bsdf>*, const Vec3<S>& n, const Vec3<S>& wi,
                 const Vec3<S>& wo, const TexturesAt<S>& textures) {
  return bsdf.eval(n, wi, wo, textures.moving());
}
template <>
Rgb<Var> eval_bsdf<Var>(const Bsdf& bsdf, const SeededCopies<Bsdf>* copies, const Vec3<Var>& n,
                        const Vec3<Var>& wi, const Vec3<Var>& wo, const TexturesAt<Var>& textures);

// The k-th of Bsdf::smooth_rays in the same way.
template <class S>
SmoothRay<S> smooth_ray(const Bsdf& bsdf, const SeededCopies<Bsdf>*, const Vec3<S>& n,
                        const Vec3<S>& wi, int k, const TexturesAt<S>& textures) {
  SmoothRays<S> rays;
  bsdf.smooth_rays(n, wi, rays, textures.moving());
  return rays[k];
}
template <>
SmoothRay<Var> smooth_ray<Var>(const Bsdf& bsdf, const SeededCopies<Bsdf>* copies,
                               const Vec3<Var>& n, const Vec3<Var>& wi, int k,
                               const TexturesAt<Var>& textures);

}  // namespace detail

}  // namespace limn
