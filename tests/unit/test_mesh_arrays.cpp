// The arrays of meshes: tangents that take as little memory as they need, and shared copies.
#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "limn/core/parameter.h"
#include "limn/core/rng.h"
#include "limn/core/scene.h"
#include "limn/core/shared_vector.h"
#include "limn/core/tangents.h"
#include "support/scenes.h"

namespace limn {
namespace {

bool alike(const Vec3<Lanes>& a, const Vec3<Lanes>& b) {
  bool same = true;
  for (int k = 0; k < 3; ++k)
    for (int lane = 0; lane < kLanes; ++lane) same &= a[k][lane] == b[k][lane];
  return same;
}

// Random changes, of few values, beside a plain vector.
TEST(Tangents, AreWhatAVectorHolds) {
  Rng rng(1, 0, 0);
  for (int run = 0; run < 200; ++run) {
    Tangents tangents;
    std::vector<Vec3<Lanes>> plain;
    const int lanes = run % (kLanes + 1), values = 1 + run % 3;
    const auto draw = [&] {
      Vec3<Lanes> v;
      for (int k = 0; k < 3; ++k)
        for (int lane = 0; lane < lanes; ++lane)
          v[k][lane] = static_cast<int>(values * rng.uniform());
      return v;
    };
    for (int change = 0; change < 30; ++change) {
      const double u = rng.uniform();
      const Vec3<Lanes> v = draw();
      const auto place = static_cast<size_t>(rng.uniform() * static_cast<double>(plain.size()));
      if (u < 0.6) {
        tangents.push_back(v);
        plain.push_back(v);
      } else if (u < 0.9 && !plain.empty()) {
        tangents.set(place, v);
        plain[place] = v;
      } else if (u < 0.95) {
        const size_t size = change % 2 == 0 ? plain.size() + 2 : plain.size() / 2;
        tangents.resize(size);
        plain.resize(size);
      } else {
        tangents.assign(3, v);
        plain.assign(3, v);
      }
      ASSERT_EQ(tangents.size(), plain.size());
      size_t i = 0;
      for (const Vec3<Lanes> t : tangents) ASSERT_TRUE(alike(t, plain[i++]));
      ASSERT_EQ(i, plain.size());
      for (const Vec3<Lanes>& t : plain) ASSERT_TRUE(!tangents.all_alike() || alike(t, plain[0]));
    }
  }
}

TEST(Tangents, TakeNoMoreMemoryThanTheyNeed) {
  Tangents tangents;
  for (int i = 0; i < 1000; ++i) tangents.push_back({{1, 0, 0, 0}, {}, {2, 0, 0, 0}});
  EXPECT_TRUE(tangents.all_alike());
  EXPECT_LE(tangents.bytes(), 1000u);
  Tangents turning;
  turning.reserve(1000);
  for (int i = 0; i < 1000; ++i) turning.push_back({{1.0 * i, 0, 0, 0}, {}, {}});
  EXPECT_FALSE(turning.all_alike());
  EXPECT_EQ(turning.bytes(), 1000 * 3 * sizeof(double));
}

TEST(SharedVector, CopiesShareUntilTheyChange) {
  SharedVector<int> a{1, 2, 3};
  const SharedVector<int> b = a;
  EXPECT_EQ(std::as_const(a).data(), b.data());
  a[1] = 7;
  EXPECT_NE(std::as_const(a).data(), b.data());
  EXPECT_EQ(b[1], 2);
  EXPECT_EQ(a, (SharedVector<int>{1, 7, 3}));
  const int* own = a.data();
  a[2] = 8;  // not shared: no copy
  EXPECT_EQ(std::as_const(a).data(), own);
  a.push_back(9);
  EXPECT_EQ(std::vector<int>(a), (std::vector<int>{1, 7, 8, 9}));
  SharedVector<int> c = a;
  c.clear();
  EXPECT_TRUE(c.empty());
  EXPECT_EQ(a.size(), 4u);
  c = std::move(a);
  EXPECT_EQ(c.size(), 4u);
  EXPECT_TRUE(a.empty());
}

// A copy of a scene that a parameter moves: it holds nothing again but what moves.
TEST(SharedVector, CopiesOfScenesShareMeshes) {
  const TempFiles files;
  SceneParts parts;
  parts.body = square("box", 1, 0, {}, diffuse("clay", "0.5, 0.5, 0.5"));
  const Scene original = make_scene(files, parts);
  Scene copy = deep_copy(original);
  find_parameter(original, "box.translate.x").seed(copy, 0);
  const Mesh &before = original.shapes[0].mesh, &after = std::as_const(copy).shapes[0].mesh;
  EXPECT_EQ(before.positions.data(), after.positions.data());
  EXPECT_EQ(before.faces.data(), after.faces.data());
  EXPECT_EQ(before.weld.data(), after.weld.data());
  EXPECT_TRUE(after.position_tangents.all_alike());
  EXPECT_EQ(after.position_tangents.size(), before.positions.size());
}

}  // namespace
}  // namespace limn
