// Which face around an edge a path meets that starts on the edge, against rays that start a tiny
// distance away from it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "integrators/paths/path.h"
#include "support/brute_force_tracer.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

// `wings` faces around the segment from (0, 0, -1) to (0, 0, 1), at random angles.
Mesh fan(int wings, Rng& rng) {
  std::vector<Vec3f> x{{0, 0, -1}, {0, 0, 1}};
  std::vector<FaceIndices> faces;
  for (int k = 0; k < wings; ++k) {
    const double angle = 2 * kPi * rng.uniform();
    const double reach = 0.5 + rng.uniform();
    x.push_back(
        cast<float>(Vec3d{reach * std::cos(angle), reach * std::sin(angle), rng.uniform() - 0.5}));
    const uint32_t tip = 2 + k;
    faces.push_back(rng.uniform() < 0.5 ? FaceIndices{0, 1, tip} : FaceIndices{1, 0, tip});
  }
  return make_mesh(x, faces);
}

TEST(BlockedAtEdge, AgreesWithRaysCloseBy) {
  Rng rng(1, 2, 3);
  int blocked = 0;
  int free = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const int wings = 2 + trial % 3;
    Scene scene;
    scene.shapes.emplace_back();
    scene.shapes[0].mesh = fan(wings, rng);
    std::vector<FaceRef> faces;
    for (int f = 0; f < wings; ++f) faces.push_back({ShapeId(0), FaceId(f)});
    EdgeStart edge{{std::span<const FaceRef>(faces), {}}, {0, 0, -1}, {0, 0, 1}, {}};
    const auto tracer = make_brute_force_tracer(scene);
    for (int k = 0; k < 20; ++k) {
      const FaceRef start = faces[static_cast<uint32_t>(rng.uniform() * wings)];
      const Vec3d direction = random_direction(rng);
      edge.start = side_of_face(scene, start, edge.x0, {0, 0, 1});
      Ray ray{Vec3d{0, 0, rng.uniform() - 0.5} + edge.start.into * 1e-12, direction};
      ray.start = start;
      ray.t_max = 1e-3;
      Hit hit;
      const bool found = tracer->closest(ray, hit);
      const auto side = blocked_at_edge(scene, *tracer, edge, direction);
      ASSERT_EQ(found, side.has_value()) << "trial " << trial << ", direction " << k;
      if (found) {
        EXPECT_EQ(hit.face, side->face);
      }
      ++(found ? blocked : free);
    }
  }
  // Both happen often, so both are under test.
  EXPECT_GT(blocked, 5000);
  EXPECT_GT(free, 5000);
}

// A dihedral angle of a right angle, seen from within: half of the directions that leave one face
// meet the other.
TEST(BlockedAtEdge, RightAngle) {
  Scene scene;
  scene.shapes.emplace_back();
  scene.shapes[0].mesh =
      make_mesh({{0, 0, -1}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {1, 0, 3}});
  const std::array faces = {FaceRef{ShapeId(0), FaceId(0)}, FaceRef{ShapeId(0), FaceId(1)}};
  const Vec3d into[] = {{1, 0, 0}, {0, 1, 0}};
  const auto tracer = make_brute_force_tracer(scene);
  const auto blocked = [&](int start, const Vec3d& direction) {
    const EdgeStart edge{
        {std::span<const FaceRef>(faces), {}}, {0, 0, -1}, {0, 0, 1}, {faces[start], into[start]}};
    const auto side = blocked_at_edge(scene, *tracer, edge, normalize(direction));
    return side ? std::optional(side->face) : std::nullopt;
  };
  EXPECT_EQ(blocked(0, {-1, 1, 0}), faces[1]);
  EXPECT_EQ(blocked(0, {-1, 1e-9, 0}), faces[1]);
  EXPECT_EQ(blocked(0, {1, 1, 0}), std::nullopt);
  EXPECT_EQ(blocked(0, {-1, -1, 0}), std::nullopt);
  EXPECT_EQ(blocked(1, {1, -1, 0}), faces[0]);
  EXPECT_EQ(blocked(1, {1, 1, 0}), std::nullopt);
}

// Two faces that overlap in a plane, and a third one: neither of the two blocks what starts on the
// other, and of the two the first one is met.
TEST(BlockedAtEdge, WhatOverlapsDoesNotBlock) {
  Rng rng(3, 2, 1);
  for (int trial = 0; trial < 200; ++trial) {
    Scene scene;
    for (const float size : {1.0f, 0.7f}) {
      scene.shapes.emplace_back().mesh =
          make_mesh({{0, 0, -1}, {0, 0, 1}, {size, 0, 0}}, {{0, 1, 2}});
    }
    scene.shapes.emplace_back().mesh = make_mesh({{0, 0, -1}, {0, 0, 1}, {0, 1, 0}}, {{1, 0, 2}});
    const std::array faces = {FaceRef{ShapeId(0), FaceId(0)}, FaceRef{ShapeId(1), FaceId(0)},
                              FaceRef{ShapeId(2), FaceId(0)}};
    const Vec3d x0{0, 0, -1}, x1{0, 0, 1};
    const auto tracer = make_brute_force_tracer(scene);
    const auto blocked = [&](int start, const Vec3d& direction) {
      const FaceSide side = side_of_face(scene, faces[start], x0, {0, 0, 1});
      const auto found = blocked_at_edge(
          scene, *tracer, {{std::span<const FaceRef>(faces), {}}, x0, x1, side}, direction);
      return found ? std::optional(found->face) : std::nullopt;
    };
    const Vec3d direction = random_direction(rng);
    const bool towards_third = direction.x < 0 && direction.y > 0;
    EXPECT_EQ(blocked(0, direction), towards_third ? std::optional(faces[2]) : std::nullopt);
    EXPECT_EQ(blocked(1, direction), towards_third ? std::optional(faces[2]) : std::nullopt);
    const bool towards_first = direction.x > 0 && direction.y < 0;
    EXPECT_EQ(blocked(2, direction), towards_first ? std::optional(faces[0]) : std::nullopt);
  }
}

}  // namespace
}  // namespace limn
