#pragma once
// The path tracer's paths, side by side: from rays or surfaces to their ends. Included by each .cpp
// that follows paths; it brings all that path.h declares.
//
// With x_0 the surface where a path starts, w_i a direction drawn at x_i with density p_i, f_i the
// scattering function times cosine there, and the throughput T_k = f_0 / p_0 ... f_(k-1) / p_(k-1),
// one path estimates
//   L = L_e(x_0) + sum over k of T_k (E_k + f_k / p_k m_k L_e(x_(k+1))),
//   E_k = f_k(l) / q_k(l) n_k L_e(l),
// l a direction that light sampling draws with density q_k, and m_k = p^2 / (p^2 + q^2) and
// n_k = q^2 / (p^2 + q^2) the weights of the power heuristic at either's direction (n_k = 1 for a
// delta light). w, l, p, q, m, n are constants when S carries derivatives.
//
// Paths are followed side by side where there are several: each waits for its own divisions, roots
// and reads, and a processor fills such gaps with the work of the next. A path's own steps, and so
// its bits, do not depend on what goes beside it. With derivatives 1, 3 and 8 side by side took
// 1.05, 1.02 and 1.01 of the time that a gradient of the demo had taken path by path. Images with
// 32 and 64 took 0.97 to 0.98 of the time with 16: fewer lanes stay empty as paths end.
#include <algorithm>

#include "integrators/paths/path.h"
#include "integrators/paths/path_arrive.h"
#include "integrators/paths/path_colours.h"
#include "integrators/paths/path_light_value.h"
#include "integrators/paths/path_lights.h"
#include "integrators/paths/path_rays.h"
#include "integrators/paths/path_smooth.h"
#include "integrators/paths/path_vertices.h"
#include "integrators/paths/path_wide.h"
#include "limn/core/check.h"

namespace limn {

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::follow_rays(std::span<const StartRay<Place>> rays,
                                                std::span<Walk> walks) {
  DCHECK_LE(walks.size(), kMostWalks);
  Walk* started[kMostWalks];
  for (size_t i = 0; i < walks.size(); ++i) started[i] = &walks[i];
  trace_together(
      {started, walks.size()},
      [&](const Walk& walk, RayQuery& query) {
        query.ray = rays[static_cast<size_t>(&walk - walks.data())].ray;
        return true;
      },
      [&](std::span<RayQuery> queries) {
        rays_.closest += queries.size();
        c_.tracer.closest_each(queries);
      },
      [&](Walk& walk, const RayQuery& query) { take_hit(walk, query); });
  for (const Walk& walk : walks) fetch_corners(walk);
  follow_seen(rays, walks);
}

template <class S, class Visitor>
inline Rgb<S> PathTracer<S, Visitor>::escaped(const Vec3<Place>& direction, int bounces) const {
  if (!shows_sky(bounces)) return {};
  return environment_radiance<S>(*c_.scene.environment, detail::in_scalar<S>(direction));
}

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::place(Walk& walk, const SurfacePoint<Place>& surface,
                                          const Vec3<Place>& wi) const {
  walk.surface = surface;
  place(walk, wi);
}

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::place(Walk& walk, const Vec3<Place>& wi) const {
  walk.wi = wi;
  walk.sums.radiance = detail::emission<S>(walk.surface, value(wi), c_.scene.shading);
}

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::follow(std::span<Walk* const> walks) {
  DCHECK_LE(walks.size(), kMostWalks);
  Walk* going[kMostWalks];
  size_t count = walks.size();
  std::copy(walks.begin(), walks.end(), going);
  const auto keep = [&](const auto& step) {
    size_t kept = 0;
    for (size_t i = 0; i < count; ++i) {
      Walk* const walk = going[i];
      going[kept] = walk;
      kept += guarded(*walk, [&] { return step(*walk); });
    }
    count = kept;
  };
  while (count > 0) {
    if constexpr (kPlain) {
      if (count > 1) fetch_textures({going, count});
      if (wide_) place_lights_wide({going, count});
    }
    keep([&](Walk& walk) { return begin_vertex(walk); });
    draw_lights({going, count});
    shine({going, count});
    keep([](const Walk& walk) { return !walk.failed; });
    draw_numbers({going, count});
    Walk* turned[kMostWalks];
    const size_t turns = turn_smoothly(going, count, turned);
    if constexpr (kPlain) {
      if (scatters_wide_) count = scatter_wide({going, count});
    }
    if (!scatters_wide_) {
      keep([&](Walk& walk) { return choose_direction(walk); });
      keep([&](Walk& walk) { return scatter(walk); });
    }
    std::copy_n(turned, turns, going + count);
    count += turns;
    Walk* leaving[kMostWalks];
    size_t left = 0;
    next_hits({going, count});
    keep([&](Walk& walk) {
      leaving[left] = &walk;
      left += !walk.found && !walk.failed;
      return walk.found;
    });
    for (size_t i = 0; i < count; ++i) fetch_corners(*going[i]);
    escape({leaving, left});
    keep([&](Walk& walk) { return arrive(walk); });
  }
}

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::follow_seen(std::span<const StartRay<Place>> rays,
                                                std::span<Walk> walks) {
  DCHECK_LE(walks.size(), kMostWalks);
  Walk* going[kMostWalks];
  size_t count = 0;
  const auto begin = [&] {
    for (size_t i = 0; i < walks.size(); ++i) {
      Walk& walk = walks[i];
      if (walk.failed) continue;
      const Vec3<Place>&origin = rays[i].origin, &direction = rays[i].direction;
      if (walk.found) {
        if constexpr (!std::is_same_v<Visitor, NoVisitor>) walk.step.from = value(origin);
        renew(walk.surface,
              [&] { return surface_on_ray<Place>(c_.scene, walk.hit.face, origin, direction); });
        place(walk, -direction);
        going[count++] = &walk;
      } else if (!wide_) {
        walk.sums.radiance = escaped(direction, walk.bounces);
      }
    }
  };
  if constexpr (kPlain) {
    if (wide_) see_sky_wide(rays, walks, begin);
  }
  if (!wide_) begin();
  follow({going, count});
}

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::split(Walk& walk, int more) {
  walk.throughput = walk.throughput * (1.0 / more);
  walk.copies *= more;
  for (int i = 1; i < more; ++i) {
    // Beyond the indices of paths that share no vertex.
    const int index = kMostPaths * (walk.bounces + 1) + i;
    Walk copy = walk;
    copy.key = walk.key.copy(Purpose::kPathCopy, index);
    copy.again = true;
    follow_one(copy);
    if (copy.failed) throw UntraceableRay();
    walk.sums = copy.sums;
  }
}

}  // namespace limn
