// Rays through surfaces that let light pass straight on.
#include "integrators/paths/straight_way.h"

#include <algorithm>

#include "limn/core/shading.h"

namespace limn {

bool has_straight_ways(const Scene& scene) {
  const Vec3d n{0, 0, 1}, wi{0.6, 0, 0.8};
  return std::ranges::any_of(scene.shapes, [&](const Shape& shape) {
    for (const bool front : {true, false}) {
      const Bsdf* const side = shape.bsdf->side(front);
      if (!side || !side->lobes().smooth || !side->lobes().through) continue;
      SmoothRays<double> rays;
      const auto count = static_cast<size_t>(side->smooth_rays(n, wi, rays));
      for (const auto& ray : std::span(rays).first(count)) {
        if (goes_straight(wi, ray.wo)) return true;
      }
    }
    return false;
  });
}

bool StraightWay::pass(const PathContext& context, FaceRef face, const Vec3d& omega) {
  const Scene& scene = context.scene;
  if (!face.shape.valid() || !scene.shape(face.shape).bsdf->lobes().through) return false;
  if (scene.max_depth >= 0 && bounces + 1 >= scene.max_depth) return false;
  const auto surface = surface_on_ray<double>(scene, face, from, omega);
  const Scattering<double> scattering(surface, -omega, scene.shading);
  if (scattering.black() || !scattering.is_smooth()) return false;
  Rgb<double> passed;
  const int count = std::min(scattering.shares().count, kMostSmoothRays);
  for (int k = 0; k < count; ++k) {
    const SmoothRay<double> ray = scattering.smooth_ray(k);
    if (goes_straight(scattering.wi(), ray.wo)) passed = passed + ray.weight;
  }
  share = share * passed;
  if (is_black(share)) return false;
  const auto& x = surface.on_face;
  from = is_lifted(scene, face.shape) ? Vec3d{x[0], x[1], x[2]} : surface.p;
  start = face;
  ++bounces;
  return true;
}

void StraightWay::go_on(Ray& ray) const {
  // Rounding may put a face beyond the end.
  ray.t_max = std::max(0.0, ray.t_max - length(from - ray.origin));
  ray.origin = from;
  ray.start = start;
  ray.t_min = 0;
}

std::optional<Rgb<double>> share_along(const PathContext& context, Ray ray, int bounces,
                                       RayCount& rays) {
  if (!context.straight_ways) {
    ++rays.shadow;
    if (context.tracer.occluded(ray)) return std::nullopt;
    return grey(1.0);
  }
  StraightWay way{ray.origin, ray.start, bounces};
  Hit hit;
  while (++rays.closest, context.tracer.closest(ray, hit)) {
    if (!way.pass(context, hit.face, ray.direction)) return std::nullopt;
    way.go_on(ray);
    ray.skip_emitters = false;
  }
  if (context.scene.max_depth >= 0 && way.bounces + 1 >= context.scene.max_depth)
    return std::nullopt;
  return way.share;
}

}  // namespace limn
