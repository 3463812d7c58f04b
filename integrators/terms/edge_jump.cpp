// The jump of radiance across an edge: which faces lie on either side, and a path from each.
#include "integrators/terms/edge_jump.h"

#include <algorithm>

#include "integrators/terms/near_faces.h"
#include "limn/core/face_copies.h"

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
  if (overlap(context.tracer, a, b)) return is_met_first(context.scene, a.face, b.face, omega);
  return slope_a < slope_b;
}

// Bring what nearest_faces reads into the cache: which corners faces have, and where these lie.
void fetch_faces(const Scene& scene, const FacesAround& around) {
  for (const FaceRef face : around.faces) {
    __builtin_prefetch(&scene.shape(face.shape).mesh.face(face.face));
  }
}
void fetch_corners(const Scene& scene, const FacesAround& around) {
  for (const FaceRef face : around.faces) {
    const Mesh& mesh = scene.shape(face.shape).mesh;
    for (const uint32_t vertex : mesh.face(face.face)) __builtin_prefetch(&mesh.positions[vertex]);
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
      visit(side, incidence.rim, alpha > 0, dot(side.into, across) / std::fabs(alpha));
    });
  };
  RimOrder order;
  if (!around.incidences.empty()) {
    for_every_seen_side([&](const FaceSide&, uint8_t rim, bool positive, double slope) {
      order.add(rim, positive, slope);
    });
  }
  Sides sides;
  double slopes[2] = {0, 0};
  const uint8_t own = mesh.edge(view.id.edge).rim;
  for_every_seen_side([&](const FaceSide& side, uint8_t rim, bool positive, double slope) {
    for (const bool place : {false, true}) {
      if (!order.is_seen(rim, positive, own, place)) continue;
      auto& nearest = place ? sides.positive : sides.negative;
      if (nearest && !hides(context, side, slope, *nearest, slopes[place], view.omega)) continue;
      nearest = side;
      slopes[place] = slope;
    }
  });
  return sides;
}

}  // namespace

bool edge_jump(const PathContext& context, const EdgeMesh& mesh, const EdgeView& view,
               FaceRef start, double t_min, double t_max, int bounces, const Rng& key,
               RayCount& rays, Rgb<double>& jump, const RadiancePart& part,
               const FaceRef* known_behind) {
  Ray ray{view.p, view.omega};
  ray.t_min = t_min;
  ray.t_max = t_max;
  ray.start = start;
  const FacesAround around = mesh.around(view.id.edge);
  fetch_faces(context.scene, around);
  ray.skip_faces = around.all;
  if (part.region && around.near.empty()) {
    const auto lamp = part.regions->flat_faces(*part.region);
    const auto is_of_lamp = [&](FaceRef f) { return !lamp.empty() && f.shape == lamp[0].shape; };
    if (std::all_of(around.faces.begin(), around.faces.end(), is_of_lamp)) ray.skip_faces = lamp;
  }
  ray.skip_emitters = bounces == 0 && context.scene.hide_emitters;
  fetch_corners(context.scene, around);  // while the ray is traced
  Hit behind;
  bool found;
  if (known_behind) {
    behind.face = *known_behind;
    found = known_behind->shape.valid();
  } else {
    ++rays.closest;
    found =
        closest_at_edge(context.tracer, context.scene, around, view.y, view.distance, ray, behind);
    if (found && behind.t < view.distance) return false;
  }

  NoVisitor nothing;
  PathTracer<double, NoVisitor> path(context, rays, nothing);
  // Both sides share their random numbers: where they hardly differ, so do their estimates.
  const Rng side_key = key.at(Purpose::kEdgeSide, bounces);
  const Vec3d wi = -view.omega;
  const auto leaving = [&](const SurfacePoint<double>& surface, EdgeStart* at) {
    if (part.region) return part.regions->emission(*part.region, surface, wi);
    const Rgb<double> all = path.from_surface(surface, wi, bounces, side_key, at);
    return part.regions ? all - part.regions->emission(surface, wi) : all;
  };
  const auto radiance = [&](const std::optional<FaceSide>& side) {
    if (side) {
      const FaceRef face = side->face;
      const auto corners = face_corners<double>(context.scene.shape(face.shape).mesh, face.face);
      const Vec3d n = cross(corners[1] - corners[0], corners[2] - corners[0]);
      EdgeStart edge{around, view.x0, view.x1, *side};
      return leaving(surface_on_ray(context.scene, face, view.y, n), &edge);
    }
    if (found) {
      return leaving(surface_on_ray(context.scene, behind.face, view.p, view.omega), nullptr);
    }
    if (part.region) return part.regions->escaped(*part.region, view.omega);
    const Rgb<double> all = path.escaped(view.omega, bounces);
    return part.regions ? all - part.regions->escaped(view.omega) : all;
  };
  const Sides sides = nearest_faces(context, mesh, view, ray.skip_emitters);
  jump = radiance(sides.negative) - radiance(sides.positive);
  return true;
}

}  // namespace limn
