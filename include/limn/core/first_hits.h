#pragma once
// What rays of the caller hit first.
#include <vector>

#include "limn/core/ray_tracer.h"

namespace limn {

struct FirstHit {
  FaceRef face;    // none for a miss
  double t = 0;    // distance from the origin [scene units]; infinite for a miss
  Vec3d normal;    // of the face, unit, on its outer side
  double uv[2]{};  // barycentric: position = (1 - u - v) a + u b + v c of the face's corners
};

// The closest hit of each ray, from distance 0 on; directions need not be unit. Builds a ray
// tracer. InputError for other counts, and for a ray that is not finite or has no direction, by its
// index.
std::vector<FirstHit> first_hits(const Scene& scene, const std::vector<Vec3d>& origins,
                                 const std::vector<Vec3d>& directions, int threads);

}  // namespace limn
