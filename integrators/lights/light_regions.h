#pragma once
// What is emitted, split into regions of few directions each, and the rest. The difference of
// radiance across an edge is linear in it: dL = sum over regions of dL_k + dL_rest, dL_k being that
// of what region k emits and p sees directly. All scattered light belongs to the rest. Each part
// has an estimator of its own: direct_boundary.cpp lists the silhouettes before a region.
#include <optional>
#include <vector>

#include "integrators/lights/bright_patches.h"
#include "limn/core/light_tree.h"
#include "limn/core/scene.h"
#include "limn/core/shading.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// A convex set of points that an emitter lies in, for cones around it.
struct EmitterHull {
  // A convex polygon, counter-clockwise seen from where it shines; else points around the emitter.
  bool flat = false;
  std::vector<Vec3d> points;
  Plane plane;           // of the polygon
  double deviation = 0;  // how far the emitter reaches out of the polygon [scene units]
  Vec3d center;
  double radius = 0;         // of a sphere around the center that holds all points
  double area = 0;           // of the emitter; of a flat one that of the polygon
  std::vector<Plane> faces;  // it shines in front of one of these; none: it may shine everywhere
};
EmitterHull make_emitter_hull(const Mesh& mesh, ShadingModel shading);

// The directions from p in which the emitter may be seen above the horizon of n; none if there are
// none.
std::optional<DirectionCone> cone_around(const EmitterHull& emitter, const Vec3d& p,
                                         const Vec3d& n);
std::optional<DirectionCone> cone_around(const DirectionCap& cap, const Vec3d& n);

class LightRegions {
 public:
  // Every emitter is a region, and every bright patch of the environment.
  explicit LightRegions(const Scene& scene);
  // Whether the scene has any.
  static bool any_in(const Scene& scene);

  size_t size() const { return regions_.size(); }
  bool empty() const { return regions_.empty(); }
  // Whether nothing else emits.
  bool hold_all() const { return hold_all_; }
  // Mean luminance of region k [W / (m^2 sr)], for importance.
  double luminance(size_t k) const { return regions_[k].luminance; }
  // The regions whose edges are looked for from p: all of few; of many emitters those that move, if
  // they are few, and 16 draws of the others. u: in [0, 1).
  struct Choice {
    uint32_t region;
    double expected;  // how often it is drawn on average
    double times;     // it was drawn
  };
  void choose(const Vec3d& p, double u, std::vector<Choice>& choices) const;
  bool chooses() const { return !tree_.empty(); }
  // Its directions from p above the horizon of n; none if it does not shine there.
  std::optional<DirectionCone> cone(size_t k, const Vec3d& p, const Vec3d& n) const {
    const Region& region = regions_[k];
    return region.shape.valid() ? cone_around(region.hull, p, n) : cone_around(region.patch.cap, n);
  }

  // A direction from x in which the region may be: uniform on the polygon of a flat emitter, else
  // over the sphere or the cap that the region lies in. None where direction_pdf is zero
  // everywhere.
  std::optional<Vec3d> draw_direction(size_t k, const Vec3d& x, double u1, double u2) const;
  // Its density [1/sr] at the unit direction w; zero where it is never drawn: behind a flat
  // emitter, inside the sphere around others.
  double direction_pdf(size_t k, const Vec3d& x, const Vec3d& w) const;
  // Whether edges before it are listed, see penumbra.h: not before all of many emitters.
  bool lists_edges(size_t k) const { return regions_[k].lists_edges; }
  // The shape of an emitter; none of a patch.
  ShapeId shape(size_t k) const { return regions_[k].shape; }
  const EmitterHull& hull(size_t k) const { return regions_[k].hull; }
  // All faces of a flat emitter of few: a line meets one of them at most, also where rounding lets
  // rays meet neighbours. Else empty.
  std::span<const FaceRef> flat_faces(size_t k) const { return regions_[k].flat_faces; }
  const BrightPatch& patch(size_t k) const { return regions_[k].patch; }
  const DirectionCap& cap(size_t k) const { return patch(k).cap; }

  // What a surface emits towards the unit direction wi as part of region k.
  Rgb<double> emission(size_t k, const SurfacePoint<double>& surface, const Vec3d& wi) const;
  // As part of any region.
  Rgb<double> emission(const SurfacePoint<double>& surface, const Vec3d& wi) const;
  // What arrives from infinity in the unit direction w as part of region k, or of any.
  Rgb<double> escaped(size_t k, const Vec3d& w) const;
  Rgb<double> escaped(const Vec3d& w) const;

  // What edge samplers weigh by, but for the regions' light. input: without light.
  void add_rest(EdgeSamplerInput& input) const;

 private:
  struct Region {
    ShapeId shape;  // none: a patch of the environment
    double luminance;
    EmitterHull hull;
    BrightPatch patch;
    std::vector<FaceRef> flat_faces;
    bool lists_edges = true;
  };
  void leave_out_dim_emitters();
  void add_patches();
  void grow_tree();
  // The cap of directions from x that holds region k, unless that is a flat emitter.
  std::optional<DirectionCap> cap_around(const Region& region, const Vec3d& x) const;

  const Scene& scene_;
  std::vector<Region> regions_;    // emitters, then patches
  size_t patches_ = 0;             // the first of these
  LightTree tree_;                 // of many emitters; else empty
  std::vector<uint32_t> in_tree_;  // regions there
  std::vector<uint32_t> always_;   // all others
  bool hold_all_ = false;
};

// Which part of the radiance that arrives counts.
struct RadiancePart {
  const LightRegions* regions = nullptr;  // null: all of it
  // What this region emits, seen directly; none: all but what any region emits.
  std::optional<size_t> region = {};
};

}  // namespace limn
