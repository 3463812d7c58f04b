// What the pictures of `limn reject` are drawn with.
#include <gtest/gtest.h>

#include <cmath>

#include "../support/meshes.h"
#include "limn/core/make_bsdf.h"
#include "tools/limn/reject/canvas.h"
#include "tools/limn/reject/mesh_view.h"

namespace limn {
namespace {

TEST(Layer, ALineCoversItsWidthInEveryColumn) {
  for (const double width : {1.0, 2.5, 4.0}) {
    for (const double y : {10.0, 10.3, 10.5}) {
      Layer layer(40, 20);
      layer.line({5, y}, {35, y}, width);
      layer.line({5, y}, {20, y}, width);  // again: covers no more
      for (int x = 6; x < 34; ++x) {
        double sum = 0;
        for (int row = 0; row < 20; ++row) sum += layer.cover(x, row);
        EXPECT_NEAR(sum, width, 1e-5) << "column " << x;  // cover is a float
      }
      EXPECT_EQ(layer.cover(1, 10), 0);
    }
  }
}

TEST(Layer, LinesMayLeaveThePicture) {
  Layer layer(8, 8);
  layer.line({-100, 4}, {100, 4}, 2);
  layer.disc({-50, 300}, 10);
  for (int x = 0; x < 8; ++x) EXPECT_EQ(layer.cover(x, 4), 1);
  EXPECT_EQ(layer.cover(0, 7), 0);
}

TEST(Paint, BlendsLinearly) {
  Image image(8, 8, 3);
  Layer layer(8, 8);
  layer.disc({4, 4}, 4);
  paint(image, layer, srgb(0xff0000), 0.25);
  EXPECT_EQ(pixel(image, 4, 4).r, 0.25);
  EXPECT_EQ(pixel(image, 4, 4).g, 0);
  EXPECT_EQ(pixel(image, 0, 0).r, 0);
  EXPECT_EQ(css(0x01ab20), "#01ab20");
  EXPECT_EQ(srgb(0xffffff).b, 1);
}

// Whatever the direction, all points lie in the middle 94 %, and two of them on opposite sides of
// its border.
TEST(Camera, FitsThePoints) {
  Rng rng(41, 0, 0);
  for (int i = 0; i < 50; ++i) {
    std::vector<Vec3d> points;
    for (int k = 0; k < 30; ++k) points.push_back(random_direction(rng) * rng.uniform() * 7.0);
    const Vec3d view = i == 0 ? Vec3d{0, 3, 0} : random_direction(rng);
    const Camera camera = camera_for(points, view, {0, 1, 0}, 100);
    double low[2] = {100, 100}, high[2] = {0, 0};
    for (const Vec3d& point : points) {
      EXPECT_GT(camera.depth<double>(point), 0);
      const auto at = camera.project<double>(point);
      const double xy[2] = {at.x, at.y};
      for (int k = 0; k < 2; ++k) {
        low[k] = std::min(low[k], xy[k]);
        high[k] = std::max(high[k], xy[k]);
      }
    }
    const int wider = high[0] - low[0] > high[1] - low[1] ? 0 : 1;
    EXPECT_NEAR(low[wider], 3, 1e-9);
    EXPECT_NEAR(high[wider], 97, 1e-9);
    EXPECT_GE(low[1 - wider], 3 - 1e-9);
    EXPECT_LE(high[1 - wider], 97 + 1e-9);
  }
}

// A ball hides the edges on its far side.
TEST(MeshView, TellsHiddenEdges) {
  Scene scene;
  scene.shapes.resize(1);
  scene.shapes[0].mesh = with_smooth_normals(icosphere_mesh(2));
  scene.shapes[0].bsdf = make_diffuse(Rgb<double>{0.5, 0.5, 0.5});
  const EdgeMesh edges = build_edge_mesh(scene.shapes[0].mesh, true);
  const auto tracer = make_embree_tracer(scene, 1);
  const MeshView view(scene, *tracer, camera_for(edges.positions, {1, 2, 3}, {0, 1, 0}, 64), 1);
  const Vec3d eye = value(view.camera().origin);
  const auto total = [](const Layer& layer) {
    double sum = 0;
    for (int y = 0; y < 64; ++y)
      for (int x = 0; x < 64; ++x) sum += layer.cover(x, y);
    return sum;
  };
  int seen = 0, unseen = 0;
  for (uint32_t e = 0; e < edges.edges.size(); ++e) {
    const double d0 = edges.plane(edges.edges[e].faces[0]).distance(eye);
    const double d1 = edges.plane(edges.edges[e].faces[1]).distance(eye);
    if (d0 * d1 < 0) continue;  // the outline
    Layer visible(64, 64), hidden(64, 64);
    view.draw_edge(edges, EdgeId(e), 1, visible, hidden);
    EXPECT_EQ(total(visible) > 0, d0 > 0) << e;
    EXPECT_EQ(total(hidden) > 0, d0 < 0) << e;
    ++(d0 > 0 ? seen : unseen);
  }
  EXPECT_GT(seen, 100);
  EXPECT_GT(unseen, 100);
  const Image picture = view.picture();
  EXPECT_EQ(pixel(picture, 0, 0).g, 1);
  EXPECT_LT(pixel(picture, 32, 32).g, 0.9);
}

}  // namespace
}  // namespace limn
