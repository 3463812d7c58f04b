// Curves where surfaces cross: against all pairs of faces, lengths in closed form, continuity,
// velocities, and nothing where surfaces only touch.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <tuple>

#include "edgetree/forest/forest_build.h"
#include "limn/edgetree/crossing_curves.h"
#include "support/edge_mesh_fault.h"
#include "support/forest_fault.h"
#include "support/meshes.h"

namespace limn {
namespace {

using Segments = std::vector<IntersectionSegment>;

std::vector<const Mesh*> pointers(const std::vector<Mesh>& meshes) {
  std::vector<const Mesh*> result;
  for (const Mesh& mesh : meshes) result.push_back(&mesh);
  return result;
}

Segments found(const std::vector<Mesh>& meshes, int threads = 1) {
  const auto all = pointers(meshes);
  return find_intersections(all, find_face_pairs(all, {}, threads), threads);
}

double length_of(const Segments& segments) {
  double sum = 0;
  for (const IntersectionSegment& s : segments) sum += length(s.ends[1] - s.ends[0]);
  return sum;
}

Mesh placed(const Mesh& mesh, uint64_t seed, double scale, const Vec3d& offset) {
  Rng rng(seed, 0, 0);
  Vec3d rows[3];
  random_rotation(rng, rows);
  return transformed(mesh, rows, scale, offset);
}

Mesh shifted(const Mesh& mesh, double scale, const Vec3d& offset) {
  const Vec3d rows[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  return transformed(mesh, rows, scale, offset);
}

std::array<Vec3d, 3> corners_of(const Mesh& mesh, uint32_t face) {
  std::array<Vec3d, 3> corners;
  for (int i = 0; i < 3; ++i) corners[i] = cast<double>(mesh.positions[mesh.faces[face][i]]);
  return corners;
}

double volume(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
  return determinant(b - a, c - a, d - a);
}

// Where the segment from p to q passes through the triangle: p and q lie on different sides of it,
// and all tetrahedra of the segment and a side of the triangle turn the same way.
bool passes(const Vec3d& p, const Vec3d& q, const std::array<Vec3d, 3>& t, Vec3d& x) {
  const double at_p = volume(p, t[0], t[1], t[2]), at_q = volume(q, t[0], t[1], t[2]);
  if (at_p * at_q >= 0) return false;
  const double u = volume(p, q, t[0], t[1]);
  const double v = volume(p, q, t[1], t[2]);
  const double w = volume(p, q, t[2], t[0]);
  x = p + (q - p) * (at_p / (at_p - at_q));
  return (u > 0 && v > 0 && w > 0) || (u < 0 && v < 0 && w < 0);
}

// The oracle: two faces without a corner in common cross where sides of one pass through the other,
// twice altogether.
Segments all_pairs(const std::vector<Mesh>& meshes) {
  Segments segments;
  const auto pair_up = [&](FaceRef a, FaceRef b) {
    const auto s = corners_of(meshes[a.shape.index()], a.face.index());
    const auto t = corners_of(meshes[b.shape.index()], b.face.index());
    for (const Vec3d& corner : s)
      if (std::ranges::find(t, corner) != t.end()) return;
    std::vector<Vec3d> points;
    for (int k = 0; k < 3; ++k) {
      Vec3d x;
      if (passes(s[k], s[(k + 1) % 3], t, x)) points.push_back(x);
      if (passes(t[k], t[(k + 1) % 3], s, x)) points.push_back(x);
    }
    if (points.size() == 2) segments.push_back({{a, b}, {points[0], points[1]}});
    EXPECT_TRUE(points.empty() || points.size() == 2);
  };
  for (uint32_t i = 0; i < meshes.size(); ++i)
    for (uint32_t f = 0; f < meshes[i].faces.size(); ++f)
      for (uint32_t j = i; j < meshes.size(); ++j)
        for (uint32_t g = j == i ? f + 1 : 0; g < meshes[j].faces.size(); ++g)
          pair_up({ShapeId(i), FaceId(f)}, {ShapeId(j), FaceId(g)});
  return segments;
}

// The same pairs in the same order, the same ends in any order, to `rounding` of the scene's size.
void expect_same(const Segments& segments, const Segments& expected, double rounding) {
  ASSERT_EQ(segments.size(), expected.size());
  for (size_t i = 0; i < segments.size(); ++i) {
    ASSERT_EQ(segments[i].faces, expected[i].faces);
    const auto& [a, b] = segments[i].ends;
    const auto& [c, d] = expected[i].ends;
    EXPECT_LE(std::min(length(a - c) + length(b - d), length(a - d) + length(b - c)), rounding);
  }
}

class CrossingsAtScale : public testing::TestWithParam<double> {};

TEST_P(CrossingsAtScale, AreThoseOfAllPairs) {
  const double scale = GetParam();
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const std::vector<Mesh> meshes = {
        placed(icosphere_mesh(2), seed, scale, {}),
        placed(cube_mesh(), seed + 100, 0.7 * scale, Vec3d{0.6, 0.3, -0.2} * scale),
        placed(torus_mesh(24, 12), seed + 200, scale, Vec3d{-0.5, 0, 0.4} * scale)};
    const Segments expected = all_pairs(meshes);
    EXPECT_GT(expected.size(), 100u);
    expect_same(found(meshes), expected, 1e-10 * scale);
  }
}

INSTANTIATE_TEST_SUITE_P(, CrossingsAtScale, testing::Values(1e-3, 1.0, 1e3));

TEST(Crossings, OfOneShapeWithItself) {
  const std::vector<Mesh> both = {joined(placed(icosphere_mesh(2), 1, 1, {0, 0, 0}),
                                         placed(icosphere_mesh(2), 2, 1, {0.9, 0.1, 0}))};
  const Segments expected = all_pairs(both);
  EXPECT_GT(expected.size(), 50u);
  expect_same(found(both), expected, 1e-10);
}

TEST(Crossings, AreTheSameOnAnyNumberOfThreads) {
  const std::vector<Mesh> meshes = {placed(icosphere_mesh(4), 1, 1, {}),
                                    placed(torus_mesh(96, 48), 2, 1, {0.3, 0.2, 0.1})};
  const Segments one = found(meshes, 1), seven = found(meshes, 7);
  EXPECT_GT(one.size(), 500u);
  ASSERT_EQ(one.size(), seven.size());
  for (size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].faces, seven[i].faces);
    EXPECT_EQ(one[i].ends, seven[i].ends);
  }
}

// Faces with a corner in common cross along a line from there, or meet in the corner alone.
TEST(Crossings, OfFacesWithACommonCorner) {
  const Mesh crossing =
      make_mesh({{0, 0, 0}, {2, 1, 0}, {2, -1, 0}, {1, 0, 1}, {1, 0, -1}}, {{0, 1, 2}, {0, 3, 4}});
  const Segments segments = found({crossing});
  ASSERT_EQ(segments.size(), 1u);
  EXPECT_EQ(length_of(segments), 1);
  const Mesh apart = make_mesh({{0, 0, 0}, {2, 1, 0}, {2, -1, 0}, {-1, 0, 1}, {-1, 0, -1}},
                               {{0, 1, 2}, {0, 3, 4}});
  EXPECT_TRUE(found({apart}).empty());
}

// Every end of a closed curve is the end of two segments, bit by bit.
void expect_closed(const Segments& segments) {
  std::map<std::tuple<double, double, double>, int> ends;
  for (const IntersectionSegment& s : segments)
    for (const Vec3d& x : s.ends) ++ends[{x.x, x.y, x.z}];
  for (const auto& [x, count] : ends) EXPECT_EQ(count, 2);
}

// A square, as long as the cube's four sides, whatever turns both; continuous where no edge meets
// an edge.
TEST(Crossings, OfAPlaneAndACubeAreASquare) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const std::vector<Mesh> meshes = {
        placed(shifted(cube_mesh(), 1, {0.21, 0.13, 0.3}), seed, 1, {0.5, 1, -2}),
        placed(shifted(grid_mesh(7), 3, {}), seed, 1, {0.5, 1, -2})};
    const Segments segments = found(meshes);
    EXPECT_NEAR(length_of(segments), 8, 1e-5);  // positions were rounded to float
    expect_closed(segments);
  }
}

// A circle around the middle: the polygon falls short of its length in proportion to the square of
// the edges' length.
TEST(Crossings, OfTwoSpheresAreACircle) {
  double before = 0;
  for (int levels = 2; levels < 6; ++levels) {
    const Segments segments = found({placed(icosphere_mesh(levels), 1, 1, {}),
                                     placed(icosphere_mesh(levels), 2, 1, {1, 0.3, 0.1})});
    expect_closed(segments);
    const double distance = std::sqrt(1 + 0.09 + 0.01);
    const double missing = 2 * kPi * std::sqrt(1 - distance * distance / 4) - length_of(segments);
    EXPECT_GT(missing, 0);
    if (before > 0) {
      EXPECT_NEAR(before / missing, 4, 0.5);
    }
    before = missing;
  }
}

// Edges of a plane cut into many faces lie in the planes of the others, but for rounding.
TEST(Crossings, NoneWithinAPlane) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const Mesh grid = placed(grid_mesh(24), seed, 1.3, {0.2, 1, -0.4});
    EXPECT_TRUE(found({grid}).empty()) << seed;
    const Mesh other = placed(shifted(grid_mesh(7), 0.9, {0.3, 0.1, 0}), seed, 1.3, {0.2, 1, -0.4});
    EXPECT_TRUE(found({grid, other}).empty()) << seed;
  }
}

TEST(Crossings, NoneWhereOneLiesWithinTheOther) {
  EXPECT_TRUE(found({icosphere_mesh(2), placed(icosphere_mesh(2), 3, 0.5, {0, 0, 0})}).empty());
}

// A box on a floor, boxes side by side, on an edge, on a corner: turned together, so that rounding
// puts them apart or into one another.
TEST(Crossings, NoneWhereShapesTouch) {
  const Mesh floor = shifted(grid_mesh(5), 4, {});
  const Mesh box = shifted(cube_mesh(), 1, {0.125, 0.25, 1});
  for (uint64_t seed = 0; seed < 20; ++seed) {
    for (const Vec3d& offset :
         {Vec3d{2, 0, 0}, Vec3d{2, 0.75, 0.25}, Vec3d{2, 2, 0}, Vec3d{2, 2, 2}}) {
      const std::vector<Mesh> meshes = {placed(floor, seed, 1, {3, 1, 2}),
                                        placed(box, seed, 1, {3, 1, 2}),
                                        placed(shifted(box, 1, offset), seed, 1, {3, 1, 2})};
      EXPECT_TRUE(found(meshes).empty()) << seed;
    }
  }
}

TEST(Crossings, NoneOfFacesWithoutArea) {
  const Mesh needle = make_mesh({{-1, 0, -1}, {0, 0, 0}, {1, 0, 1}}, {{0, 1, 2}});
  const Mesh point = make_mesh({{0, 0, 0}, {0, 0, 0}, {1, 0, 1}}, {{0, 1, 2}});
  EXPECT_TRUE(found({grid_mesh(3), needle, point}).empty());
  EXPECT_TRUE(found({}).empty());
}

// As edges: valid by themselves and in the forest's trees; what is broken is found.
TEST(Crossings, AreEdges) {
  std::vector<Mesh> meshes = {placed(icosphere_mesh(2), 1, 1, {}),
                              placed(cube_mesh(), 2, 0.8, {0.7, 0.4, 0.1})};
  for (Mesh& mesh : meshes) set_test_tangents(mesh);
  const Segments segments = found(meshes);
  const EdgeMesh edges = intersection_edges(pointers(meshes), segments);
  EXPECT_EQ(fault_of(edges), "");
  ASSERT_EQ(edges.count(EdgeClass::kIntersection), segments.size());
  for (size_t i = 0; i < segments.size(); ++i) {
    const auto faces = edges.faces_around(EdgeId(static_cast<uint32_t>(i)));
    EXPECT_TRUE(std::ranges::equal(faces, segments[i].faces));
  }
  const EdgeSamplerInput input{
      {build_edge_mesh(meshes[0], true), build_edge_mesh(meshes[1], true, ShapeId(1)), edges}};
  EXPECT_EQ(fault_of(build_forest(input, 2, {}), input.objects), "");
  EdgeMesh broken = edges;
  broken.incidences[3].through = false;
  EXPECT_EQ(fault_of(broken), "edge 1: a face that crosses ends there");
  broken = edges;
  broken.incident_faces[4].shape = ShapeId::none();
  EXPECT_EQ(fault_of(broken), "edge 2: a face that crosses is of no shape");
  broken = edges;
  broken.shape = ShapeId(7);
  EXPECT_EQ(fault_of(broken), "edge 0: a mesh has an edge where faces cross");
}

// Every plane's own speed is found on the line, which does not move along itself; and the line is
// where the moved faces cross.
TEST(Crossings, MoveWithBothPlanes) {
  std::vector<Mesh> meshes = {placed(icosphere_mesh(1), 1, 1, {}),
                              placed(cube_mesh(), 2, 0.8, {0.7, 0.4, 0.1})};
  for (Mesh& mesh : meshes) set_test_tangents(mesh);
  const auto moved = [&](double h, int lane) {
    std::vector<Mesh> result = meshes;
    for (Mesh& mesh : result)
      for (size_t v = 0; v < mesh.positions.size(); ++v)
        for (int k = 0; k < 3; ++k)
          mesh.positions[v][k] += static_cast<float>(h * mesh.position_tangents[v][k][lane]);
    return result;
  };
  const Segments segments = found(meshes);
  ASSERT_GT(segments.size(), 20u);
  for (const IntersectionSegment& s : segments) {
    const Vec3d x = s.ends[0] * 0.3 + s.ends[1] * 0.7;
    const auto pointed = pointers(meshes);
    const Vec3<Lanes> v = intersection_velocity(pointed, s, x);
    const Vec3<Lanes> v0 = intersection_velocity(pointed, s, s.ends[0]);
    const Vec3<Lanes> v1 = intersection_velocity(pointed, s, s.ends[1]);
    const Vec3d along = normalize(s.ends[1] - s.ends[0]);
    for (int lane = 0; lane < kLanes; ++lane) {
      const auto of = [&](const Vec3<Lanes>& a) { return Vec3d{a.x[lane], a.y[lane], a.z[lane]}; };
      const double size = length(of(v0)) + length(of(v1));
      EXPECT_NEAR(dot(of(v), along), 0, 1e-9 * size);
      EXPECT_NEAR(length(of(v) - of(v0) * 0.3 - of(v1) * 0.7), 0, 1e-9 * size);
    }
  }
  // The area that the lines of lane k sweep, as motion times normal, against moved meshes: by the
  // distance of the moved line from the old point, over a step.
  const double h = 0x1p-10;
  for (int lane = 0; lane < 3; ++lane) {
    const Segments plus = found(moved(h, lane)), minus = found(moved(-h, lane));
    for (const IntersectionSegment& s : segments) {
      const auto same = [&](const IntersectionSegment& other) { return other.faces == s.faces; };
      const auto p = std::ranges::find_if(plus, same), m = std::ranges::find_if(minus, same);
      if (p == plus.end() || m == minus.end()) continue;
      const Vec3d x = (s.ends[0] + s.ends[1]) * 0.5;
      const Vec3d along = normalize(s.ends[1] - s.ends[0]);
      // Where a line meets the plane across the old one at x.
      const auto at = [&](const IntersectionSegment& line) {
        const Vec3d d = line.ends[1] - line.ends[0];
        return line.ends[0] + d * (dot(along, x - line.ends[0]) / dot(along, d));
      };
      const Vec3<Lanes> v = intersection_velocity(pointers(meshes), s, x);
      const Vec3d expected = (at(*p) - at(*m)) / (2 * h);
      const Vec3d velocity{v.x[lane], v.y[lane], v.z[lane]};
      // Rounding to float over the step, larger by the angle between planes and for short lines.
      const double steepness = 1 / length(s.ends[1] - s.ends[0]) + length(velocity);
      EXPECT_NEAR(length(velocity - expected), 0, 1e-3 * steepness) << lane;
    }
  }
}

}  // namespace
}  // namespace limn
