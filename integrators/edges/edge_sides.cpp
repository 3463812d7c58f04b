// What happens at an edge that a path starts on: decided in the plane across it.
#include "integrators/edges/edge_sides.h"

#include <tuple>

#include "limn/core/duplicate_faces.h"

namespace limn {

// A component of x0 may be off by its own rounding, one of a by that of the corner, one of `across`
// by three roundings of |a|.
FaceSide side_of_face(const Scene& scene, FaceRef face, const Vec3d& x0, const Vec3d& along) {
  FaceSide side{face, {}};
  double best_length = 0;
  for (const Vec3d& corner : face_corners<double>(scene.shape(face.shape).mesh, face.face)) {
    const Vec3d a = corner - x0;
    const Vec3d across = a - along * dot(a, along);
    const double across_length = length(across);
    if (across_length > best_length) {
      best_length = across_length;
      side.into = across / across_length;
      side.rounding = 0x1.0p-50 * (length(x0) + length(a)) / across_length;
    }
  }
  return side;
}

bool overlap(const RayTracer& tracer, const FaceSide& a, const FaceSide& b) {
  return length(a.into - b.into) <= a.rounding + b.rounding ||
         (dot(a.into, b.into) > 0 && tracer.overlap(a.face, b.face));
}

void RimOrder::add(uint8_t motion_group, bool positive, double slope) {
  if (motion_group == kNoMotionGroup) return;
  MotionGroup& r = motion_groups_[motion_group];
  r.slope[positive] = r.has[positive] ? std::min(r.slope[positive], slope) : slope;
  r.has[positive] = true;
}

bool RimOrder::comes_before(uint8_t a, uint8_t b) const {
  const auto place = [&](uint8_t motion_group) {
    const MotionGroup& r = motion_groups_[motion_group];
    const int group = r.has[0] == r.has[1] ? 1 : r.has[0] ? 0 : 2;
    const double within = group == 0 ? -r.slope[0] : group == 2 ? r.slope[1] : 0;
    return std::tuple(group, within, motion_group);
  };
  return place(a) < place(b);
}

// In the plane across the edge a face is a ray {s g, s >= 0} and the path starts at a point f of
// its own face, |f| -> 0. It meets g where f + r w = s g with r, s > 0; by Cramer's rule r = (f x
// g) / (g x w), s = (f x w) / (g x w). Lengths drop out.
std::optional<FaceSide> blocked_at_edge(const Scene& scene, const RayTracer& tracer,
                                        const EdgeStart& edge, const Vec3d& direction) {
  const Vec3d along = normalize(edge.x1 - edge.x0);
  const Vec3d& f = edge.start.into;
  const auto turn = [&](const Vec3d& a, const Vec3d& b) { return dot(along, cross(a, b)); };
  std::optional<FaceSide> nearest;
  double nearest_r = 0;
  for_every_side(scene, edge.around, edge.x0, along, [&](const FaceSide& side, Incidence) {
    if (side.face == edge.start.face) return;
    const Vec3d& g = side.into;
    if (overlap(tracer, side, edge.start)) return;
    const double gw = turn(g, direction);
    const double r = turn(f, g) / gw;
    const double s = turn(f, direction) / gw;
    if (gw == 0 || !(r > 0) || !(s > 0)) return;
    const bool first = !nearest || (overlap(tracer, side, *nearest)
                                        ? is_hit_first(scene, side.face, nearest->face, direction)
                                        : r < nearest_r);
    if (first) {
      nearest = side;
      nearest_r = r;
    }
  });
  return nearest;
}

}  // namespace limn
