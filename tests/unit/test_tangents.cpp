// Directions of growing u, and how they follow the vertices.
#include <gtest/gtest.h>

#include "limn/core/rng.h"
#include "limn/core/tangent.h"
#include "limn/core/texture.h"

namespace limn {
namespace {

// A mesh with smooth normals and texture coordinates at its vertices.
Mesh textured(std::vector<Vec3f> positions, std::vector<FaceIndices> faces, std::vector<Vec3f> uv) {
  Mesh mesh = make_mesh(std::move(positions), std::move(faces), false, {}, nullptr);
  mesh.textured = mesh.has_tangents = true;
  mesh.uv_source = UvSource::kPlane;
  mesh.uv_places = std::move(uv);
  mesh.uv_ids = mesh.faces;
  update_shading_normals(mesh);
  return mesh;
}

// A bent sheet without symmetry.
Mesh sheet() {
  return textured({{0.1f, 0.2f, 2}, {1, 1.3f, 0}, {-1, 1, 0.1f}, {-1.2f, -1, 0}, {1, -0.8f, 0.3f}},
                  {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}},
                  {{0.3f, 0.4f, 0}, {0.9f, 0.8f, 0}, {0.1f, 1, 0}, {0, 0.1f, 0}, {0.8f, 0, 0}});
}

Vec3d tangent_at(const Mesh& mesh, FaceId face, double b1, double b2) {
  const Rgb<double> t = make_tangent()->eval(texture_point<double>(mesh, face, std::array{b1, b2}));
  return normalize(Vec3d{t.r, t.g, t.b});
}

TEST(Tangents, FollowU) {
  // u = x, v = x + y: where v stays, y falls.
  const Mesh mesh = textured({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}},
                             {{0, 0, 0}, {1, 1, 0}, {1, 2, 0}, {0, 1, 0}});
  for (uint32_t f = 0; f < 2; ++f) {
    const Vec3d t = tangent_at(mesh, FaceId(f), 0.3, 0.2);
    EXPECT_NEAR(length(t - normalize(Vec3d{1, -1, 0})), 0, 1e-12);
  }
}

// Both sides of a fold where u is mirrored keep their own direction; where u goes on by an integer
// they share one.
TEST(Tangents, FacesOfOneChartShareThem) {
  const std::vector<Vec3f> roof{{-1, 0, 0}, {0, 0, 1}, {0, 1, 1}, {-1, 1, 0}, {1, 0, 0}, {1, 1, 0}};
  const std::vector<FaceIndices> faces{{0, 1, 2}, {0, 2, 3}, {1, 4, 5}, {1, 5, 2}};
  const Mesh mirrored =
      textured(roof, faces, {{1, 0, 0}, {0, 0, 0}, {0, 1, 0}, {1, 1, 0}, {1, 0, 0}, {1, 1, 0}});
  EXPECT_NEAR(dot(tangent_at(mirrored, FaceId(0), 1, 0), normalize(Vec3d{-1, 0, -1})), 1, 1e-12);
  EXPECT_NEAR(dot(tangent_at(mirrored, FaceId(2), 0, 0), normalize(Vec3d{1, 0, -1})), 1, 1e-12);
  Mesh around =
      textured(roof, faces, {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}});
  around.uv_places.push_back({0, 0, 0});
  around.uv_places.push_back({0, 1, 0});
  around.uv_ids[2] = {6, 4, 5};
  around.uv_ids[3] = {6, 5, 7};
  update_shading_normals(around);
  EXPECT_NEAR(dot(tangent_at(around, FaceId(0), 1, 0), Vec3d{1, 0, 0}), 1, 1e-12);
  EXPECT_EQ(around.u_ids[0][1], around.u_ids[2][0]);
}

// Without texture coordinates in a file, along the first side of each face.
Mesh sheet_without_uv() {
  Mesh mesh = sheet();
  mesh.uv_source = UvSource::kFaces;
  mesh.uv_places = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.uv_ids = std::vector<FaceIndices>(mesh.faces.size(), {0, 1, 2});
  update_shading_normals(mesh);
  return mesh;
}

TEST(Tangents, OfFacesWithoutUvAreTheirSides) {
  const Mesh mesh = sheet_without_uv();
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const auto p = face_corners<double>(mesh, FaceId(f));
    for (const double b : {0.0, 0.3}) {
      EXPECT_NEAR(dot(tangent_at(mesh, FaceId(f), b, 0.2), normalize(p[1] - p[0])), 1, 1e-12);
    }
  }
}

class TangentsOf : public testing::TestWithParam<Mesh (*)()> {};

TEST_P(TangentsOf, DerivativesMatchDifferences) {
  Mesh mesh = GetParam()();
  const Vec3d velocity[5] = {{1, 0.5, 0}, {0, 1, 2}, {-1, 0, 1}, {0.3, 0.7, 0}, {0, 0, -1}};
  const auto moved = [&](double h) {
    Mesh copy = mesh;
    for (int i = 0; i < 5; ++i) {
      copy.positions[i] = cast<float>(cast<double>(mesh.positions[i]) + velocity[i] * h);
    }
    update_shading_normals(copy);
    return copy;
  };
  const double h = 0x1p-8;
  const Mesh up = moved(h), down = moved(-h);
  mesh.position_tangents.resize(5);
  for (int i = 0; i < 5; ++i) {
    mesh.position_tangents.set(
        i, {{0, velocity[i][0], 0, 0}, {0, velocity[i][1], 0, 0}, {0, velocity[i][2], 0, 0}});
  }
  update_shading_normals(mesh);
  ASSERT_EQ(mesh.u_tangents.size(), mesh.u_directions.size());
  // Truncation h^2 times third derivatives of order 10, rounding of positions 2^-24 over h.
  const double bound = 10 * h * h + 4 * 0x1p-24 / h;
  for (size_t i = 0; i < mesh.u_directions.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      const double difference = (up.u_directions[i][k] - down.u_directions[i][k]) / (2 * h);
      EXPECT_NEAR(mesh.u_tangents[i][k][1], difference, bound);
    }
  }
}

TEST_P(TangentsOf, AdjointIsTheTranspose) {
  Mesh mesh = GetParam()();
  Rng rng(1, 2, 3);
  const auto random_vector = [&] {
    const double x = rng.uniform(), y = rng.uniform(), z = rng.uniform();
    return Vec3d{2 * x - 1, 2 * y - 1, 2 * z - 1};
  };
  std::vector<Vec3d> velocity, of_directions, of_positions(mesh.positions.size());
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    velocity.push_back(random_vector());
    const Vec3d& v = velocity[i];
    mesh.position_tangents.push_back({{v.x, 0, 0, 0}, {v.y, 0, 0, 0}, {v.z, 0, 0, 0}});
  }
  update_u_tangents(mesh);
  double forward = 0;
  for (const Vec3<Lanes> t : mesh.u_tangents) {
    of_directions.push_back(random_vector());
    const Vec3d& w = of_directions.back();
    forward += w.x * t.x[0] + w.y * t.y[0] + w.z * t.z[0];
  }
  pull_back_u_directions(mesh, of_directions, of_positions);
  double reverse = 0;
  for (size_t i = 0; i < velocity.size(); ++i) reverse += dot(of_positions[i], velocity[i]);
  EXPECT_NEAR(reverse, forward, 1e-12);
  EXPECT_NE(forward, 0);
}

INSTANTIATE_TEST_SUITE_P(All, TangentsOf, testing::Values(sheet, sheet_without_uv));

}  // namespace
}  // namespace limn
