// Where the camera sees points of edges through planes of glass.
#include "integrators/terms/refracted_view.h"

#include <cmath>
#include <limits>

#include "integrators/edges/flat_mirrors.h"
#include "integrators/film/film_point.h"
#include "integrators/terms/film_views.h"
#include "integrators/terms/mirror_sight.h"

namespace limn {
namespace {

Lanes along(const Vec3<Lanes>& v, const Vec3d& g) { return v.x * g.x + v.y * g.y + v.z * g.z; }

Vec3<Lanes> velocity_of(const Vec3<Dual>& v) { return {v.x.d, v.y.d, v.z.d}; }

}  // namespace

RefractedView::RefractedView(const PathContext& context, const FlatMirrors::Chain& chain, bool free)
    : context_(context), chain_(chain), free_(free) {
  const FlatMirrors& planes = *context.flat_mirrors;
  const Camera& camera = context.scene.camera;
  const Vec3d eye = value(camera.origin);
  const MirrorPlane<double> first = planes.plane(chain.mirrors[0]);
  n_ = first.distance(eye_before(camera, first.point)) < 0 ? first.n : -first.n;
  // Parallel rays start before and behind the origin.
  double depth = camera.is_orthographic() ? -std::numeric_limits<double>::infinity() : 0;
  index_[0] = 1;
  for (uint32_t k = 0; k < chain.count; ++k) {
    const MirrorPlane<double> plane = planes.plane(chain.mirrors[k]);
    depth_[k] = dot(n_, plane.point - eye);
    const double ratio = planes.refraction(chain.mirrors[k], dot(n_, plane.n) < 0);
    if (!(depth_[k] > depth) || !(ratio > 0)) return;
    depth = depth_[k];
    index_[k + 1] = index_[k] * ratio;
  }
  seen_ = true;
}

// Nearer than 16 roundings of a distance there is nothing but what touches the plane.
bool RefractedView::clip(const Vec3d& a, const Vec3d& b, double& t0, double& t1) const {
  const Vec3d eye = value(context_.scene.camera.origin);
  const double last = depth_[chain_.count - 1];
  const double from = dot(n_, a - eye) - last, to = dot(n_, b - eye) - last;
  const double touching = 0x1p-20 * (length(a - eye) + length(b - eye));
  return clip_range(from, to - from, touching, std::numeric_limits<double>::infinity(), t0, t1);
}

// Lanes 0 and 1: of the film position; all else is at rest.
RefractedView::Carried<Dual> RefractedView::carried_by_film(const FilmPlace& at) const {
  const CameraRay<Dual> ray = shifted_ray(context_.scene.camera, at);
  Vec3<Dual> origin = ray.origin, d = ray.direction;
  const Vec3<Dual> n{n_.x, n_.y, n_.z};
  for (uint32_t k = 0; k < chain_.count; ++k) {
    const MirrorPlane<Dual> plane = at_rest(context_.flat_mirrors->plane(chain_.mirrors[k]));
    origin = origin + d * (dot(n, plane.point - origin) / dot(n, d));
    const double r = index_[k] / index_[k + 1];
    const Dual c = dot(n, d);
    d = d * r + n * (sqrt(1.0 - (1.0 - c * c) * (r * r)) - c * r);
  }
  return {origin, d};
}

// As the parameters move the camera, the planes and their indices.
RefractedView::Carried<Dual> RefractedView::carried_by_scene(const FilmPlace& at) const {
  const auto ray = ray_at(CameraView<Dual>(context_.scene.camera), at);
  MirrorFaces faces;
  for (uint32_t k = 0; k < chain_.count; ++k) {
    faces.faces[k] = context_.flat_mirrors->mirrors()[chain_.mirrors[k]].faces[0];
  }
  faces.count = chain_.count;
  Carried<Dual> carried{ray.origin, ray.direction};
  refract_ray(context_.scene, faces, carried.origin, carried.direction);
  return carried;
}

std::optional<FilmPlace> RefractedView::place(const Vec3d& y, const LensPoint& lens) const {
  const Camera& camera = context_.scene.camera;
  const auto view = CameraView<double>(camera).at(lens);
  const Vec3d center = value(camera.origin), forward = value(camera.forward);
  if (camera.is_orthographic()) {
    // Parallel rays are parallel in each layer: back from y to the first plane.
    Vec3d x = y;
    for (uint32_t k = chain_.count; k > 0; --k) {
      const double end = k < chain_.count ? depth_[k] : dot(n_, y - center);
      const double r = index_[0] / index_[k], c = dot(n_, forward);
      const Vec3d across = (forward - n_ * c) * r;
      const double root = 1 - length_squared(across);
      if (!(root > 0)) return {};
      x = x - (across / std::sqrt(root) + n_) * (end - depth_[k - 1]);
    }
    return FilmPlace{view.project(x), lens};
  }
  const Vec3d eye = view.origin();
  std::array<FlatLayer, 3> layers;
  double depth = dot(n_, eye - center);
  for (uint32_t k = 0; k <= chain_.count; ++k) {
    const double end = k < chain_.count ? depth_[k] : dot(n_, y - center);
    layers[k] = {end - depth, index_[k]};
    depth = end;
  }
  if (!(layers[0].height > 0)) return {};
  const Vec3d towards = direction_through({layers.data(), chain_.count + 1}, n_, y - eye);
  if (!(dot(towards, forward) > 0)) return {};
  return FilmPlace{view.project(eye + towards), lens};
}

std::optional<RefractedPoint> RefractedView::see(const EdgeMesh& mesh, EdgeId edge, double t,
                                                 const LensPoint& lens) const {
  const auto [v0, v1] = mesh.edge(edge).vertices;
  const Vec3d a = mesh.position(v0), b = mesh.position(v1), y = a * (1 - t) + b * t;
  const auto at = place(y, lens);
  if (!at) return {};
  RefractedPoint point;
  point.at = *at;

  const Carried<Dual> film = carried_by_film(*at);
  const Vec3d q = value(film.origin), d = value(film.direction);
  if (!is_candidate(mesh, edge, q)) return {};
  const double distance = dot(d, y - q);
  const Vec3<Lanes> moved = velocity_of(film.origin) + velocity_of(film.direction) * distance;
  const Vec3d by_x{moved.x[0], moved.y[0], moved.z[0]}, by_y{moved.x[1], moved.y[1], moved.z[1]};
  const Vec3d e = b - a, normal = cross(d, e), across = e - d * dot(d, e);
  const double mx = dot(normal, by_x), my = dot(normal, by_y), size = std::hypot(mx, my);
  if (!(size > 0)) return {};
  point.nx = mx / size;
  point.ny = my / size;
  const double swept = std::fabs(dot(across, by_y * point.nx - by_x * point.ny));
  if (!(swept > 0)) return {};
  point.stretch = length_squared(across) / swept;
  point.g = normal / size;
  if (free_) {
    point.speed = {point.g.x, point.g.y, point.g.z, 0};
    return point;
  }
  Vec3<Lanes> own;
  if (!mesh.tangents.empty()) own = mesh.tangent(v0) * (1 - t) + mesh.tangent(v1) * t;
  const Carried<Dual> ray = carried_by_scene(*at);
  own = own - velocity_of(ray.origin) - velocity_of(ray.direction) * distance;
  point.speed = along(own, point.g);
  return point;
}

}  // namespace limn
