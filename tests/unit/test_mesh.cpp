// Meshes: files read back, welding, normals, built-in shapes.
#include <gtest/gtest.h>

#include <clocale>
#include <cmath>
#include <cstring>

#include "limn/core/mesh.h"
#include "limn/core/scene.h"
#include "support/meshes.h"
#include "support/temp_files.h"

namespace limn {
namespace {

TEST(ReadObj, PolygonsNegativeIndicesAndOddSpacing) {
  const TempFiles files;
  const Mesh mesh = read_mesh(files.write("a.obj",
                                          "# a square\r\nmtllib none.mtl\r\no square\r\n"
                                          "v\t+0 0 0 1\r\nv 1e0 0 0\r\n  v 1 1 0\r\n"
                                          "v 0 1.0 -0.0 0.5 0.5 0.5\r\nvt 0 0\r\ng x\r\n"
                                          "usemtl none\r\ns 1\r\nf -4/1 -3/1 -2/1 -1/1"),
                              false);
  ASSERT_EQ(mesh.positions.size(), 4u);
  ASSERT_EQ(mesh.faces.size(), 2u);
  EXPECT_EQ(mesh.faces[0], (FaceIndices{0, 1, 2}));
  EXPECT_EQ(mesh.faces[1], (FaceIndices{0, 2, 3}));
  EXPECT_EQ(mesh.positions[2], (Vec3f{1, 1, 0}));
  EXPECT_EQ(mesh.normal_source, NormalSource::kComputed);
}

TEST(ReadObj, NumbersAreRoundedOnce) {
  const TempFiles files;
  const Mesh mesh =
      read_mesh(files.write("a.obj",
                            "v 0.1 1e-40 16777217\nv 1 0 0\nv 0 1.00000017881393432617187499 0\n"
                            "f 1 2 3\n"),
                true);
  EXPECT_EQ(mesh.positions[0].x, 0.1f);
  EXPECT_EQ(mesh.positions[0].y, 1e-40f);
  EXPECT_EQ(mesh.positions[0].z, 16777216.0f);
  EXPECT_EQ(mesh.normal_source, NormalSource::kFace);
  EXPECT_TRUE(mesh.normals.empty());
}

TEST(ReadObj, TheLocaleDoesNotMatter) {
  const TempFiles files;
  const std::string file = files.write("a.obj", "v 0.5 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  std::setlocale(LC_ALL, "de_DE.UTF-8");
  EXPECT_EQ(read_mesh(file, true).positions[0].x, 0.5f);
  std::setlocale(LC_ALL, "C");
}

template <class T>
std::string bytes(T value, bool big) {
  char b[sizeof(T)];
  std::memcpy(b, &value, sizeof(T));
  if (big) std::reverse(b, b + sizeof(T));
  return std::string(b, sizeof(T));
}

TEST(ReadPly, AllThreeFormatsAgree) {
  const TempFiles files;
  const float x[3][3] = {{0.25f, 1, -2}, {3, 4, 5.5f}, {-1, 0, 7}};
  std::vector<Mesh> meshes;
  for (const std::string format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    const bool big = format == "binary_big_endian", ascii = format == "ascii";
    std::string text = "ply\r\nformat " + format +
                       " 1.0\ncomment c\nelement extra 1\nproperty list uchar short s\n"
                       "element vertex 3\nproperty double x\nproperty uchar red\nproperty float y\n"
                       "property float z\nelement face 1\nproperty list ushort int vertex_index\n"
                       "property uint tag\nend_header\n";
    text += ascii ? "2 7 8\n"
                  : bytes<uint8_t>(2, big) + bytes<int16_t>(7, big) + bytes<int16_t>(8, big);
    for (const auto& v : x) {
      text += ascii ? std::to_string(v[0]) + " 255 " + std::to_string(v[1]) + " " +
                          std::to_string(v[2]) + "\n"
                    : bytes<double>(v[0], big) + bytes<uint8_t>(255, big) + bytes(v[1], big) +
                          bytes(v[2], big);
    }
    text += ascii ? "3 0 1 2 9\n"
                  : bytes<uint16_t>(3, big) + bytes<int32_t>(0, big) + bytes<int32_t>(1, big) +
                        bytes<int32_t>(2, big) + bytes<uint32_t>(9, big);
    meshes.push_back(read_mesh(files.write("a.ply", text), false));
    ASSERT_EQ(meshes.back().positions.size(), 3u) << format;
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(meshes.back().positions[i], (Vec3f{x[i][0], x[i][1], x[i][2]})) << format;
    }
    EXPECT_EQ(meshes.back().faces, (std::vector<FaceIndices>{{0, 1, 2}}));
  }
}

// A pyramid whose front edge is a texture seam in the second copy.
const std::string kPyramid =
    "v 0 0 2\nv 1 1 0\nv -1 1 0\nv -1 -1 0\nv 1 -1 0\nf 1 2 3\nf 1 3 4\nf 1 4 5\nf 1 5 2\n";
const std::string kSeamPyramid =
    "v 0 0 2\nv 1 1 0\nv -1 1 0\nv -1 -1 0\nv 1 -1 0\nv -0 0 2\nv 1 1 -0\n"
    "f 1 2 3\nf 1 3 4\nf 6 4 5\nf 6 5 7\n";

TEST(Weld, SeamCopiesShareNormals) {
  const TempFiles files;
  const Mesh whole = read_mesh(files.write("a.obj", kPyramid), false);
  const Mesh seam = read_mesh(files.write("b.obj", kSeamPyramid), false);
  EXPECT_EQ(seam.weld, (std::vector<uint32_t>{0, 1, 2, 3, 4, 0, 1}));
  ASSERT_EQ(seam.normals.size(), whole.normals.size());
  for (size_t f = 0; f < whole.faces.size(); ++f) {
    for (int c = 0; c < 3; ++c) {
      EXPECT_EQ(seam.normals[seam.normal_ids[f][c]], whole.normals[whole.normal_ids[f][c]]);
    }
  }
}

TEST(Weld, RepeatedFacesAreLeftOut) {
  // The same corners by copies, from another one on; the other side of a sheet is no repetition.
  const TempFiles files;
  const Mesh mesh = read_mesh(files.write("a.obj",
                                          "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nv 1 0 0\n"
                                          "f 1 2 3\nf 3 4 5\nf 1 3 2\n"),
                              true);
  ASSERT_EQ(mesh.faces.size(), 2u);
  EXPECT_EQ(mesh.faces[0], (FaceIndices{0, 1, 2}));
  EXPECT_EQ(mesh.faces[1], (FaceIndices{0, 2, 1}));
}

TEST(Normals, OfAPyramid) {
  const TempFiles files;
  const Mesh mesh = read_mesh(files.write("a.obj", kPyramid), false);
  EXPECT_NEAR(length(mesh.normals[mesh.normal_ids[0][0]] - Vec3d{0, 0, 1}), 0, 1e-15);
  // Faces have normals (0, 2, 1)/sqrt(5) and so on. Two of equal angles meet at a corner.
  const Vec3d corner = mesh.normals[mesh.normal_ids[0][1]];
  EXPECT_NEAR(length(corner - normalize(Vec3d{1, 1, 1})), 0, 1e-15);
}

TEST(Normals, DoNotDependOnTheScale) {
  const TempFiles files;
  const Mesh mesh = read_mesh(files.write("a.obj", kPyramid), false);
  for (float scale : {0x1p-13f, 0x1p13f}) {
    Mesh scaled = mesh;
    for (Vec3f& p : scaled.positions) p = {p.x * scale, p.y * scale, p.z * scale};
    update_shading_normals(scaled);
    EXPECT_EQ(scaled.normals, mesh.normals);
  }
}

TEST(Normals, TangentsMatchDifferences) {
  const TempFiles files;
  Mesh mesh = read_mesh(files.write("a.obj",
                                    "v 0.1 0.2 2\nv 1 1.3 0\nv -1 1 0.1\nv -1.2 -1 0\n"
                                    "v 1 -0.8 0.3\nf 1 2 3\nf 1 3 4\nf 1 4 5\nf 1 5 2\n"),
                        false);
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
  // Truncation h^2 times third derivatives of order 10, rounding of positions 2^-24 over h.
  const double bound = 10 * h * h + 4 * 0x1p-24 / h;
  for (size_t i = 0; i < mesh.normals.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(mesh.normal_tangents[i][k][1], (up.normals[i][k] - down.normals[i][k]) / (2 * h),
                  bound);
    }
  }
}

// Where a mesh moves as one its derivatives are not worked out. They are what they come to where a
// face that touches nothing moves on its own: zero, to the bit.
TEST(Normals, StayWhereAllMovesAsOne) {
  Mesh mesh = with_smooth_normals(cube_mesh());
  mesh.normal_source = NormalSource::kComputed;
  mesh.position_tangents.assign(8, {{1, 2, 3, 4}, {0.1, 0.7, 0, 0}, {-1, 0, 0, 1}});
  update_shading_normals(mesh);
  EXPECT_TRUE(mesh.normal_tangents.empty());
  for (const float x : {5, 6, 5}) {
    mesh.positions.push_back({x, mesh.positions.size() == 10 ? 1.0f : 0.0f, 0});
    mesh.position_tangents.push_back({{}, {}, {x, 0, 0, 0}});
  }
  mesh.faces.push_back({8, 9, 10});
  weld_positions(mesh);
  update_shading_normals(mesh);
  ASSERT_EQ(mesh.normal_tangents.size(), 11u);
  for (size_t n = 0; n < 8; ++n)
    for (int k = 0; k < 3; ++k)
      for (int lane = 0; lane < kLanes; ++lane) EXPECT_EQ(mesh.normal_tangents[n][k][lane], 0);
  EXPECT_NE(mesh.normal_tangents[8].x[0], 0);
}

// Faces that share no vertices have normals that do not vary.
TEST(Normals, AreIdleWhereTheyAreThoseOfFaces) {
  Mesh apart = make_mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0.5}, {2, 0, 0}, {2, 2, 0}, {2, 0, 1}},
                         {{0, 1, 2}, {3, 4, 5}});
  EXPECT_FALSE(has_idle_normals(apart));  // it has none
  apart.normal_source = NormalSource::kComputed;
  update_shading_normals(apart);
  EXPECT_TRUE(has_idle_normals(apart));
  Mesh turned = apart;
  turned.normals[1] = normalize(turned.normals[1] + Vec3d{1e-5, 0, 0});
  EXPECT_FALSE(has_idle_normals(turned));
  turned = apart;
  for (size_t n = 0; n < turned.normals.size(); ++n) turned.normals[n] = -apart.normals[n];
  EXPECT_FALSE(has_idle_normals(turned));
  Mesh cube = with_smooth_normals(cube_mesh());
  EXPECT_FALSE(has_idle_normals(cube));
}

// Fins around an axis, as a file rounds them: normals along the axis cancel.
TEST(Normals, CancelledOnesAreFinite) {
  std::vector<Vec3f> x{{0, -1, 0}, {0, 1, 0}};
  std::vector<FaceIndices> faces;
  for (uint32_t i = 0; i < 7; ++i) {
    const double angle = 0.2 + 2 * kPi * i / 7;
    for (const double y : {-1, 1})
      x.push_back(cast<float>(Vec3d{std::cos(angle), y, std::sin(angle)}));
    faces.insert(faces.end(), {{0, 2 * i + 2, 2 * i + 3}, {0, 2 * i + 3, 1}});
  }
  Mesh mesh = make_mesh(x, faces);
  mesh.normal_source = NormalSource::kComputed;
  Rng rng(1, 2, 3);
  for (size_t v = 0; v < x.size(); ++v) {
    Vec3<Lanes> velocity;
    for (int k = 0; k < 3; ++k) velocity[k][0] = rng.uniform();
    mesh.position_tangents.push_back(velocity);
  }
  update_shading_normals(mesh);
  // Faces are 1 high at least, and corners move at sqrt(3) at most: none turns faster than this.
  for (const Vec3<Lanes> n : mesh.normal_tangents)
    EXPECT_LT(length(Vec3d{n.x[0], n.y[0], n.z[0]}), 4 * std::sqrt(3));
  for (const Vec3d& n : mesh.normals) EXPECT_NEAR(length(n), 1, 1e-15);
}

// A needle of width 1e-20 between two faces: they meet where it was.
TEST(Mesh, NeedlesCollapse) {
  const TempFiles files;
  const Mesh mesh = read_mesh(files.write("a.obj",
                                          "v -1e-20 0 0\nv 0 1e-3 0.3\nv 0 0 0\nv 1 0 0\nv -1 0 0\n"
                                          "f 2 1 3\nf 3 4 2\nf 5 1 2\n"),
                              true);
  EXPECT_EQ(mesh.collapsed_faces, 1u);
  ASSERT_EQ(mesh.faces.size(), 2u);
  EXPECT_EQ(mesh.weld[2], 0u);
}

Mesh shape_mesh(const std::string& xml) {
  const TempFiles files;
  files.write("pyramid.obj", kPyramid);
  return read_scene(files.write("s.xml", "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>" +
                                             xml + "</scene>"),
                    {}, nullptr)
      .shapes.at(0)
      .mesh;
}

double signed_volume(const Mesh& m) {
  double six = 0;
  for (const FaceIndices& f : m.faces) {
    six += determinant(cast<double>(m.positions[f[0]]), cast<double>(m.positions[f[1]]),
                       cast<double>(m.positions[f[2]]));
  }
  return six / 6;
}

Vec3d area_vector(const Mesh& m) {
  Vec3d sum;
  for (const FaceIndices& f : m.faces) {
    const Vec3d p = cast<double>(m.positions[f[0]]);
    sum += cross(cast<double>(m.positions[f[1]]) - p, cast<double>(m.positions[f[2]]) - p) * 0.5;
  }
  return sum;
}

TEST(Shapes, SizeAndOrientation) {
  EXPECT_DOUBLE_EQ(signed_volume(shape_mesh("<shape type=\"cube\"/>")), 8);
  const Mesh sphere = shape_mesh(
      "<shape type=\"sphere\"><float name=\"radius\" value=\"2\"/>"
      "<point name=\"center\" value=\"1,2,3\"/></shape>");
  EXPECT_EQ(sphere.faces.size(), 5120u);
  // The lost volume is about the mean depth of the faces under the sphere, below 1.2e-3 radii.
  const double ball = 4 * kPi / 3 * 8;
  EXPECT_LT(signed_volume(sphere), ball);
  EXPECT_GT(signed_volume(sphere), ball * (1 - 3 * 1.2e-3));
  for (const Vec3f& p : sphere.positions) {
    EXPECT_NEAR(length(cast<double>(p) - Vec3d{1, 2, 3}), 2, 0x1p-20);
  }
  const Vec3d disk = area_vector(shape_mesh("<shape type=\"disk\"/>"));
  EXPECT_NEAR(disk.z, 128 * std::sin(2 * kPi / 256), 1e-6);
  EXPECT_EQ(area_vector(shape_mesh("<shape type=\"rectangle\"/>")), (Vec3d{0, 0, 4}));
}

TEST(Shapes, FlippingAndMirroring) {
  const std::string flip = "<boolean name=\"flip_normals\" value=\"true\"/>";
  const std::string mirror = "<transform name=\"to_world\"><scale x=\"-1\"/></transform>";
  const auto cube = [&](const std::string& body) {
    return signed_volume(shape_mesh("<shape type=\"cube\">" + body + "</shape>"));
  };
  EXPECT_DOUBLE_EQ(cube(flip), -8);
  // The outside of Mitsuba's own flat shapes stays outside (seen in its images, 3.9.1).
  const std::string turned = "<transform name=\"to_world\"><scale z=\"-1\"/></transform>";
  EXPECT_DOUBLE_EQ(cube(mirror), 8);
  EXPECT_DOUBLE_EQ(cube(flip + mirror), -8);
  EXPECT_DOUBLE_EQ(cube(turned), 8);
  for (const char* type : {"rectangle", "disk"}) {
    const auto up = [&](const std::string& body) {
      return area_vector(
                 shape_mesh("<shape type=\"" + std::string(type) + "\">" + body + "</shape>"))
          .z;
    };
    EXPECT_GT(up(mirror), 3);
    EXPECT_LT(up(flip + mirror), -3);
    EXPECT_LT(up(turned), -3);
    EXPECT_GT(up(flip + turned), 3);
  }
  // A sphere is turned inside out, normals and all.
  for (const bool flipped : {false, true}) {
    const Mesh ball =
        shape_mesh("<shape type=\"sphere\">" + (flipped ? flip : "") + mirror + "</shape>");
    EXPECT_EQ(signed_volume(ball) > 0, flipped);
    for (size_t f = 0; f < ball.faces.size(); f += 100) {
      const Vec3d p = cast<double>(ball.positions[ball.faces[f][0]]);
      EXPECT_EQ(dot(ball.normals[ball.normal_ids[f][0]], p) > 0, flipped);
    }
  }
  // So is a mesh with computed normals; one with normals of its file keeps its outside, and faces
  // that read none of them are turned.
  const TempFiles files;
  const std::string plain = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  const std::string bare = files.write("bare.obj", plain + "f 1 2 3\n");
  const std::string with = files.write("with.obj", plain + "vn 0 0 1\nf 1//1 2//1 3//1\n");
  const std::string flat = "<boolean name=\"face_normals\" value=\"true\"/>";
  const auto facing = [&](const std::string& file, const std::string& body) {
    const Mesh mesh = shape_mesh("<shape type=\"obj\"><string name=\"filename\" value=\"" + file +
                                 "\"/>" + body + "</shape>");
    const double up = area_vector(mesh).z;
    for (const FaceIndices& ids : mesh.normal_ids) {
      EXPECT_EQ(mesh.normals[ids[0]].z, up > 0 ? 1 : -1);
    }
    return up;
  };
  EXPECT_EQ(facing(bare, mirror), -0.5);
  EXPECT_EQ(facing(bare, flip + mirror), 0.5);
  EXPECT_EQ(facing(with, mirror), 0.5);
  EXPECT_EQ(facing(with, turned), -0.5);
  EXPECT_EQ(facing(with, flip + mirror), -0.5);
  EXPECT_EQ(facing(with, flat + mirror), -0.5);
  const Mesh sphere = shape_mesh("<shape type=\"sphere\">" + flip + "</shape>");
  for (size_t f = 0; f < sphere.faces.size(); f += 100) {
    for (int c = 0; c < 3; ++c) {
      const Vec3d p = cast<double>(sphere.positions[sphere.faces[f][c]]);
      EXPECT_LT(dot(sphere.normals[sphere.normal_ids[f][c]], p), 0);
    }
  }
}

TEST(Shapes, GivenNormalsUseTheInverseTranspose) {
  const Mesh m = shape_mesh(
      "<shape type=\"sphere\"><transform name=\"to_world\"><scale x=\"4\"/></transform></shape>");
  for (size_t f = 0; f < m.faces.size(); ++f) {
    const Vec3d p = cast<double>(m.positions[m.faces[f][0]]);
    const Vec3d expected = normalize(Vec3d{p.x / 16, p.y, p.z});  // gradient of (x/4)^2 + y^2 + z^2
    EXPECT_NEAR(length(m.normals[m.normal_ids[f][0]] - expected), 0, 1e-6);
  }
}

TEST(Vectors, FromTextAndMesh) {
  const TempFiles files;
  const auto text = read_vertex_vectors(files.write("v.txt", "# x y z\n1 2 3\n\n-1,0,1e2\n"));
  EXPECT_EQ(text, (std::vector<Vec3d>{{1, 2, 3}, {-1, 0, 100}}));
  EXPECT_EQ(read_vertex_vectors(files.write("v.OBJ", kPyramid)).size(), 5u);
}

}  // namespace
}  // namespace limn
