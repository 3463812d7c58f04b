#pragma once
// The path tracer's rays between vertices, also those that start on an edge, and what is brought
// into the cache for them. Included by path_follow.h.
#include "integrators/paths/path.h"
#include "limn/core/check.h"
#include "limn/core/prefetch.h"

namespace limn {

// The next surface from a path vertex; hit.t = 0 for a neighbour that blocks at the edge itself.
template <class S, class Visitor>
inline bool PathTracer<S, Visitor>::next_hit(Walk& walk) {
  Ray ray{value(walk.surface.p), walk.wo};
  ray.start = walk.surface.start();
  if (EdgeStart* edge = walk.start_edge()) {
    if (const auto side = blocked_at_start(walk, walk.wo)) {
      edge->start = *side;
      walk.hit = {side->face, 0};
      return true;
    }
    ray.skip_faces = edge->around.all;
    ++rays_.closest;
    return closest_at_edge(c_.tracer, c_.scene, edge->around, ray.origin, 0, ray, walk.hit);
  }
  ++rays_.closest;
  // Where no shape emits, what hides the environment from the last scattering need not be known.
  const bool any = walk.last && !c_.lights.on_shapes();
  if (any) return c_.tracer.occluded(ray);
  const bool found = c_.tracer.closest(ray, walk.hit);
  if (found) fetch_face(walk.hit.face);
  return found;
}

// The next surfaces from path vertices: sets what is found.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::next_hits(std::span<Walk* const> walks) {
  trace_together(
      walks,
      [&](Walk& walk, RayQuery& query) {
        // Where no shape emits, what hides the environment from the last scattering need not be
        // known.
        if (walk.start_edge() || (walk.last && !c_.lights.on_shapes())) {
          walk.found = false;
          guarded(walk, [&] { return walk.found = next_hit(walk); });
          return false;
        }
        // Copies of what has just been written in small parts would wait for it.
        query.ray.origin = value(walk.surface.p);
        query.ray.direction = walk.wo;
        query.ray.start = walk.surface.start();
        query.normal = walk.surface.n_g;
        return true;
      },
      [&](std::span<RayQuery> queries) {
        rays_.closest += queries.size();
        c_.tracer.closest_each(queries);
      },
      [&](Walk& walk, const RayQuery& query) { take_hit(walk, query); });
}

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::take_hit(Walk& walk, const RayQuery& query) const {
  walk.failed = query.failed;
  walk.found = query.found;
  walk.hit = query.hit;
  if (walk.found) fetch_face(walk.hit.face);
}

// Traces a ray for each: put(walk, query) writes it, or returns false where there is none;
// trace(queries) does it, read(walk, query) takes what comes of it.
template <class S, class Visitor>
template <class Put, class Trace, class Read>
inline void PathTracer<S, Visitor>::trace_together(std::span<Walk* const> walks, const Put& put,
                                                   const Trace& trace, const Read& read) {
  RayQuery queries[RayTracer::kTogether];
  Walk* asking[RayTracer::kTogether];
  size_t count = 0;
  const auto answer = [&] {
    trace(std::span<RayQuery>(queries, count));
    for (size_t i = 0; i < count; ++i) read(*asking[i], queries[i]);
    count = 0;
  };
  for (Walk* const walk : walks) {
    if (!put(*walk, queries[count])) continue;
    asking[count++] = walk;
    if (count == RayTracer::kTogether) answer();
  }
  if (count > 0) answer();
}

// The side of a face around walk.start_edge() that the ray meets at once, if any. Below its own
// face a ray that is reflected leaves a smooth surface (surface_point.h), and meets none of them.
template <class S, class Visitor>
inline std::optional<FaceSide> PathTracer<S, Visitor>::blocked_at_start(
    const Walk& walk, const Vec3d& direction) const {
  const Vec3d& n = walk.surface.n_g;
  const bool below = (dot(n, direction) > 0) != (dot(n, value(walk.wi)) > 0);
  if (below && !walk.scattering->bsdf().lobes().through) return {};
  return blocked_at_edge(c_.scene, c_.tracer, *walk.start_edge(), direction);
}

// Onto the face that a ray along `direction` meets at once.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::move_along_edge(SurfacePoint<Place>& surface, FaceRef face,
                                                    const Vec3d& direction) const {
  // Only primal paths start on edges, so the point itself does not change.
  const Vec3<Place> p = surface.p;
  const auto corners = face_corners<double>(c_.scene.shape(face.shape).mesh, face.face);
  Vec3d n = cross(corners[1] - corners[0], corners[2] - corners[0]);
  if (dot(n, direction) < 0) n = -n;
  surface = surface_on_ray<Place>(c_.scene, face, p, Vec3<Place>{n.x, n.y, n.z});
}

// Brings what says where a face lies into the cache.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::fetch_face(FaceRef face) const {
  const Mesh& mesh = c_.scene.shape(face.shape).mesh;
  prefetch(&mesh.faces[face.face.index()]);
  if (!mesh.normal_ids.empty()) prefetch(&mesh.normal_ids[face.face.index()]);
  if (!mesh.uv_ids.empty()) prefetch(&mesh.uv_ids[face.face.index()]);
}

// The same of its corners; it is known then.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::fetch_corners(const Walk& walk) const {
  if (!walk.found || (walk.last && !c_.lights.on_shapes())) return;
  const FaceRef face = walk.hit.face;
  const Mesh& mesh = c_.scene.shape(face.shape).mesh;
  for (const uint32_t vertex : mesh.face(face.face)) {
    prefetch(&mesh.positions[vertex]);
    if constexpr (!kPlain) {
      if (!mesh.position_tangents.empty()) mesh.position_tangents.fetch(vertex);
    }
  }
  if (mesh.normal_source != NormalSource::kFace) detail::fetch_shading<Place>(mesh, face.face);
  if (mesh.textured && !mesh.uv_ids.empty()) {
    for (const uint32_t i : mesh.uv_ids[face.face.index()]) prefetch(&mesh.uv_places[i]);
  }
}

// Brings the texels into the cache that paths read where they will scatter.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::fetch_textures(std::span<Walk* const> walks) const {
  for (const Walk* const walk : walks) {
    const SurfacePoint<Place>& surface = walk->surface;
    const Mesh& mesh = surface.shape->mesh;
    if (!mesh.textured || is_complete(walk->bounces)) continue;
    const Bsdf* const side = surface.shape->bsdf->side(dot(surface.n_g, value(walk->wi)) > 0);
    if (!side || side->texture_count() == 0) continue;
    side->fetch(
        texture_point<double>(mesh, surface.face.face, {value(surface.b[0]), value(surface.b[1])}));
  }
}

// Where rays along walk.wo leave the scene, which has an environment; brings that into the cache.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::find_sky(std::span<Walk* const> walks) const {
  const Environment& environment = *c_.lights.drawn_environment();
  if (!wide_) {
    for (Walk* const walk : walks) walk->sky = environment.find(walk->wo);
    return;
  }
  Environment::Found found[kMostWalks];
  for (size_t i = 0; i < walks.size(); ++i) found[i] = {&walks[i]->wo, &walks[i]->sky};
  environment.find_each({found, walks.size()});
}

// A float's rounding before the light, so that neighbours of the chosen face do not hide the point.
inline double before(const LightSample& light) { return light.distance * (1 - 0x1p-20); }

// How many see the lights that were drawn: they are put first.
template <class S, class Visitor>
inline size_t PathTracer<S, Visitor>::find_unshadowed(std::span<Walk*> walks) {
  size_t seen = 0;
  trace_together(
      walks,
      [&](Walk& walk, RayQuery& query) {
        if (walk.start_edge() || walk.beside_edge || walk.two_sided) {
          walks[seen] = &walk;
          seen += guarded(walk, [&] { return !shadowed(walk); });
          return false;
        }
        const LightSample& light = *walk.light;
        const FaceRef start = walk.surface.start();
        if (light.face == start) return false;
        query.ray.origin = value(walk.surface.p);
        query.ray.direction = light.wo;
        query.ray.t_max = before(light);
        query.ray.start = start;
        query.ray.end = light.face.value_or(FaceRef{});
        query.normal = walk.surface.n_g;
        return true;
      },
      [&](std::span<RayQuery> queries) {
        rays_.shadow += queries.size();
        c_.tracer.occluded_each(queries);
      },
      [&](Walk& walk, const RayQuery& query) {
        walk.failed = query.failed;
        walks[seen] = &walk;
        seen += !query.failed && !query.found;
      });
  return seen;
}

template <class S, class Visitor>
inline bool PathTracer<S, Visitor>::shadowed(const Walk& walk) {
  const LightSample& light = *walk.light;
  FaceRef start = walk.surface.start();
  const EdgeStart* edge = walk.start_edge();
  Ray ray{value(walk.surface.p), light.wo};
  if (walk.two_sided && walk.beyond) {
    const auto other = beyond(c_.scene, value(walk.surface), value(walk.wi));
    ray.origin = other.p;
    start = other.start();
    if (other.lifted) edge = nullptr;
  }
  if (light.face == start) return true;
  ray.start = start;
  ray.end = light.face.value_or(FaceRef{});
  // Beside an edge a shadow may end to the very rounding, if the light has no extent.
  const DeltaLight* delta = walk.beside_edge ? light.light->delta() : nullptr;
  if (delta) {
    CHECK(c_.viewpoints);
    ray.direction = c_.viewpoints->of(*delta).towards(ray.origin);
  }
  if (edge) {
    if (blocked_at_start(walk, ray.direction)) return true;
    ray.skip_faces = edge->around.all;
  }
  ray.t_max = before(light);
  ++rays_.shadow;
  if (edge) return occluded_from_edge(c_.tracer, c_.scene, edge->around, ray);
  return c_.tracer.occluded(ray);
}

}  // namespace limn
