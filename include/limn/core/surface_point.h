#pragma once
// A point on a surface, over any scalar: where a ray meets a face, with its normals.
#include <array>
#include <cmath>

#include "limn/core/ray_tracer.h"
#include "limn/core/scene.h"
#include "limn/core/slots.h"

namespace limn {

template <class S>
struct SurfacePoint {
  const Shape* shape = nullptr;
  FaceRef face;
  Vec3<S> p;
  Vec3d n_g;    // unit geometric normal, outward by the winding
  Vec3<S> n_s;  // unit shading normal, on the side of n_g unless the file's normals say otherwise
  S horizon{};  // s of shading.h; 0 for flat shading

  // Radiance that the surface itself emits towards the unit direction wi.
  Rgb<S> emission(const Vec3d& wi, ShadingModel model) const {
    if (!shape->is_emitter) return {};
    const double side = model == ShadingModel::kMitsuba ? dot(value(n_s), wi) : dot(n_g, wi);
    return side > 0 ? detail::emitter_radiance<S>(*shape, face.shape) : Rgb<S>{};
  }
};

namespace detail {

template <class S>
S interpolate(const S& b0, const S& b1, const S& b2, const S& a0, const S& a1, const S& a2) {
  return b0 * a0 + b1 * a1 + b2 * a2;
}

// Shading normal and horizon from the barycentric coordinates (b1, b2) of the second and third
// corner.
template <class S>
void interpolate_shading(const Mesh& mesh, S b1, S b2, SurfacePoint<S>& point) {
  // A face that is narrower than the rounding of its points has no coordinates across: its middle
  // stands for all.
  if (!(std::fabs(value(b1)) <= 2 && std::fabs(value(b2)) <= 2)) b1 = b2 = S(1.0 / 3);
  const S b0 = 1.0 - b1 - b2;
  const FaceIndices& ids = mesh.normal_ids[point.face.face.index()];
  const FaceIndices& vertices = mesh.face(point.face.face);
  Vec3<S> n[3];
  S h[3];
  for (int k = 0; k < 3; ++k) {
    const Vec3d& a = mesh.normals[ids[k]];
    n[k] = {a.x, a.y, a.z};
    h[k] = mesh.horizon[vertices[k]];
    if constexpr (!std::is_same_v<S, double>) {
      if (!mesh.normal_tangents.empty()) {
        const Vec3<Lanes>& d = mesh.normal_tangents[ids[k]];
        n[k] = {{a.x, d.x}, {a.y, d.y}, {a.z, d.z}};
      }
      if (!mesh.horizon_tangents.empty()) h[k].d = mesh.horizon_tangents[vertices[k]];
    }
  }
  point.n_s = normalize(Vec3<S>{interpolate(b0, b1, b2, n[0].x, n[1].x, n[2].x),
                                interpolate(b0, b1, b2, n[0].y, n[1].y, n[2].y),
                                interpolate(b0, b1, b2, n[0].z, n[1].z, n[2].z)});
  point.horizon = interpolate(b0, b1, b2, h[0], h[1], h[2]);
}

// Brings what interpolate_shading reads into the cache, while the plane is still to be met.
template <class S>
void fetch_shading(const Mesh& mesh, FaceId face) {
  const auto fetch = [](const auto& values, uint32_t i) {
    const char* begin = reinterpret_cast<const char*>(&values[i]);
    __builtin_prefetch(begin);
    if (sizeof(values[i]) > 64) __builtin_prefetch(begin + sizeof(values[i]) - 1);
  };
  const FaceIndices& ids = mesh.normal_ids[face.index()];
  const FaceIndices& vertices = mesh.face(face);
  for (int k = 0; k < 3; ++k) {
    fetch(mesh.normals, ids[k]);
    fetch(mesh.horizon, vertices[k]);
    // Plain numbers read no tangents.
    if constexpr (!std::is_same_v<S, double>) {
      if (!mesh.position_tangents.empty()) fetch(mesh.position_tangents, vertices[k]);
      if (!mesh.normal_tangents.empty()) fetch(mesh.normal_tangents, ids[k]);
      if (!mesh.horizon_tangents.empty()) fetch(mesh.horizon_tangents, vertices[k]);
    }
  }
}

template <class S, class P>
void place_on_plane(const Mesh& mesh, const Vec3<S>& origin, const Vec3<S>& direction,
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
  if (mesh.normal_source == NormalSource::kFace) {
    const Vec3<P> unit = n * over_length;
    point.n_s = {S(unit.x), S(unit.y), S(unit.z)};
    return;
  }
  const Vec3<S> q = point.p - corners[0];
  const P inverse = over_length * over_length;
  interpolate_shading<S>(mesh, dot(cross(q, e2), n) * inverse, dot(cross(e1, q), n) * inverse,
                         point);
}

// A point that no parameter moves.
inline SurfacePoint<Dual> as_dual(const SurfacePoint<double>& point) {
  const auto still = [](const Vec3d& v) { return Vec3<Dual>{v.x, v.y, v.z}; };
  return {point.shape, point.face, still(point.p), point.n_g, still(point.n_s), point.horizon};
}

}  // namespace detail

// Where the line origin + t direction meets the plane of the face: the point that slides along the
// ray while the face moves and the ray is held (or moves as its Dual says).
template <class S>
SurfacePoint<S> surface_on_ray(const Scene& scene, FaceRef face, const Vec3<S>& origin,
                               const Vec3<S>& direction) {
  SurfacePoint<S> point;
  point.shape = &scene.shape(face.shape);
  point.face = face;
  const Mesh& mesh = point.shape->mesh;
  if constexpr (std::is_same_v<S, Dual>) {
    if (!mesh.position_tangents.empty()) {
      detail::place_on_plane<S, Dual>(mesh, origin, direction, point);
      return point;
    }
    if (is_still(origin) && is_still(direction) && mesh.normal_tangents.empty()) {
      point = detail::as_dual(surface_on_ray<double>(scene, face, value(origin), value(direction)));
      return point;
    }
  }
  detail::place_on_plane<S, double>(mesh, origin, direction, point);
  return point;
}

}  // namespace limn
