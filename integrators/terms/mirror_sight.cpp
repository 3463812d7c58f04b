// Rays along chains of flat mirrors.
#include "integrators/terms/mirror_sight.h"

#include <algorithm>

#include "limn/core/shading.h"

namespace limn {

Ray unfolded(const FlatMirrors& mirrors, const FlatMirrors::Chain& chain, const Vec3d& image,
             const Vec3d& y) {
  Ray ray{image, normalize(y - image)};
  for (uint32_t k = chain.count; k-- > 0;) {
    const MirrorPlane<double> plane = mirrors.plane(chain.mirrors[k]);
    ray.origin = plane.image(ray.origin);
    ray.direction = plane.turned(ray.direction);
  }
  return ray;
}

bool follow_mirrors(const PathContext& context, const FlatMirrors::Chain& chain, Ray ray,
                    int bounces, RayCount& rays, MirrorSight& sight) {
  const Scene& scene = context.scene;
  if (scene.max_depth >= 0 && bounces + static_cast<int>(chain.count) >= scene.max_depth)
    return false;
  sight.by = {};
  sight.share = grey(1.0);
  sight.bounces = bounces;
  for (uint32_t k = 0; k < chain.count; ++k) {
    Hit hit;
    ++rays.closest;
    if (!context.tracer.closest(ray, hit)) return false;
    if (context.flat_mirrors->of(hit.face) != chain.mirrors[k]) return false;
    const auto surface = surface_on_ray<double>(scene, hit.face, ray.origin, ray.direction);
    const Scattering<double> scattering(surface, -ray.direction, scene.shading);
    if (scattering.black() || !scattering.is_smooth()) return false;
    const Vec3d wi = scattering.wi();
    SmoothRays<double> smooth;
    const int count = std::min(scattering.shares().count, kMostSmoothRays);
    for (int i = 0; i < count; ++i) smooth[i] = scattering.smooth_ray(i);
    const Vec3d n = scattering.front() ? surface.n_g : -surface.n_g;
    sight.share = sight.share * mirrored_share({smooth.data(), static_cast<size_t>(count)}, n, wi);
    if (is_black(sight.share)) return false;
    sight.by.faces[sight.by.count++] = hit.face;
    sight.from = surface.p;
    ++sight.bounces;
    ray = {surface.p, n * (2 * dot(n, wi)) - wi};
    ray.start = surface.start();
  }
  return true;
}

}  // namespace limn
