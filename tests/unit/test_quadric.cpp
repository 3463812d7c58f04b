// The paper's forest: what its nodes are fitted with, and that they lose no edge of E(p).
#include <gtest/gtest.h>

#include <cmath>

#include "../support/meshes.h"
#include "edgetree/forest/linear_program.h"
#include "edgetree/forest/normaliser.h"

namespace limn {
namespace {

// Planes on all sides have no normaliser, whatever finds that out; others have one that separates
// them, if the linear program has.
TEST(Normaliser, IsWhereTheLinearProgramHasOne) {
  Rng rng(26, 0, 0);
  int none = 0, some = 0;
  for (int i = 0; i < 2000; ++i) {
    std::vector<Eigen::Vector4d> planes;
    const Vec3d lean = random_direction(rng) * (2 * rng.uniform());
    const double shift = 2 * rng.uniform() - 1, flat = i % 5 == 0 ? 1e-3 : 1;
    for (int k = 0; k < 1 + i % 40; ++k) {
      const Vec3d n = normalize(random_direction(rng) * flat + lean);
      planes.emplace_back(n.x, n.y, n.z, shift + flat * (2 * rng.uniform() - 1));
    }
    const auto least = [&](const Eigen::Vector4d& z) {
      double product = 1e300;
      for (const auto& q : planes) product = std::min(product, q.dot(z));
      return product;
    };
    const Eigen::Vector4d found = normaliser_of(planes), other = separating_direction(planes);
    EXPECT_TRUE(found.norm() == 0 || std::fabs(found.norm() - 1) < 1e-12);
    EXPECT_EQ(found.norm() > 0, other.norm() > 0 && least(other / other.norm()) >= 0x1.0p-20) << i;
    if (found.norm() > 0) {
      EXPECT_GE(least(found), 0x1.0p-20);
    }
    ++(found.norm() > 0 ? some : none);
  }
  EXPECT_GT(some, 300);
  EXPECT_GT(none, 300);
}

}  // namespace
}  // namespace limn
