// Rays along chains of flat mirrors.
#include "integrators/terms/mirror_sight.h"

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

namespace {

// Goes straight on, until the ray meets a face of the mirror.
bool meet_mirror(const PathContext& context, uint32_t mirror, Ray& ray, RayCount& rays,
                 FaceRef& face, MirrorSight& sight) {
  StraightWay way{ray.origin, ray.start, sight.bounces, sight.share};
  Hit hit;
  while (++rays.closest, context.tracer.closest(ray, hit)) {
    if (context.flat_mirrors->of(hit.face) == mirror) {
      face = hit.face;
      sight.share = way.share;
      sight.bounces = way.bounces;
      return true;
    }
    if (!context.straight_ways || !way.pass(context, hit.face, ray.direction)) return false;
    ray = {way.from, ray.direction};
    ray.start = way.start;
  }
  return false;
}

// What is refracted there, of weight 0 if nothing is.
SmoothRay<double> through(const Scattering<double>& scattering) {
  const auto k = refracted_ray(scattering);
  return k ? scattering.smooth_ray(*k) : SmoothRay<double>{};
}

// What is reflected as by a mirror.
SmoothRay<double> back(const Scattering<double>& scattering, const SurfacePoint<double>& surface) {
  const Vec3d wi = scattering.wi(), n = scattering.front() ? surface.n_g : -surface.n_g;
  SmoothRays<double> smooth;
  const int count = std::min(scattering.shares().count, kMostSmoothRays);
  for (int i = 0; i < count; ++i) smooth[i] = scattering.smooth_ray(i);
  return {n * (2 * dot(n, wi)) - wi,
          mirrored_share({smooth.data(), static_cast<size_t>(count)}, n, wi)};
}

}  // namespace

bool follow_mirrors(const PathContext& context, const FlatMirrors::Chain& chain, Ray ray,
                    int bounces, RayCount& rays, MirrorSight& sight) {
  const Scene& scene = context.scene;
  sight.by = {};
  sight.by.through = chain.through;
  sight.share = grey(1.0);
  sight.bounces = bounces;
  for (uint32_t k = 0; k < chain.count; ++k) {
    const int to_come = static_cast<int>(chain.count - k);
    if (scene.max_depth >= 0 && sight.bounces + to_come >= scene.max_depth) return false;
    FaceRef face;
    if (!meet_mirror(context, chain.mirrors[k], ray, rays, face, sight)) return false;
    const auto surface = surface_on_ray<double>(scene, face, ray.origin, ray.direction);
    const Scattering<double> scattering(surface, -ray.direction, scene.shading);
    if (scattering.black() || !scattering.is_smooth()) return false;
    const SmoothRay<double> on = chain.through ? through(scattering) : back(scattering, surface);
    sight.share = sight.share * on.weight;
    if (is_black(sight.share)) return false;
    sight.by.faces[sight.by.count++] = face;
    sight.from = surface.p;
    ++sight.bounces;
    ray = {surface.p, on.wo};
    ray.start = surface.start();
  }
  return true;
}

}  // namespace limn
