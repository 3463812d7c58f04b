#pragma once
// Null interactions: `mask`, `null` and `thindielectric` transmit light without a deflection. What
// lies beyond keeps its position and is attenuated.
#include <optional>

#include "integrators/paths/path_context.h"
#include "limn/integrators/run.h"

namespace limn {

// Whether light passes straight through some surface of the scene.
bool has_straight_ways(const Scene& scene);

// Whether a smooth ray goes straight on.
inline bool goes_straight(const Vec3d& wi, const Vec3d& wo) { return wo == -wi; }

// How far a viewer sees in one direction.
struct StraightWay {
  Vec3d from;                     // from where, on
  FaceRef start = {};             // this face, if any
  int bounces = 0;                // of the path, what it has passed included
  Rgb<double> share = grey(1.0);  // the throughput from there to the viewer

  // Goes on through a face that the ray from there along the unit direction omega meets; false if
  // nothing passes it, or the path is too long.
  bool pass(const PathContext& context, FaceRef face, const Vec3d& omega);
  // Shortens the ray to what lies beyond the faces passed.
  void go_on(Ray& ray) const;
};

// What the viewer at the ray's origin gets of the light that is scattered where it ends; none if
// that is hidden, or the path too long. bounces: how often it has scattered, the viewer included.
std::optional<Rgb<double>> share_along(const PathContext& context, Ray ray, int bounces,
                                       RayCount& rays);

}  // namespace limn
