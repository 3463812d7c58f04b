#pragma once
// What a viewer sees by way of a chain of flat mirrors, or through panes (flat_mirrors.h).
#include <algorithm>
#include <optional>

#include "integrators/edges/flat_mirrors.h"
#include "integrators/paths/straight_way.h"
#include "limn/core/check.h"
#include "limn/core/ray_tracer.h"
#include "limn/core/shading.h"
#include "limn/integrators/run.h"

namespace limn {

struct MirrorSight {
  MirrorFaces by;
  Vec3d from;         // on the last mirror
  Rgb<double> share;  // of what arrives there, that the viewer gets
  int bounces = 0;    // of the path, the mirrors included
  FaceRef last() const { return by.faces[by.count - 1]; }
};

// The ray from the viewer that, reflected by the chain, becomes the straight ray from `image`
// through y. Its direction is unit.
Ray unfolded(const FlatMirrors& mirrors, const FlatMirrors::Chain& chain, const Vec3d& image,
             const Vec3d& y);

// Which smooth ray goes through a surface and is refracted, if one is.
template <class S>
std::optional<int> refracted_ray(const Scattering<S>& scattering) {
  const int count = std::min(scattering.shares().count, kMostSmoothRays);
  for (int k = 0; k < count; ++k) {
    const auto ray = scattering.smooth_ray(k);
    const Vec3d wo = value(ray.wo);
    if (!ray.total && scattering.passes(wo) && !goes_straight(value(scattering.wi()), wo)) return k;
  }
  return std::nullopt;
}

// Carries a ray on to the other side of the faces' planes, which refract it.
template <class S>
void refract_ray(const Scene& scene, const MirrorFaces& by, Vec3<S>& origin, Vec3<S>& direction) {
  for (const FaceRef face : by.all()) {
    const auto surface = surface_on_ray<S>(scene, face, origin, direction);
    const Scattering<S> scattering(surface, -direction, scene.shading);
    const auto refracted = refracted_ray(scattering);
    CHECK(refracted);
    origin = surface.p;
    direction = scattering.smooth_ray(*refracted).wo;
  }
}

// Follows a ray along the chain; false where it meets something else first, a mirror of the chain
// does not reflect it as one, or the path is too long. bounces: how often the path has scattered,
// the viewer included.
bool follow_mirrors(const PathContext& context, const FlatMirrors::Chain& chain, Ray ray,
                    int bounces, RayCount& rays, MirrorSight& sight);

}  // namespace limn
