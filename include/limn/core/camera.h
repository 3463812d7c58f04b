#pragma once
// The camera, a pinhole unless said otherwise. As in Mitsuba 3, +X of camera space points to the
// left of the image, +Y up, and +Z along the view.
#include <span>

#include "limn/core/dual.h"
#include "limn/core/vec.h"

namespace limn {

template <class S>
struct CameraRay {
  Vec3<S> origin;     // the pinhole
  Vec3<S> direction;  // unit
  double t_min;       // distances along the ray between the clip planes
  double t_max;
};

template <class S>
class CameraView;

struct Camera {
  Vec3<Dual> origin;
  Vec3<Dual> left, up, forward;  // orthonormal, world space
  Dual fov = 50;                 // degrees, along the axis of the file's fov_axis
  double x_factor = 1;           // tan(x_fov / 2) = x_factor * tan(fov / 2)
  double near_clip = 0.01;       // distances along `forward`
  double far_clip = 10000;
  double offset_x = 0;  // principal point, as a fraction of the full film
  double offset_y = 0;
  int width = 768;  // full film, pixels
  int height = 576;
  // Of an orthographic camera, whose rays are parallel to `forward` and start on a film around
  // `origin`: half of its extent along `left` and `up` [scene units]. It has rays, no derivatives.
  double half_width = 0;
  double half_height = 0;
  bool is_orthographic() const { return half_width > 0; }

  // The ray through the film position (x, y) [pixels of the full film, row 0 on top]. CameraView is
  // faster for many rays.
  template <class S>
  CameraRay<S> ray(double x, double y) const;

  // Film position of a world point [pixels]; needs depth(point) > 0.
  template <class S>
  struct FilmPoint {
    S x, y;
  };
  template <class S>
  FilmPoint<S> project(const Vec3<S>& point) const;
  // Distance along `forward`.
  template <class S>
  S depth(const Vec3<S>& point) const {
    return dot(point - as<S>(origin), as<S>(forward));
  }
};

// Values shared by all rays of a camera, precomputed. The camera must not change meanwhile.
template <class S>
class CameraView {
 public:
  explicit CameraView(const Camera& camera)
      : camera_(camera),
        origin_(as<S>(camera.origin)),
        left_(as<S>(camera.left)),
        up_(as<S>(camera.up)),
        forward_(as<S>(camera.forward)) {
    using std::tan;
    tan_x_ = tan(as<S>(camera.fov) * (kPi / 360)) * camera.x_factor;
  }

  // A view with the given origin and axes in place of the camera's own.
  CameraView(const Camera& camera, const Vec3<S>& origin, const Vec3<S>& left, const Vec3<S>& up,
             const Vec3<S>& forward, const S& fov)
      : camera_(camera), origin_(origin), left_(left), up_(up), forward_(forward) {
    using std::tan;
    tan_x_ = tan(fov * (kPi / 360)) * camera.x_factor;
  }

  const Vec3<S>& origin() const { return origin_; }
  // As Camera::depth.
  S depth(const Vec3<S>& point) const { return dot(point - origin_, forward_); }

  const Vec3<S>& forward() const { return forward_; }
  bool is_constant() const {
    using limn::is_constant;
    return is_constant(origin_) && is_constant(left_) && is_constant(up_) &&
           is_constant(forward_) && is_constant(tan_x_);
  }

  // Camera::ray. X is S, or double if the film position is static.
  template <class X>
  CameraRay<S> ray(const X& x, const X& y) const {
    const Camera& c = camera_;
    if (c.is_orthographic()) return parallel(value(x), value(y));
    const auto d = towards(x, y);
    const double d_length = length(value(d));
    return {origin_, normalize(d), c.near_clip * d_length, c.far_clip * d_length};
  }
  // `ray` of an orthographic camera.
  CameraRay<S> parallel(double x, double y) const {
    const Camera& c = camera_;
    const Vec3<S> across = left_ * S(c.half_width * (1 - 2 * x / c.width));
    const Vec3<S> along = up_ * S(c.half_height * (1 - 2 * y / c.height));
    return {origin_ + across + along, forward_, c.near_clip, c.far_clip};
  }
  // The unnormalised direction of `ray`, of depth 1.
  template <class X>
  Vec3<Product<S, X>> towards(const X& x, const X& y) const {
    const Camera& c = camera_;
    const X sx = 1.0 - 2.0 * (x / static_cast<double>(c.width) + c.offset_x);
    const X sy = (1.0 - 2.0 * (y / static_cast<double>(c.height) + c.offset_y)) *
                 static_cast<double>(c.height) / static_cast<double>(c.width);
    return left_ * (tan_x_ * sx) + up_ * (tan_x_ * sy) + forward_;
  }
  const Camera& camera() const { return camera_; }

  // The direction of ray(x + dx, y + dy) is that of a + dx u + dy v, which has depth 1.
  struct Plane {
    Vec3<S> u, v, a;
  };
  Plane plane(double x, double y) const {
    const Camera& c = camera_;
    const double sx = 1 - 2 * (x / c.width + c.offset_x);
    const double sy = (1 - 2 * (y / c.height + c.offset_y)) * c.height / c.width;
    const S step = tan_x_ * (-2.0 / c.width);
    return {left_ * step, up_ * step, left_ * (tan_x_ * sx) + up_ * (tan_x_ * sy) + forward_};
  }

  // As Camera::project.
  Camera::FilmPoint<S> project(const Vec3<S>& point) const {
    const Camera& c = camera_;
    const Vec3<S> w = point - origin_;
    const S scale = 1.0 / (dot(w, forward_) * tan_x_);
    const S fx = (1.0 - dot(w, left_) * scale) * 0.5 - c.offset_x;
    const S fy =
        (1.0 - dot(w, up_) * scale * (static_cast<double>(c.width) / c.height)) * 0.5 - c.offset_y;
    return {fx * static_cast<double>(c.width), fy * static_cast<double>(c.height)};
  }

 private:
  const Camera& camera_;
  Vec3<S> origin_, left_, up_, forward_;
  S tan_x_;
};

template <class S>
CameraRay<S> Camera::ray(double x, double y) const {
  return CameraView<S>(*this).ray(x, y);
}

template <class S>
Camera::FilmPoint<S> Camera::project(const Vec3<S>& point) const {
  return CameraView<S>(*this).project(point);
}

// Rays through many film positions, eight at a time (SIMD).
void find_rays(const CameraView<double>& view, std::span<const Camera::FilmPoint<double>> positions,
               std::span<CameraRay<double>> rays);

}  // namespace limn
