// From a point of the scene to the film.
#include "integrators/film/film_point.h"

namespace limn {

std::optional<FilmPoint> film_point(const Scene& scene, FaceRef face, const Vec3d& x,
                                    const LensPoint& lens) {
  if (scene.hide_emitters && scene.shape(face.shape).is_emitter) return {};
  const Camera& camera = scene.camera;
  const double depth = camera.depth(x);
  if (!(depth > camera.near_clip && depth < camera.far_clip)) return {};
  const FilmPosition film =
      camera.has_lens() ? CameraView<double>(camera).at(lens).project(x) : camera.project(x);
  const double border = scene.film.filter.radius;
  if (film.x < scene.film.crop_x - border || film.y < scene.film.crop_y - border ||
      film.x > scene.film.crop_x + scene.film.crop_width + border ||
      film.y > scene.film.crop_y + scene.film.crop_height + border) {
    return {};
  }
  FilmPoint point{{film, lens}, {}, {}, 0};
  point.ray = ray_at(CameraView<Dual>(camera), point.at);
  point.omega = value(point.ray.direction);
  point.distance = length(x - value(point.ray.origin));
  return point;
}

CameraRay<Dual> shifted_ray(const Camera& camera, const FilmPlace& at) {
  const auto at_rest = [](const Vec3<Dual>& v) { return Vec3<Dual>{v.x.v, v.y.v, v.z.v}; };
  const CameraView<Dual> view(camera, at_rest(camera.origin), at_rest(camera.left),
                              at_rest(camera.up), at_rest(camera.forward), Dual(camera.fov.v),
                              {Dual(camera.aperture_radius.v), Dual(camera.focus_distance.v)});
  return view.at(at.lens).ray(Dual(at.x, {1, 0, 0, 0}), Dual(at.y, {0, 1, 0, 0}));
}

Ray ray_to(const Scene& scene, const FilmPoint& point, FaceRef face) {
  Ray ray{value(point.ray.origin), point.omega, point.ray.t_min,
          point.distance * (1 - 0x1p-20)};  // as shadow rays end
  ray.end = face;
  ray.skip_emitters = scene.hide_emitters;
  return ray;
}

bool is_hidden(const PathContext& context, const FilmPoint& point, FaceRef face, RayCount& rays) {
  ++rays.shadow;
  return context.tracer.occluded(ray_to(context.scene, point, face));
}

// ds = (W / (2 tan_x))^2 / cos^3 domega, with W the film's width in pixels, tan_x that of half its
// field of view, and cos to the optical axis.
double film_per_solid_angle(const Camera& camera, const Vec3d& omega, double distance) {
  if (camera.is_orthographic()) {
    return camera.width * camera.height / (4 * camera.half_width * camera.half_height) * distance *
           distance;
  }
  const double cosine = dot(omega, value(camera.forward));
  const double scale = camera.width / (2 * std::tan(camera.fov.v * (kPi / 360)) * camera.x_factor);
  return scale * scale / (cosine * cosine * cosine);
}

}  // namespace limn
