// How the camera's edges are chosen: by how much radiance differs across them, too.
#include <gtest/gtest.h>

#include "integrators/edges/scene_edges.h"
#include "integrators/paths/traced_scene.h"
#include "integrators/terms/camera_edges.h"
#include "integrators/terms/term.h"
#include "limn/core/parameter.h"
#include "limn/edgetree/edge_sampler_types.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

// The share of points that lie on the edges of the lamp, a small square beside a ball of many
// edges, and what lies there of the length of all.
struct LampShare {
  double points, length;
};
LampShare share_of_lamp(const std::string& radiance) {
  const TempFiles files;
  SceneParts parts;
  parts.width = parts.height = 32;
  parts.body = obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), true, 0.8,
                         {0.2, 1, 0}, diffuse("clay", "0.7, 0.5, 0.3")) +
               square("lamp", 0.05, 0, {-1.2, 1.6, 0.5}, area_light("glow", radiance)) +
               constant_light("sky", "0.2, 0.3, 0.4");
  Scene scene = make_scene(files, parts);
  find_parameter(scene, "sensor.translate.x").seed(scene, 0);
  const TracedScene traced(scene, 1, {.edges = true});
  TermInput input(traced.context(), 1, {1, 1, 1, 1}, edge_sampler_type("silhouettes"), 1, false);
  const CameraEdges edges(traced.context(), input.edges(), 1);
  constexpr int kPoints = 4096;
  LampShare share{0, 0};
  double length = 0;
  for (int i = 0; i < kPoints; ++i) {
    const auto point = edges.choose((i + 0.5) / kPoints, {});
    if (!point) continue;
    const bool is_lamp = scene.shape(point->edge.shape).id == "lamp";
    share.points += is_lamp / static_cast<double>(kPoints);
    share.length += is_lamp / point->density;
    length += 1 / point->density;
  }
  share.length /= length;
  return share;
}

TEST(CameraEdges, OfBrightEmittersAreChosenMoreOften) {
  const LampShare bright = share_of_lamp("500, 500, 500"),
                  dim = share_of_lamp("0.001, 0.001, 0.001");
  // Whatever is chosen, densities tell the length of all that may be.
  EXPECT_NEAR(bright.length, dim.length, 0.1 * dim.length);
  EXPECT_LT(bright.length, 0.1);
  EXPECT_GT(bright.points, 0.7);
  EXPECT_LT(bright.points, 1 - 0.2);  // the rest has a share that does not depend on differences
  // As dark before the sky as many edges of the ball.
  EXPECT_LT(dim.points, 0.1);
}

// The share of points on outlines of a flat-shaded ball, what lies there of the length of all, and
// how many of its edges are sharp.
struct OutlineShare {
  double points, length;
  uint64_t sharp;
};
OutlineShare share_of_outlines(const std::string& inner) {
  const TempFiles files;
  SceneParts parts;
  parts.width = parts.height = 32;
  parts.body = obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), true, 0.8,
                         {0.2, 1, 0}, inner) +
               constant_light("sky", "0.2, 0.3, 0.4");
  Scene scene = make_scene(files, parts);
  find_parameter(scene, "ball.translate.x").seed(scene, 0);
  const TracedScene traced(scene, 1, {.edges = true});
  TermInput input(traced.context(), 1, {1, 1, 1, 1}, edge_sampler_type("silhouettes"), 1, false);
  const CameraEdges edges(traced.context(), input.edges(), 1);
  const EdgeMesh& mesh = input.edges().objects[0];
  constexpr int kPoints = 4096;
  OutlineShare share{0, 0, mesh.count(EdgeClass::kSharp)};
  double length = 0;
  for (int i = 0; i < kPoints; ++i) {
    const auto point = edges.choose((i + 0.5) / kPoints, {});
    if (!point) continue;
    const bool outline = is_outline(mesh, point->edge.id.edge, value(scene.camera.origin));
    share.points += outline / static_cast<double>(kPoints);
    share.length += outline / point->density;
    length += 1 / point->density;
  }
  share.length /= length;
  return share;
}

TEST(CameraEdges, FoldsThatHardlyDifferAreChosenLess) {
  const OutlineShare share = share_of_outlines(diffuse("clay", "0.2, 0.15, 0.1"));
  EXPECT_GT(share.sharp, 100u);
  EXPECT_LT(share.length, 0.2);
  EXPECT_GT(share.points, 0.6);
  EXPECT_LT(share.points, 0.95);  // folds keep a share that does not depend on differences
}

// Nothing is scattered, so how faces are turned is not seen: only outlines are edges.
TEST(CameraEdges, OfBlackShapesHaveNoFolds) {
  for (const std::string& light : {std::string(), area_light("glow", "5, 4, 3")}) {
    const OutlineShare share = share_of_outlines(diffuse("soot", "0, 0, 0") + light);
    EXPECT_EQ(share.sharp, 0u);
    EXPECT_NEAR(share.points, 1, 1e-12);
  }
}

// Two halves of a plane whose normals differ: with Mitsuba's shading one of them shines towards a
// point that sees the other dark.
TEST(CameraEdges, OfEmittersFollowNormalsWithMitsubasShading) {
  const TempFiles files;
  SceneParts parts;
  const std::string halves = files.write("halves.obj",
                                         "v -1 -1 0\nv 0 -1 0\nv 0 1 0\nv -1 1 0\nv 1 -1 0\n"
                                         "v 1 1 0\nvn 0 0 1\nvn -0.866 0 0.5\n"
                                         "f 1//1 2//1 3//1\nf 1//1 3//1 4//1\n"
                                         "f 2//2 5//2 6//2\nf 2//2 6//2 3//2\n");
  parts.body = obj_shape("lamp", halves, false, 1, {0, 0, 0},
                         diffuse("soot", "0, 0, 0") + area_light("glow", "5, 4, 3"));
  Scene scene = make_scene(files, parts);
  const auto sharp_edges = [&] {
    return make_scene_edges(scene, 1).objects[0].count(EdgeClass::kSharp);
  };
  EXPECT_EQ(sharp_edges(), 0u);
  scene.shading = ShadingModel::kMitsuba;
  EXPECT_EQ(sharp_edges(), 1u);
}

}  // namespace
}  // namespace limn
