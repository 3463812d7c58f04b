#pragma once
// The sides of faces around an edge, seen in the plane across it: what blocks what, and what parts
// when faces move.
#include <array>
#include <cstdint>
#include <optional>

#include "limn/core/ray_tracer.h"
#include "limn/core/shading.h"
#include "limn/edgetree/edges.h"

namespace limn {

// One side of a face beside an edge: the face, and the unit vector across the edge that lies in it
// and points into it, with a bound of its rounding.
struct FaceSide {
  FaceRef face;
  Vec3d into;
  double rounding = 0;
};

// A path that starts exactly on an edge, on one of the faces around it. Its first rays never meet
// these faces by rounding: whether a face blocks its neighbour at their common edge is decided by
// their directions alone.
struct EdgeStart {
  FacesAround around;
  Vec3d x0, x1;    // ends of the edge
  FaceSide start;  // where the path is
};

// x0: a point of the edge, along: its unit direction. Of a face that the edge runs through, one of
// the two sides; the other is its opposite.
FaceSide side_of_face(const Scene& scene, FaceRef face, const Vec3d& x0, const Vec3d& along);

// Whether two sides lie in one place: those of faces that the tracer knows to overlap, and those
// that double precision cannot tell apart (faces in one plane, with less in common than rounding
// explains). Which of them is seen is_hit_first says (limn/core/duplicate_faces.h), as for all
// rays.
bool overlap(const RayTracer& tracer, const FaceSide& a, const FaceSide& b);

// Calls visit(side, incidence) for every side of the faces around an edge.
template <class Visit>
void for_every_side(const Scene& scene, const FacesAround& around, const Vec3d& x0,
                    const Vec3d& along, const Visit& visit) {
  for (size_t i = 0; i < around.faces.size(); ++i) {
    const FaceRef face = around.faces[i];
    const Incidence incidence = around.incidence(i);
    const FaceSide side = side_of_face(scene, face, x0, along);
    visit(side, incidence);
    if (incidence.through) visit(FaceSide{face, -side.into, side.rounding}, incidence);
  }
}

// In which order the motion_groups in one place part as their faces move, seen across them from the
// negative side to the positive one: those of faces on the negative side alone come first, the rear
// ones before those that hide them; those of faces on the positive side alone last, the front ones
// first. So surfaces leave gaps and do not pass through each other.
class RimOrder {
 public:
  // A face lies on this side; smaller slopes are nearer.
  void add(uint8_t motion_group, bool positive, double slope);
  // Whether a face is seen just beside the motion_group `own`, on its positive side or the other:
  // one of the same motion_group on its own side only, one of a motion_group that comes later (or
  // has come before) on both, if it lies on the negative (or the positive) side.
  bool is_seen(uint8_t motion_group, bool positive, uint8_t own, bool on_positive_side) const {
    if (motion_group == own || motion_group == kNoMotionGroup) return positive == on_positive_side;
    return positive == comes_before(motion_group, own);
  }

 private:
  bool comes_before(uint8_t a, uint8_t b) const;

  struct MotionGroup {
    bool has[2] = {false, false};  // faces on the negative and on the positive side
    double slope[2];               // of the nearest
  };
  std::array<MotionGroup, kMostMotionGroups> motion_groups_;
};

// The side that a ray meets at once when it leaves edge.start infinitely close to the edge, if any.
std::optional<FaceSide> blocked_at_edge(const Scene& scene, const RayTracer& tracer,
                                        const EdgeStart& edge, const Vec3d& direction);

}  // namespace limn
