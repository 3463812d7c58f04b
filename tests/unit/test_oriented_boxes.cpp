// Boxes along the sides of faces, and what they spare a search for pairs.

#include <gtest/gtest.h>

#include <set>

#include "limn/core/box_tree.h"
#include "support/meshes.h"

namespace limn {
namespace {

std::vector<FaceCorners> faces_of(const Mesh& mesh) {
  std::vector<FaceCorners> faces;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f)
    faces.push_back(face_corners<double>(mesh, FaceId(f)));
  return faces;
}

Mesh askew(const Mesh& mesh, Rng& rng) {
  Vec3d rows[3];
  random_rotation(rng, rows);
  return transformed(mesh, rows, 1, random_direction(rng) * rng.uniform());
}

Bounds bounds_of(const FaceCorners& face) {
  Bounds bounds;
  for (const Vec3d& x : face) bounds.extend(x);
  return bounds;
}

Vec3d point_on(const FaceCorners& face, Rng& rng) {
  const double a = rng.uniform();
  const double b = rng.uniform() * (1 - a);
  return face[0] * a + face[1] * b + face[2] * (1 - a - b);
}

TEST(OrientedBoxes, AreApartOnlyIfTheirFacesAre) {
  Rng rng(1, 2, 3);
  constexpr double kMargin = 0.01;
  int apart = 0, thin = 0, counted = 0;
  for (int i = 0; i < 500; ++i) {
    const auto a = faces_of(askew(rod_mesh(16, 0.05), rng));
    const auto b = faces_of(askew(i % 2 == 0 ? rod_mesh(16, 0.05) : cube_mesh(), rng));
    Bounds around_a, around_b;
    for (const auto& face : a)
      for (const Vec3d& x : face) around_a.extend(x);
    for (const auto& face : b)
      for (const Vec3d& x : face) around_b.extend(x);
    const auto box_a = thin_box(a, kMargin, around_a), box_b = thin_box(b, kMargin, around_b);
    if (!box_a) continue;  // along an axis
    thin += box_b.has_value();
    ++counted;
    if (!are_apart(*box_a, box_b ? *box_b : oriented(around_b))) continue;
    ++apart;
    for (int k = 0; k < 200; ++k) {
      const auto& from = a[k % a.size()];
      const auto& to = b[k % b.size()];
      EXPECT_GT(length(point_on(from, rng) - point_on(to, rng)), kMargin);
    }
  }
  EXPECT_GT(counted, 300);
  EXPECT_GT(thin, 100);
  EXPECT_LT(thin, counted / 2 + 50);  // no cube is
  EXPECT_GT(apart, counted / 3);
}

TEST(OrientedBoxes, FollowSliversThatLieAskew) {
  Rng rng(4, 5, 6);
  const Mesh rod = rod_mesh(64, 0.1);
  EXPECT_FALSE(box_of_slivers(faces_of(rod)));  // along an axis
  EXPECT_FALSE(box_of_slivers(faces_of(askew(icosphere_mesh(3), rng))));
  const Vec3d rows[3] = {{0.36, -0.8, 0.48}, {0.48, 0.6, 0.64}, {-0.8, 0, 0.6}};
  const auto box = box_of_slivers(faces_of(transformed(rod, rows, 1, {5, 6, 7})));
  ASSERT_TRUE(box);
  EXPECT_NEAR(std::fabs(dot(box->axes[0], Vec3d{0.48, 0.64, 0.6})), 1, 1e-4);
  EXPECT_FALSE(box_of_slivers({}));
}

// Half of all pairs of a rod's faces have boxes that overlap.
TEST(OrientedBoxes, SparePairsOfSlivers) {
  Rng rng(7, 8, 9);
  constexpr uint32_t kSides = 256;
  const Vec3d rows[3] = {{0.36, -0.8, 0.48}, {0.48, 0.6, 0.64}, {-0.8, 0, 0.6}};
  const auto faces = faces_of(transformed(rod_mesh(kSides, 0.02), rows, 1, {}));
  std::vector<FloatBox> boxes;
  for (const FaceCorners& face : faces) {
    const Bounds bounds = bounds_of(face);
    FloatBox& box = boxes.emplace_back();
    for (int k = 0; k < 3; ++k) {
      box.lower[k] = static_cast<float>(bounds.lower[k] - 1e-6);
      box.upper[k] = static_cast<float>(bounds.upper[k] + 1e-6);
    }
  }
  using Pair = std::pair<uint32_t, uint32_t>;
  const auto pairs_of = [](const BoxTree& tree) {
    const auto pairs = tree.find_pairs<Pair>(
        1, [](uint32_t, uint32_t) { return 0u; },
        [](uint32_t i, uint32_t j, std::vector<Pair>& found) {
          found.push_back({i, j});
        });
    return std::set<Pair>(pairs.begin(), pairs.end());
  };
  const auto all = pairs_of(BoxTree(boxes, 1));
  const auto near =
      pairs_of(BoxTree(boxes, 1, [&](uint32_t i) { return std::pair(faces[i], 1e-6); }));
  EXPECT_GT(all.size(), kSides * kSides / 2);
  EXPECT_LT(near.size(), 50 * kSides);
  for (const Pair& pair : near) EXPECT_TRUE(all.contains(pair));
  for (const auto& [i, j] : all) {
    const bool touch = std::ranges::any_of(
        faces[i], [&](const Vec3d& x) { return std::ranges::find(faces[j], x) != faces[j].end(); });
    EXPECT_TRUE(!touch || near.contains({i, j}));
  }
}

}  // namespace
}  // namespace limn
