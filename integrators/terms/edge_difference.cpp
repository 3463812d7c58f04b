// The radiance difference across an edge: which faces lie on either side, and a path from each.
#include "integrators/terms/edge_difference.h"

#include <algorithm>

#include "integrators/edges/near_faces.h"
#include "integrators/edges/texture_discontinuities.h"
#include "integrators/paths/path_follow.h"
#include "integrators/paths/straight_way.h"
#include "limn/core/duplicate_faces.h"
#include "limn/core/prefetch.h"

namespace limn {

bool view_edge(const EdgeMesh& mesh, EdgeRef id, double t, const Vec3d& p, EdgeView& view) {
  const Edge& edge = mesh.edge(id.edge);
  view.id = id;
  view.p = p;
  view.x0 = mesh.position(edge.vertices[0]);
  view.x1 = mesh.position(edge.vertices[1]);
  view.y = view.x0 + (view.x1 - view.x0) * t;
  const Vec3d w = view.y - p;
  view.distance = length(w);
  if (view.distance == 0) return false;
  view.omega = w / view.distance;
  view.side = cross(view.x0 - p, view.x1 - p);
  return true;
}

namespace {

// The nearest face on either side of an edge, or none.
struct Sides {
  std::optional<FaceSide> negative, positive;
};

// Whether a face is seen before another one on the same side.
bool hides(const PathContext& context, const FaceSide& a, double slope_a, const FaceSide& b,
           double slope_b, const Vec3d& omega) {
  if (overlap(context.tracer, a, b)) return is_hit_first(context.scene, a.face, b.face, omega);
  return slope_a < slope_b;
}

// Bring what nearest_faces reads into the cache: which corners faces have, and where these lie.
void fetch_faces(const Scene& scene, const FacesAround& around) {
  for (const FaceRef face : around.faces) {
    prefetch(&scene.shape(face.shape).mesh.face(face.face));
  }
}
void fetch_corners(const Scene& scene, const FacesAround& around) {
  for (const FaceRef face : around.faces) {
    const Mesh& mesh = scene.shape(face.shape).mesh;
    for (const uint32_t vertex : mesh.face(face.face)) prefetch(&mesh.positions[vertex]);
  }
}

// In the plane across the edge, a face leaves the edge along the unit vector a = alpha m + beta w,
// with m the normal of the viewing plane through the edge and w the part of omega across the edge:
// it lies on the side of alpha's sign, and the smaller beta / |alpha|, the nearer it is.
Sides nearest_faces(const PathContext& context, const EdgeMesh& mesh, const EdgeView& view,
                    bool hide_emitters) {
  const Scene& scene = context.scene;
  const Vec3d along = normalize(view.x1 - view.x0);
  const Vec3d across = view.omega - along * dot(view.omega, along);
  const FacesAround around = mesh.around(view.id.edge);
  const auto for_every_seen_side = [&](const auto& visit) {
    for_every_side(scene, around, view.x0, along, [&](const FaceSide& side, Incidence incidence) {
      const double alpha = dot(side.into, view.side);
      if (alpha == 0 || (hide_emitters && scene.shape(side.face.shape).is_emitter)) return;
      visit(side, incidence.motion_group, alpha > 0, dot(side.into, across) / std::fabs(alpha));
    });
  };
  RimOrder order;
  if (!around.incidences.empty()) {
    for_every_seen_side([&](const FaceSide&, uint8_t motion_group, bool positive, double slope) {
      order.add(motion_group, positive, slope);
    });
  }
  Sides sides;
  double slopes[2] = {0, 0};
  const uint8_t own = mesh.edge(view.id.edge).motion_group;
  for_every_seen_side([&](const FaceSide& side, uint8_t motion_group, bool positive, double slope) {
    for (const bool place : {false, true}) {
      if (!order.is_seen(motion_group, positive, own, place)) continue;
      auto& nearest = place ? sides.positive : sides.negative;
      if (nearest && !hides(context, side, slope, *nearest, slopes[place], view.omega)) continue;
      nearest = side;
      slopes[place] = slope;
    }
  });
  return sides;
}

// Textures may be discontinuous at the edge: they are looked up beside it. by: in barycentric
// coordinates; more than lines may be off the edge that they are taken for.
void step_aside(const std::array<Vec3d, 3>& corners, const Vec3d& into, double by,
                std::array<double, 2>& b) {
  const Vec3d e1 = corners[1] - corners[0], e2 = corners[2] - corners[0], n = cross(e1, e2);
  const double slope[2] = {dot(cross(into, e2), n), dot(cross(e1, into), n)};
  const double step = by / (std::fabs(slope[0]) + std::fabs(slope[1]));
  for (int k = 0; k < 2; ++k) b[k] += slope[k] * step;
}

// Radiance on both sides of an edge, by paths that go side by side: from the nearest face, or from
// what lies behind.
class RadianceBeside {
 public:
  RadianceBeside(const PathContext& context, const EdgeView& view, bool of_texture, int bounces,
                 const Rng& key, RayCount& rays, const RadiancePart& part)
      : scene_(context.scene),
        view_(view),
        of_texture_(of_texture),
        part_(part),
        path_(context, rays),
        walks_{{key, bounces, nullptr}, {key, bounces, nullptr}} {}

  void start_on_face(int i, const FacesAround& around, const FaceSide& side) {
    const auto corners = face_corners<double>(scene_.shape(side.face.shape).mesh, side.face.face);
    Vec3d n = cross(corners[1] - corners[0], corners[2] - corners[0]);
    if (dot(n, view_.omega) < 0) n = -n;
    edges_[i] = {around, view_.x0, view_.x1, side};
    walks_[i].edge = &edges_[i];
    SurfacePoint<double> surface = surface_on_ray(scene_, side.face, view_.y, n);
    if (const Mesh& mesh = surface.shape->mesh; mesh.textured) {
      const bool curved = of_texture_ && !is_linear(mesh.uv_source);
      step_aside(corners, side.into, curved ? 4 * kOffCurve : 0x1p-21, surface.b);
    }
    start(i, surface);
  }
  void start_behind(int i, FaceRef face) {
    start(i, surface_on_ray(scene_, face, view_.p, view_.omega));
  }
  void escape(int i) {
    if (part_.region) {
      radiance_[i] = part_.regions->escaped(*part_.region, view_.omega);
      return;
    }
    radiance_[i] = path_.escaped(view_.omega, walks_[i].bounces);
    if (part_.regions) radiance_[i] = radiance_[i] - part_.regions->escaped(view_.omega);
  }
  // Throws as RayTracer does.
  Rgb<double> difference() {
    path_.follow({going_, count_});
    for (int i = 0; i < 2; ++i) radiance_[i] = walks_[i].radiance() + radiance_[i];
    return radiance_[0] - radiance_[1];
  }

 private:
  using Tracer = PathTracer<double, NoVisitor>;

  void start(int i, const SurfacePoint<double>& surface) {
    const Vec3d wi = -view_.omega;
    if (part_.region) {
      radiance_[i] = part_.regions->emission(*part_.region, surface, wi);
      return;
    }
    if (part_.regions) radiance_[i] = Rgb<double>{} - part_.regions->emission(surface, wi);
    path_.place(walks_[i], surface, wi);
    walks_[i].beside_edge = true;
    going_[count_++] = &walks_[i];
  }

  const Scene& scene_;
  const EdgeView& view_;
  bool of_texture_;
  const RadiancePart& part_;
  Tracer path_;
  Tracer::Walk walks_[2];
  EdgeStart edges_[2];
  Rgb<double> radiance_[2];  // but for what the paths find
  Tracer::Walk* going_[2];
  size_t count_ = 0;
};

// Up to a face at this distance.
Ray ending_on(Ray ray, FaceRef face, double distance) {
  ray.end = face;
  ray.t_max = std::min(ray.t_max, distance * (1 - 0x1p-20));  // as shadow rays end
  return ray;
}

// Starts both sides of an edge inside of a face, where the face's texture is discontinuous. False
// if the edge is hidden.
bool start_beside_texture(const PathContext& context, const FacesAround& around,
                          const EdgeView& view, const Ray& ray, RadianceBeside& beside,
                          RayCount& rays) {
  const FaceRef face = around.faces[0];
  if (ray.skip_emitters && context.scene.shape(face.shape).is_emitter) return false;
  ++rays.shadow;
  if (context.tracer.occluded(ending_on(ray, face, view.distance))) return false;
  const FaceSide side = side_of_face(context.scene, face, view.x0, normalize(view.x1 - view.x0));
  const bool positive = dot(side.into, view.side) > 0;
  beside.start_on_face(positive ? 1 : 0, around, side);
  beside.start_on_face(positive ? 0 : 1, around, {face, -side.into, side.rounding});
  return true;
}

// What edge_difference finds where nothing at all may lie before the edge. ray: to it.
bool difference_in_sight(const PathContext& context, const EdgeMesh& mesh, const EdgeView& view,
                         Ray ray, const EdgeViewer& viewer, RayCount& rays,
                         Rgb<double>& difference) {
  const RadiancePart& part = viewer.part;
  if (view.distance > ray.t_max) return false;
  const FacesAround around = mesh.around(view.id.edge);
  // Both sides share their random numbers: where they hardly differ, so do their estimates.
  RadianceBeside beside(context, view, mesh.of_texture(), viewer.bounces,
                        viewer.key.at(Purpose::kEdgeSide, viewer.bounces), rays, part);
  if (mesh.of_texture()) {
    if (!start_beside_texture(context, around, view, ray, beside, rays)) return false;
    difference = beside.difference();
    return true;
  }
  fetch_faces(context.scene, around);
  ray.skip_faces = around.all;
  if (part.region && around.near.empty()) {
    const auto emitter = part.regions->flat_faces(*part.region);
    const auto is_of_emitter = [&](FaceRef f) {
      return !emitter.empty() && f.shape == emitter[0].shape;
    };
    if (std::all_of(around.faces.begin(), around.faces.end(), is_of_emitter))
      ray.skip_faces = emitter;
  }
  fetch_corners(context.scene, around);  // while the ray is traced
  Hit behind;
  ++rays.closest;
  const bool found =
      closest_at_edge(context.tracer, context.scene, around, view.y, view.distance, ray, behind);
  if (found && behind.t < view.distance) return false;

  const Sides sides = nearest_faces(context, mesh, view, ray.skip_emitters);
  for (int i = 0; i < 2; ++i) {
    if (const auto& side = i == 0 ? sides.negative : sides.positive) {
      beside.start_on_face(i, around, *side);
    } else if (found) {
      beside.start_behind(i, behind.face);
    } else {
      beside.escape(i);
    }
  }
  difference = beside.difference();
  return true;
}

// The edge as it is seen from another point of the same line.
bool view_from(const Vec3d& p, EdgeView& view) {
  const Vec3d w = view.y - p;
  view.p = p;
  view.distance = length(w);
  if (view.distance == 0) return false;
  view.omega = w / view.distance;
  view.side = cross(view.x0 - p, view.x1 - p);
  return true;
}

}  // namespace

bool edge_difference(const PathContext& context, const EdgeMesh& mesh, const EdgeView& view,
                     const EdgeViewer& viewer, RayCount& rays, Rgb<double>& difference) {
  Ray ray{view.p, view.omega};
  ray.t_min = viewer.t_min;
  ray.t_max = viewer.t_max;
  ray.start = viewer.start;
  ray.skip_emitters = viewer.bounces == 0 && context.scene.hide_emitters;
  if (difference_in_sight(context, mesh, view, ray, viewer, rays, difference)) return true;
  // What regions emit is seen directly alone, and is no part of what comes straight through.
  if (!context.straight_ways || viewer.part.region) return false;
  const FacesAround around = mesh.around(view.id.edge);
  ray.skip_faces = around.all;
  StraightWay way{view.p, viewer.start, viewer.bounces};
  EdgeView beyond = view;
  Hit hit;
  while (++rays.closest, context.tracer.closest(ending_on(ray, {}, beyond.distance), hit)) {
    if (!way.pass(context, hit.face, beyond.omega) || !view_from(way.from, beyond)) return false;
    ray = {beyond.p, beyond.omega};
    ray.start = way.start;
    ray.skip_faces = around.all;
    const EdgeViewer straight{way.start, way.bounces, viewer.key};
    if (difference_in_sight(context, mesh, beyond, ray, straight, rays, difference)) {
      difference = difference * way.share;
      return true;
    }
  }
  return false;
}

}  // namespace limn
