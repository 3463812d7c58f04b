#pragma once
// A scene's edges as edge samplers take them.
#include <string>
#include <vector>

#include "limn/core/scene.h"
#include "limn/edgetree/edge_sampler_types.h"

namespace limn {

// Edges of all shapes (object i is shape i), united where they touch, after them the curves where
// surfaces cross (if any do), light polygons and the environment's mean. The result does not depend
// on `threads`. Edges of textures come last, an object for each shape that has some.
EdgeSamplerInput make_sampler_input(const Scene& scene, int threads);
// The same in two steps: all but light polygons and the environment over directions; and these.
EdgeSamplerInput make_scene_edges(const Scene& scene, int threads);
void add_light(const Scene& scene, EdgeSamplerInput& input);

// The edges of a scene at several times of the shutter: those of shapes that stand still are found
// once. Of a scene at the steps of a fit the environment over directions is kept.
class KeptEdges {
 public:
  // As make_scene_edges(), of the scene at a time.
  EdgeSamplerInput make(const Scene& scene, int threads);
  // As limn::add_light().
  void add_light(const Scene& scene, EdgeSamplerInput& input);
  // same: all scenes from now on have one environment, whose importances are then made once.
  void keep_environment(bool same) { same_environment_ = same; }
  // What samplers may keep of the input that make() returned last; null: nothing.
  SharedObjects* shared() { return shared_ ? &*shared_ : nullptr; }

 private:
  // The mesh of a shape, as it was when still_ was made.
  struct Kept {
    SharedVector<Vec3f> positions;
    SharedVector<Vec3d> normals;
    Tangents tangents;
  };
  // Sets moving_. False if still_ is not that of the scene.
  bool is_known(const Scene& scene);
  EdgeSamplerInput joined(EdgeSamplerInput moving) const;

  std::vector<bool> moving_;  // of each shape
  std::vector<Kept> kept_;    // of each shape
  Vec3d pinhole_;
  EdgeSamplerInput still_;  // without objects: unknown
  std::shared_ptr<SharedObjects> still_shared_, shared_;
  bool same_environment_ = false;
  std::shared_ptr<const RadiancePyramid> environment_;
};

// One for each pair of shapes that touch and move towards each other or apart (ContactLine); none
// twice. edges: of the scene, in motion; null: none.
void warn_of_contacts(const Scene& scene, const EdgeSamplerInput* edges,
                      std::vector<std::string>& warnings);

}  // namespace limn
