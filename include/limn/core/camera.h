#pragma once
// The pinhole camera of Mitsuba 3: camera space has +X to the left of the image, +Y up, +Z along
// the view.
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

  // The ray through film position (x, y) [pixels of the full film, row 0 on top].
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

template <class S>
CameraRay<S> Camera::ray(double x, double y) const {
  using std::tan;
  const S tan_x = tan(as<S>(fov) * (kPi / 360)) * x_factor;
  const double sx = 1 - 2 * (x / width + offset_x);
  const double sy = (1 - 2 * (y / height + offset_y)) * height / width;
  const Vec3<S> d = as<S>(left) * (tan_x * sx) + as<S>(up) * (tan_x * sy) + as<S>(forward);
  const double d_length = length(value(d));
  return {as<S>(origin), normalize(d), near_clip * d_length, far_clip * d_length};
}

template <class S>
Camera::FilmPoint<S> Camera::project(const Vec3<S>& point) const {
  using std::tan;
  const S tan_x = tan(as<S>(fov) * (kPi / 360)) * x_factor;
  const Vec3<S> w = point - as<S>(origin);
  const S scale = 1.0 / (dot(w, as<S>(forward)) * tan_x);
  const S fx = (1.0 - dot(w, as<S>(left)) * scale) * 0.5 - offset_x;
  const S fy =
      (1.0 - dot(w, as<S>(up)) * scale * (static_cast<double>(width) / height)) * 0.5 - offset_y;
  return {fx * static_cast<double>(width), fy * static_cast<double>(height)};
}

}  // namespace limn
