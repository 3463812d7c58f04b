#pragma once
// Direct light of flat emitters on diffuse surfaces in closed form: what an emitter's polygon sends
// to a point past all that is in between, without a ray and without chance. The value is a
// continuous function of the scene, and its derivative that of the same function.
//
// The part of an emitter that a point sees is found by exact regions of the emitter's plane
// (limn/core/visible_regions.h). Lines decide there on a grid; what is added up are the true lines,
// planes through the point and an edge, and the points where these meet. So differences of values
// are clean, and cuts between regions cancel. Flat-shaded receivers have Lambert's formula,
// interpolated normals a quadrature over the regions.
//
// After Zhou, Wu, Ramamoorthi, Yan 2021 (5.2), with derivatives by the motion of lines in place of
// those of corners.
#include <cstdint>
#include <memory>
#include <vector>

#include "integrators/edges/edge_sides.h"
#include "limn/core/duplicate_faces.h"
#include "limn/core/face_overlaps.h"
#include "limn/core/face_tree.h"
#include "limn/core/shading.h"

namespace limn {

// InputError, with the place in the scene's file and what to do, for a scene that has no closed
// form here: where anything is scattered, a max_depth other than 2, an environment, delta lights,
// BSDFs that are not diffuse, interpolated normals after Mitsuba.
void check_closed_light(const Scene& scene);

class ClosedLight {
 public:
  // The scene must outlive it. InputError as above, and for an emitter of more than kMostPlanes
  // planes. by: how the visible part of an emitter is found; regions take much longer; they are the
  // oracle, and step in where a corner is too far out.
  enum class By { kOutlines, kRegions };
  ClosedLight(const Scene& scene, int threads, By by = By::kOutlines);
  // Of the same scene with other tangents: what is where is known already. A point that one of both
  // evaluated last costs the other little.
  ClosedLight(const Scene& scene, const ClosedLight& same);

  static constexpr size_t kMostPlanes = 64;  // of one emitter

  // Radiance that the surface scatters towards the viewer of `scattering`, of all emitters [W /
  // (m^2 sr)]; with its derivative where S is Dual or Var. edge: where the point lies, if on an
  // edge: the limit from its own face.
  template <class S>
  Rgb<S> scattered(const RayTracer& tracer, const SurfacePoint<S>& surface,
                   const Scattering<S>& scattering, const EdgeStart* edge) const;

 private:
  // Faces of one emitter in one plane.
  struct EmitterPlane {
    ShapeId shape;
    std::vector<FaceRef> faces;
    FaceOverlaps::Set in_place;   // these, and what overlaps them in their plane
    std::vector<FaceRef> before;  // of these others those which rays meet in their place
    Plane plane;
    Vec3d u, v;               // across its normal; u, v and the reversed normal are right-handed
    double x0, x1, y0, y1;    // bounds of its faces along u and v
    double deviation;         // how far corners may lie off the plane
    std::vector<Vec3d> hull;  // corners of the faces
  };
  // What does not depend on tangents.
  struct SharedGeometry {
    SharedGeometry(const Scene& scene, int threads);
    uint64_t number;  // no other has it
    DuplicateFaces copies;
    FaceOverlaps overlaps;
    FaceTree tree;
  };
  struct Receiver;
  struct Turns;
  struct Scratch;
  template <class S>
  class View;

  void add_emitters();
  void add_emitter(ShapeId shape);
  void finish(EmitterPlane& emitter) const;
  bool in_one_place(FaceRef a, FaceRef b) const;
  bool is_skipped(FaceRef face, const Receiver& receiver) const;
  bool list(const EmitterPlane& emitter, const Receiver& receiver, Scratch& scratch) const;
  void find_regions(const EmitterPlane& emitter, const Receiver& receiver, Scratch& scratch) const;
  void find_turns(const EmitterPlane& emitter, const Receiver& receiver, const Scratch& scratch,
                  Turns& turns) const;
  bool has_turn(const FaceTree::Item& item, const Turns& turns) const;
  uint32_t cancelled_sides(const FaceTree::Item& item, const Turns& turns) const;
  bool find_outlines(const EmitterPlane& emitter, const Receiver& receiver, Scratch& scratch,
                     Turns& turns) const;
  // Whether what a point has seen of an emitter is kept: for others of the same scene.
  bool holds() const { return places_.use_count() > 1; }
  void find(const EmitterPlane& emitter, const Receiver& receiver, Scratch& scratch,
            Turns& turns) const;

  const Scene& scene_;
  std::shared_ptr<const SharedGeometry> places_;
  const DuplicateFaces& copies_;
  const FaceOverlaps& overlaps_;
  const FaceTree& tree_;
  By by_;
  std::vector<EmitterPlane> emitters_;
};

}  // namespace limn
