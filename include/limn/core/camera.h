#pragma once
// The camera: a pinhole, a thin lens or orthographic. As in Mitsuba 3, +X of camera space points to
// the left of the image, +Y up, and +Z along the view.
#include <span>

#include "limn/core/dual.h"
#include "limn/core/vec.h"

namespace limn {

template <class S>
struct CameraRay {
  Vec3<S> origin;     // the pinhole, a point of the lens or of an orthographic film
  Vec3<S> direction;  // unit
  double t_min;       // distances along the ray between the clip planes
  double t_max;
};

// A point of a lens, as fractions of its radius along `left` and `up`.
struct LensPoint {
  double x = 0, y = 0;
};
// Uniform on the unit disk for uniform numbers, by concentric squares (Shirley and Chiu 1997).
LensPoint lens_point(double u, double v);

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
  // `origin`: half of its extent along `left` and `up` [scene units], and along `up` of a square.
  double half_width = 0, half_height = 0, half_square = 0;
  bool is_orthographic() const { return half_width > 0; }
  // Of a thin lens around `origin`: its radius, and the distance along `forward` of the plane that
  // is in focus [scene units].
  Dual aperture_radius = 0, focus_distance = 1;
  bool has_lens() const { return aperture_radius.v > 0; }
  bool is_pinhole() const { return !has_lens() && !is_orthographic(); }

  // The ray through the film position (x, y) [pixels of the full film, row 0 on top], and through
  // the center of a lens. CameraView is faster for many rays.
  template <class S>
  CameraRay<S> ray(double x, double y) const {
    return CameraView<S>(*this).ray(x, y);
  }

  // Film position of a world point [pixels]; needs depth(point) > 0.
  template <class S>
  struct FilmPoint {
    S x, y;
  };
  template <class S>
  FilmPoint<S> project(const Vec3<S>& point) const {
    return CameraView<S>(*this).project(point);
  }
  // Distance along `forward`.
  template <class S>
  S depth(const Vec3<S>& point) const {
    return dot(point - as<S>(origin), as<S>(forward));
  }
};

// Values that all rays of a camera share. The camera must not change meanwhile.
template <class S>
class CameraView {
 public:
  struct Lens {
    S radius, focus;
  };

  explicit CameraView(const Camera& camera)
      : CameraView(camera, as<S>(camera.origin), as<S>(camera.left), as<S>(camera.up),
                   as<S>(camera.forward), as<S>(camera.fov),
                   {as<S>(camera.aperture_radius), as<S>(camera.focus_distance)}) {}

  // With the given values in place of the camera's own.
  CameraView(const Camera& camera, const Vec3<S>& origin, const Vec3<S>& left, const Vec3<S>& up,
             const Vec3<S>& forward, const S& fov, const Lens& lens)
      : camera_(camera),
        origin_(origin),
        left_(left),
        up_(up),
        forward_(forward),
        axis_(forward),
        lens_(lens) {
    using std::tan;
    tan_x_ = tan(fov * (kPi / 360)) * camera.x_factor;
  }

  // The view from a point of the lens: that of a pinhole there whose film is shifted so that what
  // is in focus stays in place. Without a lens, this view.
  CameraView at(const LensPoint& point) const {
    CameraView view(*this);
    if (!camera_.has_lens()) return view;
    const S x = lens_.radius * point.x, y = lens_.radius * point.y;
    view.shift_x_ = x / lens_.focus;
    view.shift_y_ = y / lens_.focus;
    view.origin_ = origin_ + left_ * x + up_ * y;
    view.axis_ = forward_ - left_ * view.shift_x_ - up_ * view.shift_y_;
    return view;
  }

  const Vec3<S>& origin() const { return origin_; }
  // Where the ray that sees a point starts.
  Vec3<S> start_of(const Vec3<S>& point) const {
    return camera_.is_orthographic() ? point - forward_ * depth(point) : origin_;
  }
  // As Camera::depth.
  S depth(const Vec3<S>& point) const { return dot(point - origin_, forward_); }

  const Vec3<S>& forward() const { return forward_; }
  bool is_constant() const {
    using limn::is_constant;
    return is_constant(origin_) && is_constant(left_) && is_constant(up_) &&
           is_constant(forward_) && is_constant(tan_x_) && is_constant(lens_.radius) &&
           is_constant(lens_.focus);
  }

  // Camera::ray. X is S, or double if the film position is static.
  template <class X>
  CameraRay<S> ray(const X& x, const X& y) const {
    const Camera& c = camera_;
    if (c.is_orthographic()) return parallel(x, y);
    const auto d = towards(x, y);
    const double d_length = length(value(d));
    return {origin_, normalize(d), c.near_clip * d_length, c.far_clip * d_length};
  }
  // `ray` of an orthographic camera.
  template <class X>
  CameraRay<S> parallel(const X& x, const X& y) const {
    const Camera& c = camera_;
    const Vec3<S> across = left_ * S(c.half_width * (1.0 - 2.0 * x / double(c.width)));
    const Vec3<S> along = up_ * S(c.half_height * (1.0 - 2.0 * y / double(c.height)));
    return {origin_ + across + along, forward_, c.near_clip, c.far_clip};
  }
  // The unnormalised direction of `ray`, of depth 1.
  template <class X>
  Vec3<Product<S, X>> towards(const X& x, const X& y) const {
    const Camera& c = camera_;
    const X sx = 1.0 - 2.0 * (x / static_cast<double>(c.width) + c.offset_x);
    const X sy = (1.0 - 2.0 * (y / static_cast<double>(c.height) + c.offset_y)) *
                 static_cast<double>(c.height) / static_cast<double>(c.width);
    return left_ * (tan_x_ * sx) + up_ * (tan_x_ * sy) + axis_;
  }
  const Camera& camera() const { return camera_; }

  // The direction of ray(x + dx, y + dy) is that of a + dx u + dy v, which has depth 1.
  struct Plane {
    Vec3<S> u, v, a;
  };
  Plane plane(double x, double y) const {
    const S step = tan_x_ * (-2.0 / camera_.width);
    return {left_ * step, up_ * step, towards(x, y)};
  }

  // As Camera::project.
  Camera::FilmPoint<S> project(const Vec3<S>& point) const {
    const Camera& c = camera_;
    const Vec3<S> w = point - origin_;
    if (c.is_orthographic()) {
      return {(1.0 - dot(w, left_) * (1 / c.half_width)) * (0.5 * c.width),
              (1.0 - dot(w, up_) * (1 / c.half_height)) * (0.5 * c.height)};
    }
    const S depth = dot(w, forward_);
    const S scale = 1.0 / (depth * tan_x_);
    S across = dot(w, left_), along = dot(w, up_);
    if (c.has_lens()) {
      across += depth * shift_x_;
      along += depth * shift_y_;
    }
    const S fx = (1.0 - across * scale) * 0.5 - c.offset_x;
    const S fy =
        (1.0 - along * scale * (static_cast<double>(c.width) / c.height)) * 0.5 - c.offset_y;
    return {fx * static_cast<double>(c.width), fy * static_cast<double>(c.height)};
  }

 private:
  const Camera& camera_;
  Vec3<S> origin_, left_, up_, forward_;
  Vec3<S> axis_;  // to the middle of the film, but for principal points; of depth 1
  Lens lens_;
  S shift_x_ = 0, shift_y_ = 0;  // of the film, at depth 1
  S tan_x_;
};

// Rays through many film positions, eight at a time (SIMD).
void find_rays(const CameraView<double>& view, std::span<const Camera::FilmPoint<double>> positions,
               std::span<CameraRay<double>> rays);

}  // namespace limn
