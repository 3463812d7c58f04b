#pragma once
// What a viewer sees by way of a chain of flat mirrors (flat_mirrors.h).
#include "integrators/edges/flat_mirrors.h"
#include "integrators/paths/path_context.h"
#include "limn/core/ray_tracer.h"
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

// Follows a ray along the chain; false where it meets something else first, a mirror of the chain
// does not reflect it as one, or the path is too long. bounces: how often the path has scattered,
// the viewer included.
bool follow_mirrors(const PathContext& context, const FlatMirrors::Chain& chain, Ray ray,
                    int bounces, RayCount& rays, MirrorSight& sight);

}  // namespace limn
