// Where lines meet lifted points, against fine triangles between these points.
#include "integrators/terms/lifted_faces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "limn/core/rng.h"
#include "limn/core/surface_point.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr int kCells = 40;  // along each side of a face

// Lifted points of a face over a grid, as rays find them.
struct Grid {
  FaceRef face;
  double side;
  double size;  // of the face's longest side
  Vec3d up;     // its normal on this side
  std::vector<Vec3d> x, p;

  Grid(const Scene& scene, FaceRef of, double side_of) : face(of), side(side_of) {
    const Mesh& mesh = scene.shape(face.shape).mesh;
    const auto c = face_corners<double>(mesh, face.face);
    size = std::max({length(c[1] - c[0]), length(c[2] - c[1]), length(c[0] - c[2])});
    const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
    up = n * (side / length(n));
    for (int i = 0; i <= kCells; ++i) {
      for (int j = 0; j <= kCells - i; ++j) {
        const Vec3d at = c[0] + ((c[1] - c[0]) * i + (c[2] - c[0]) * j) * (1.0 / kCells);
        x.push_back(at);
        p.push_back(surface_on_ray<double>(scene, face, at + up, -up).p);
      }
    }
  }
  static int index(int i, int j) { return i * (kCells + 1) - i * (i - 1) / 2 + j; }
};

// Points of the face over which the line along frame.n through y passes fine triangles behind y.
// Not where triangles nearby turn the other way, as the line sees them: zeros vanish in pairs at
// such a fold, and triangles say only about where.
std::vector<Vec3d> pierced(const Grid& grid, const Vec3d& y, const Frame& frame) {
  constexpr int kFold = 5;
  std::vector<Vec3d> seen, found;
  for (const Vec3d& p : grid.p) seen.push_back(frame.to_local(p - y));
  const auto turn = [](const Vec3d& a, const Vec3d& b) { return a.x * b.y - a.y * b.x; };
  const auto area = [&](int i, int j) {
    const Vec3d& a = seen[Grid::index(i, j)];
    return turn(seen[Grid::index(i + 1, j)] - a, seen[Grid::index(i, j + 1)] - a);
  };
  const auto is_steady = [&](int i, int j, double sum) {
    for (int k = std::max(i - kFold, 0); k <= i + kFold; ++k)
      for (int l = std::max(j - kFold, 0); l <= j + kFold && k + l < kCells; ++l)
        if (area(k, l) * sum <= 0) return false;
    return true;
  };
  const auto test = [&](int i, int j, const std::array<int, 3>& ids) {
    const auto [a, b, c] = ids;
    const double of_a = turn(seen[b], seen[c]), of_b = turn(seen[c], seen[a]),
                 of_c = turn(seen[a], seen[b]);
    if (std::min({of_a, of_b, of_c}) < 0 && std::max({of_a, of_b, of_c}) > 0) return;
    const double sum = of_a + of_b + of_c;
    if (sum == 0 || (seen[a].z * of_a + seen[b].z * of_b + seen[c].z * of_c) / sum <= 0) return;
    if (!is_steady(i, j, sum)) return;
    found.push_back((grid.x[a] * of_a + grid.x[b] * of_b + grid.x[c] * of_c) * (1 / sum));
  };
  for (int i = 0; i < kCells; ++i) {
    for (int j = 0; j < kCells - i; ++j) {
      const int a = Grid::index(i, j), b = Grid::index(i + 1, j), c = Grid::index(i, j + 1);
      test(i, j, {a, b, c});
      if (i + j + 2 <= kCells) test(i, j, {b, Grid::index(i + 1, j + 1), c});
    }
  }
  return found;
}

int count_near(const std::vector<Vec3d>& points, const Vec3d& x, double radius) {
  return static_cast<int>(std::count_if(points.begin(), points.end(), [&](const Vec3d& other) {
    return length(other - x) <= radius;
  }));
}

// name: "waves" or "torus": hills, hollows and saddles; both, with normals at random: faces that
// bend, and some that do not lift.
Mesh test_mesh(const std::string& name, double noise) {
  Mesh mesh = name == "torus" ? torus_mesh(8, 6) : grid_mesh(5);
  if (name == "waves")
    for (Vec3f& x : mesh.positions)
      x.z = static_cast<float>(0.3 * std::sin(4.0 * x.x + 0.3) * std::cos(4.0 * x.y));
  mesh = with_smooth_normals(mesh);
  Rng rng(7, 1, 0);
  for (Vec3d& n : mesh.normals) {
    n += random_direction(rng) * noise;
    n = n * (1 / length(n));
  }
  return mesh;
}

class LiftedFacesOf : public testing::TestWithParam<std::tuple<const char*, double>> {};

// Lines graze the mesh, where one is met most often twice. What is found lies on line and lifted
// face, and what fine triangles show is found.
TEST_P(LiftedFacesOf, AllCrossingsAreFound) {
  const auto [name, noise] = GetParam();
  const TempFiles files;
  SceneParts parts;
  const Mesh mesh = test_mesh(name, noise);
  parts.body = obj_shape("body", write_mesh(files, "body.obj", mesh), false, 1, {},
                         "<bsdf type=\"twosided\">" + diffuse("clay", "0.6, 0.6, 0.6") + "</bsdf>");
  Scene scene = make_scene(files, parts);
  scene.shapes[0].mesh = mesh;  // with its normals
  const LiftedFaces lifted(scene);
  std::vector<Grid> grids;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f)
    for (const double side : {1.0, -1.0})
      if (lifted.has({ShapeId(0), FaceId(f)}))
        grids.push_back({scene, {ShapeId(0), FaceId(f)}, side});

  Rng rng(3, 1, 0);
  std::vector<LiftedCrossing> crossings;
  int shown = 0, missed = 0, twice = 0, wrong = 0;
  for (int i = 0; i < 250; ++i) {
    const Grid& aim = grids[static_cast<size_t>(rng.uniform() * static_cast<double>(grids.size()))];
    const size_t at = static_cast<size_t>(rng.uniform() * static_cast<double>(aim.p.size()));
    const auto c = face_corners<double>(scene.shape(aim.face.shape).mesh, aim.face.face);
    const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
    const Vec3d w = cross(n, random_direction(rng)) + n * (0.2 * (rng.uniform() - 0.5));
    const Frame frame(w * (1 / length(w)));
    const Vec3d y = aim.p[at] - w * (2 / length(w));
    lifted.cross({y, w, {1, 0, 0}, w, true}, 100 / length(w), crossings);
    for (const Grid& grid : grids) {
      const double near = 3 * grid.size / kCells;
      const std::vector<Vec3d> known = pierced(grid, y, frame);
      std::vector<Vec3d> found;
      for (const LiftedCrossing& crossing : crossings) {
        if (crossing.face.face != grid.face.face || crossing.side != grid.side) continue;
        found.push_back(crossing.x);
        const Vec3d above = crossing.x + grid.up;
        const Vec3d p = surface_on_ray<double>(scene, grid.face, above, -grid.up).p;
        wrong += length(p - crossing.p) + length(cross(p - y, frame.n)) > 1e-6 * grid.size ||
                 length(p - y - w * crossing.s) > 1e-6 * grid.size;
      }
      for (const Vec3d& x : found) twice += count_near(found, x, 1e-9 * grid.size) > 1;
      for (const Vec3d& x : known) {
        ++shown;
        missed += count_near(found, x, near) == 0;
      }
    }
  }
  EXPECT_GT(shown, 250);
  EXPECT_EQ(missed, 0) << "of " << shown;
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(twice, 0);
}

INSTANTIATE_TEST_SUITE_P(Meshes, LiftedFacesOf,
                         testing::Combine(testing::Values("waves", "torus"),
                                          testing::Values(0.0, 0.5)));

}  // namespace
}  // namespace limn
