// First hits of rays that a caller gives.
#include "limn/core/ray_tracer.h"

#include "limn/core/error.h"
#include "limn/core/parallel.h"

namespace limn {

namespace {

FirstHit describe(const Scene& scene, const Ray& ray, const Hit& hit) {
  FirstHit first;
  first.face = hit.face;
  first.t = hit.t;
  const auto c = face_corners<double>(scene.shape(hit.face.shape).mesh, hit.face.face);
  const Vec3d across = cross(c[1] - c[0], c[2] - c[0]);
  first.normal = normalize(across);
  const Vec3d p = ray.origin + ray.direction * hit.t;
  const double area = length_squared(across);
  first.uv[0] = dot(cross(p - c[0], c[2] - c[0]), across) / area;
  first.uv[1] = dot(cross(c[1] - c[0], p - c[0]), across) / area;
  return first;
}

// ask(ray, hit) for each.
template <class Ask>
void answer(std::span<RayQuery> queries, const Ask& ask) {
  for (RayQuery& query : queries) {
    try {
      query.found = ask(query.ray, query.hit);
    } catch (const UntraceableRay&) {
      query.failed = true;
    }
  }
}

}  // namespace

void RayTracer::closest_each(std::span<RayQuery> queries) const {
  answer(queries, [&](const Ray& ray, Hit& hit) { return closest(ray, hit); });
}

void RayTracer::occluded_each(std::span<RayQuery> queries) const {
  answer(queries, [&](const Ray& ray, Hit&) { return occluded(ray); });
}

std::vector<FirstHit> first_hits(const Scene& scene, const std::vector<Vec3d>& origins,
                                 const std::vector<Vec3d>& directions, int threads) {
  if (origins.size() != directions.size()) {
    throw InputError(std::to_string(origins.size()) + " origins of rays, but " +
                     std::to_string(directions.size()) + " directions");
  }
  std::vector<Ray> rays(origins.size());
  for (size_t i = 0; i < rays.size(); ++i) {
    rays[i] = {.origin = origins[i], .direction = normalize(directions[i])};
    if (is_traceable(rays[i])) continue;
    throw InputError("ray " + std::to_string(i) +
                     " is not finite, starts too far away or has no direction");
  }
  const int count = thread_count(threads);
  const auto tracer = make_embree_tracer(scene, count);
  FirstHit miss;
  miss.t = std::numeric_limits<double>::infinity();
  std::vector<FirstHit> hits(rays.size(), miss);
  constexpr size_t kAtOnce = 4096;
  parallel_for((rays.size() + kAtOnce - 1) / kAtOnce, count, [&](size_t part) {
    const size_t end = std::min(rays.size(), (part + 1) * kAtOnce);
    for (size_t i = part * kAtOnce; i < end; ++i) {
      Hit hit;
      if (tracer->closest(rays[i], hit)) hits[i] = describe(scene, rays[i], hit);
    }
  });
  return hits;
}

}  // namespace limn
