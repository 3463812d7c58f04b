// Curves as tubes: where their points and normals lie, and how files of curves are read.
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/error.h"
#include "src/mesh/curves.h"
#include "support/temp_files.h"

namespace limn {
namespace {

// Calls check(corner, its normal) at the corners of all faces; faces must look the way of their
// normals.
template <class Check>
void for_each_corner(const RawMesh& mesh, const Check& check) {
  ASSERT_FALSE(mesh.faces.empty());
  ASSERT_EQ(mesh.faces.size(), mesh.normal_ids.size());
  ASSERT_EQ(mesh.faces.size(), mesh.uv_ids.size());
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto& face = mesh.faces[f];
    const Vec3d p[3] = {mesh.positions[face[0]], mesh.positions[face[1]], mesh.positions[face[2]]};
    const Vec3d across = cross(p[1] - p[0], p[2] - p[0]);
    EXPECT_GT(length(across), 0);
    for (int k = 0; k < 3; ++k) {
      const Vec3d n = normalize(mesh.normals[mesh.normal_ids[f][k]]);
      EXPECT_GT(dot(n, across), 0.5 * length(across));
      check(p[k], n);
    }
  }
}

double area(const RawMesh& mesh) {
  double sum = 0;
  for (const FaceIndices& f : mesh.faces) {
    const Vec3d a = mesh.positions[f[0]];
    sum += length(cross(mesh.positions[f[1]] - a, mesh.positions[f[2]] - a)) / 2;
  }
  return sum;
}

// Six times the volume of a closed mesh.
double six_volumes(const RawMesh& mesh) {
  double sum = 0;
  for (const FaceIndices& f : mesh.faces) {
    sum += determinant(mesh.positions[f[0]], mesh.positions[f[1]], mesh.positions[f[2]]);
  }
  return sum;
}

TEST(Curves, SplineOfEvenPointsIsACylinder) {
  Curve curve;
  for (int i = 0; i < 6; ++i) curve.push_back({{1, 2, 3 + 0.5 * i}, 0.25});
  const RawMesh mesh = make_spline_tubes(std::vector<Curve>{curve});
  for_each_corner(mesh, [](const Vec3d& p, const Vec3d& n) {
    EXPECT_GE(p.z, 3.5 - 1e-12);
    EXPECT_LE(p.z, 5 + 1e-12);
    const Vec3d out{(p.x - 1) / 0.25, (p.y - 2) / 0.25, 0};
    EXPECT_NEAR(length(out - n), 0, 1e-12);
  });
  EXPECT_NEAR(area(mesh), 2 * 32 * std::sin(kPi / 32) * 0.25 * 1.5, 1e-12);
}

// The normals of a tube that bends and grows are those of the surface, whose tangents are found by
// differences over the mesh.
TEST(Curves, SplineNormalsAreAcrossTheSurface) {
  const Curve curve{{{-1, 0, 0}, 0.1},
                    {{0, 1, 0.2}, 0.15},
                    {{1, 0, 0}, 0.3},
                    {{2, 2, 1}, 0.2},
                    {{3, 1, -1}, 0.1}};
  const RawMesh mesh = make_spline_tubes(std::vector<Curve>{curve});
  double worst = 1;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto& face = mesh.faces[f];
    const Vec3d a = mesh.positions[face[0]];
    const Vec3d across = normalize(cross(mesh.positions[face[1]] - a, mesh.positions[face[2]] - a));
    Vec3d mean;
    for (const uint32_t k : mesh.normal_ids[f]) mean += normalize(mesh.normals[k]);
    worst = std::min(worst, dot(normalize(mean), across));
  }
  EXPECT_GT(worst, 0.998);  // the normal of a face and of its middle, 32 around and 16 along
}

// Through a direction at which the frame of texture coordinates turns by half a circle.
TEST(Curves, TubesAreNotTwisted) {
  const Curve curve{{{0, 0, -2}, 0.1},    {{0.01, 0, -1}, 0.1}, {{0, 0.01, 0}, 0.1},
                    {{-0.01, 0, 1}, 0.1}, {{0, -0.01, 2}, 0.1}, {{0.01, 0, 3}, 0.1}};
  for_each_corner(make_spline_tubes(std::vector<Curve>{curve}), [](const Vec3d&, const Vec3d&) {});
}

// One segment, one radius twice the other: every point lies on the hull of both spheres.
TEST(Curves, LinearSegmentTouchesItsSpheres) {
  const Vec3d a{1, 0, 0}, b{1, 0, 4};
  const RawMesh mesh = make_linear_tubes(std::vector<Curve>{Curve{{a, 1}, {b, 0.5}}});
  for_each_corner(mesh, [&](const Vec3d& p, const Vec3d& n) {
    const double from_a = length(p - a) - 1, from_b = length(p - b) - 0.5;
    const double least = std::min(std::abs(from_a), std::abs(from_b));
    EXPECT_NEAR(least, 0, 1e-9);
    const bool first = std::abs(from_a) < std::abs(from_b);
    EXPECT_NEAR(length(n - normalize(p - (first ? a : b))), 0, 1e-9);
  });
  // Two caps and a frustum, for the sine s of the latitude at which the cone touches.
  const double s = 0.125, c2 = 1 - s * s;
  const auto cap = [](double r, double h) { return kPi * h * h * (3 * r - h) / 3; };
  const double height = 4 + 0.5 * s - s;
  const double exact =
      cap(1, 1 + s) + cap(0.5, 0.5 * (1 - s)) + kPi * height * c2 * (1 + 0.5 + 0.25) / 3;
  EXPECT_NEAR(six_volumes(mesh) / 6 / exact, 1, 0.01);
}

TEST(Curves, ManySegmentsAreCoarser) {
  std::vector<Curve> curves(20000);
  for (size_t k = 0; k < curves.size(); ++k) {
    const double x = static_cast<double>(k);
    curves[k] = {{{x, 0, 0}, 0.1}, {{x, 1, 0}, 0.1}, {{x, 2, 0}, 0.1}, {{x, 3, 0}, 0.1}};
  }
  const size_t faces = make_spline_tubes(curves).faces.size();
  EXPECT_GT(faces, 500000);
  EXPECT_LE(faces, 2000000);
}

TEST(Curves, FilesAreRead) {
  const TempFiles files;
  std::string file;
  const auto curves_of = [&](const std::string& text) {
    file = files.write("curves.txt", text);
    Matrix4 place;
    place.m[0][3] = 10;
    place.m[1][1] = 2;
    return parse_curves(file, 2, place);
  };
  const auto curves = curves_of("\n0 1 2 .5\r\n 3\t4 5 0\n\n\n1 1 1 1\n2 2 2 2\n3 3 3 3");
  ASSERT_EQ(curves.size(), 2);
  ASSERT_EQ(curves[0].size(), 2);
  EXPECT_EQ(curves[0][0].p, (Vec3d{10, 2, 2}));
  EXPECT_EQ(curves[0][0].radius, 0.5);
  EXPECT_EQ(curves[1].size(), 3);

  const std::pair<const char*, const char*> wrong[] = {
      {"", ": error: has no control points"},
      {"0 0 0 1\n\n", ":1:1: error: a curve of 1 control points: needs 2"},
      {"0 0 0 1\n1 1 1\n", ":2:1: error: expected four numbers: x y z radius"},
      {"0 0 0 1\n1 1 one 1\n", ":2:1: error: expected a number, not \"one\""},
      {"0 0 nan 1\n", ":1:1: error: expected a number, not \"nan\""},
      {"0 0 0 -1\n", ":1:1: error: the radius must not be negative"},
  };
  for (const auto& [text, message] : wrong) {
    try {
      curves_of(text);
      ADD_FAILURE() << text;
    } catch (const InputError& error) {
      EXPECT_EQ(error.what(), file + message);
    }
  }
}

}  // namespace
}  // namespace limn
