#pragma once
// Curves along which the camera's clip planes cut faces: radiance is discontinuous there, and they
// move with the camera and with the faces.
#include <array>
#include <vector>

#include "integrators/paths/path.h"

namespace limn {

// Where a face meets a clip plane.
struct ClipSegment {
  FaceRef face;
  bool at_far_plane = false;
  std::array<Vec3<Dual>, 2> ends;  // on the face and on the plane, whatever moves
  Vec3d into_view;                 // along the face, towards what the plane leaves of it
};

std::vector<ClipSegment> find_clip_segments(const Scene& scene);

// Estimates the radiance that arrives at the camera from where the face is cut off, just beside the
// point `y` of the segment, minus that where the face is seen. from: where the camera's ray to y
// starts. False if y is hidden.
bool clip_difference(const PathContext& context, const ClipSegment& segment, const Vec3d& from,
                     const Vec3d& y, const Rng& key, RayCount& rays, Rgb<double>& difference);

}  // namespace limn
