#pragma once
// A point on a surface, over any scalar: where a ray meets a face, with its normals, and where the
// rays start that leave it: above faces with interpolated normals, see surface_lift.h.
#include <array>
#include <cmath>

#include "limn/core/ray_tracer.h"
#include "limn/core/scene.h"
#include "limn/core/slots.h"
#include "limn/core/surface_lift.h"

namespace limn {

template <class S>
struct SurfacePoint {
  const Shape* shape = nullptr;
  FaceRef face;
  Vec3<S> p;    // where rays start: on the face, or above it on the side that is seen
  Vec3d n_g;    // unit geometric normal, outward by the winding
  Vec3<S> n_s;  // unit shading normal, on the side of n_g unless the file's normals say otherwise
  // p is so far above the face that rays from there meet the face as any other.
  bool lifted = false;
  // Barycentric coordinates of the face's second and third corner; set on textured meshes alone.
  std::array<S, 2> b;
  // The place on the face itself; set where points are lifted from a surface that light passes.
  std::array<S, 3> on_face;

  // The face that rays from p skip, if any.
  FaceRef start() const { return lifted ? FaceRef{} : face; }

  // Radiance that the surface itself emits towards the unit direction wi.
  Rgb<S> emission(const Vec3d& wi, ShadingModel model) const {
    if (!shape->is_emitter) return {};
    const double side = model == ShadingModel::kMitsuba ? dot(value(n_s), wi) : dot(n_g, wi);
    if (!(side > 0)) return {};
    return shape->radiance_texture ? detail::textured_radiance<S>(*shape, face.face, b)
                                   : detail::emitter_radiance<S>(*shape, face.shape);
  }
};

template <class S>
SurfacePoint<double> value(const SurfacePoint<S>& point) {
  const auto& x = point.on_face;
  return {point.shape,
          point.face,
          value(point.p),
          point.n_g,
          value(point.n_s),
          point.lifted,
          {value(point.b[0]), value(point.b[1])},
          {value(x[0]), value(x[1]), value(x[2])}};
}

namespace detail {

template <class S>
S interpolate(const S& b0, const S& b1, const S& b2, const S& a0, const S& a1, const S& a2) {
  return b0 * a0 + b1 * a1 + b2 * a2;
}

// Shading normal, and p lifted from the face if `lifts`, from the barycentric coordinates of the
// second and third corner. size: twice the area of the face; direction: of the ray that meets it.
template <class S, class P>
void interpolate_shading(const Mesh& mesh, const std::array<Vec3<P>, 3>& corners,
                         std::array<S, 2> of_corners, double size, const Vec3d& direction,
                         bool lifts, SurfacePoint<S>& point) {
  auto& [b1, b2] = of_corners;
  // A face that is narrower than the rounding of its points has no coordinates across: its middle
  // stands for all.
  const bool wide = std::fabs(value(b1)) <= 2 && std::fabs(value(b2)) <= 2;
  if (!wide) b1 = b2 = S(1.0 / 3);
  if (mesh.textured) point.b = {b1, b2};
  const std::array<S, 3> b = {1.0 - b1 - b2, b1, b2};
  const std::array<Vec3<S>, 3> n = corner_normals<S>(mesh, point.face.face);
  point.n_s = normalize(Vec3<S>{interpolate(b[0], b[1], b[2], n[0].x, n[1].x, n[2].x),
                                interpolate(b[0], b[1], b[2], n[0].y, n[1].y, n[2].y),
                                interpolate(b[0], b[1], b[2], n[0].z, n[1].z, n[2].z)});
  if (!wide || !lifts) return;
  std::array<S, 3> d;
  for (int k = 0; k < 3; ++k) d[k] = dot(point.p - corners[k], n[k]);
  const double side = dot(point.n_g, direction) < 0 ? 1 : -1;
  const Lift lift =
      lift_of({value(n[0]), value(n[1]), value(n[2])}, {value(b[0]), value(b[1]), value(b[2])},
              {value(d[0]), value(d[1]), value(d[2])}, point.n_g, side, size, value(point.p));
  for (int k = 0; k < 3; ++k) {
    if (lift.gain[k] != 0) point.p = point.p + n[k] * (b[k] * d[k] * lift.gain[k]);
  }
  point.lifted = lift.clear;
}

// lifts: above faces with interpolated normals.
template <class S, class P>
void place_on_plane(const Mesh& mesh, const Vec3<S>& origin, const Vec3<S>& direction, bool lifts,
                    SurfacePoint<S>& point) {
  // In plain numbers paths alone come here often, and have fetched it ahead (path_rays.h): once
  // more images of the demo took 0.99 of the time, by which two runs of one program differ, too.
  if constexpr (!std::is_same_v<S, double>) {
    if (mesh.normal_source != NormalSource::kFace) fetch_shading<S>(mesh, point.face.face);
  }
  const auto corners = face_corners<P>(mesh, point.face.face);
  const Vec3<P> e1 = corners[1] - corners[0];
  const Vec3<P> e2 = corners[2] - corners[0];
  const Vec3<P> n = cross(e1, e2);
  const S t = dot(corners[0] - origin, n) / dot(n, direction);
  point.p = origin + direction * t;
  const P over_length = 1.0 / length(n);
  point.n_g = value(n) * value(over_length);
  const bool flat = mesh.normal_source == NormalSource::kFace;
  if (flat) {
    const Vec3<P> unit = n * over_length;
    point.n_s = {S(unit.x), S(unit.y), S(unit.z)};
    if (!mesh.textured) return;
  }
  if (lifts && point.shape->bsdf->lobes().through) {
    point.on_face = {point.p.x, point.p.y, point.p.z};
  }
  const Vec3<S> q = point.p - corners[0];
  const P inverse = over_length * over_length;
  if (flat) {
    point.b = {dot(cross(q, e2), n) * inverse, dot(cross(e1, q), n) * inverse};
    return;
  }
  interpolate_shading<S, P>(mesh, corners,
                            {dot(cross(q, e2), n) * inverse, dot(cross(e1, q), n) * inverse},
                            1 / value(over_length), value(direction), lifts, point);
}

// A point that no parameter moves.
inline SurfacePoint<Dual> as_dual(const SurfacePoint<double>& point) {
  const auto still = [](const Vec3d& v) { return Vec3<Dual>{v.x, v.y, v.z}; };
  const auto& x = point.on_face;
  return {point.shape,      point.face,   still(point.p),           point.n_g,
          still(point.n_s), point.lifted, {point.b[0], point.b[1]}, {x[0], x[1], x[2]}};
}

}  // namespace detail

// Whether points of a shape are lifted: rays do not start on its faces.
inline bool is_lifted(const Scene& scene, ShapeId shape) {
  return scene.shading != ShadingModel::kMitsuba &&
         scene.shape(shape).mesh.normal_source != NormalSource::kFace;
}

// Where the line origin + t direction meets the plane of the face: the point that slides along the
// ray while the face moves and the ray is held (or moves as its Dual says), lifted as above but for
// Mitsuba's shading.
template <class S>
SurfacePoint<S> surface_on_ray(const Scene& scene, FaceRef face, const Vec3<S>& origin,
                               const Vec3<S>& direction) {
  SurfacePoint<S> point;
  point.shape = &scene.shape(face.shape);
  point.face = face;
  const Mesh& mesh = point.shape->mesh;
  const bool lifts = is_lifted(scene, face.shape);
  if constexpr (std::is_same_v<S, Dual>) {
    if (!mesh.position_tangents.empty()) {
      detail::place_on_plane<S, Dual>(mesh, origin, direction, lifts, point);
      return point;
    }
    if (is_constant(origin) && is_constant(direction) && mesh.normal_tangents.empty()) {
      point = detail::as_dual(surface_on_ray<double>(scene, face, value(origin), value(direction)));
      return point;
    }
  }
  detail::place_on_plane<S, double>(mesh, origin, direction, lifts, point);
  return point;
}

// The point where what leaves `point`, seen along wi, on the other side of the surface starts.
// Light must pass the surface.
template <class S>
SurfacePoint<S> beyond(const Scene& scene, const SurfacePoint<S>& point, const Vec3<S>& wi) {
  if (!is_lifted(scene, point.face.shape)) return point;
  const auto& x = point.on_face;
  return surface_on_ray<S>(scene, point.face, Vec3<S>{x[0], x[1], x[2]}, wi);
}

}  // namespace limn
