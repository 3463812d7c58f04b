// The exact message of every kind of mistake in a mesh file, and the mistakes that are mended.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "limn/core/mesh.h"
#include "limn/core/scene.h"
#include "support/temp_files.h"

namespace limn {
namespace {

struct Mistake {
  std::string name;
  std::string file;
  std::string content;
  std::string message;  // without the directory
};
std::ostream& operator<<(std::ostream& out, const Mistake& mistake) {
  return out << mistake.content;
}

const std::string kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

std::string ply(const std::string& vertices, const std::string& faces, const std::string& body) {
  return "ply\nformat ascii 1.0\nelement vertex " + vertices +
         "\nproperty float x\nproperty float y\nproperty float z\nelement face " + faces +
         "\nproperty list uchar int vertex_indices\nend_header\n" + body;
}
const std::string kPlyTriangle = "0 0 0\n1 0 0\n0 1 0\n";

std::string binary_ply(const std::string& body, const std::string& vertices = "3",
                       const std::string& list_size = "uchar") {
  std::string text = ply(vertices, "1", body);
  text.replace(text.find("uchar"), 5, list_size);
  return text.replace(text.find("ascii"), 5, "binary_little_endian");
}
const std::string kPlyFace("\3\0\0\0\0\1\0\0\0\2\0\0\0", 13);

std::string corner_error(const std::string& place, const std::string& corner) {
  return "a.obj:" + place +
         ": error: a corner is v, v/vt, v//vn or v/vt/vn in whole numbers, not \"" + corner + "\"";
}

// One face with that many corners, half of them between teeth.
std::string comb(int corners) {
  std::string vertices = "v 0 -1 0\nv " + std::to_string(corners) + " -1 0\n", face = "f 1 2";
  for (int i = corners; i > 2; --i) {
    vertices += "v " + std::to_string(i) + (i % 2 ? " 1 0\n" : " 0 0\n");
    face += " " + std::to_string(corners - i + 3);
  }
  return vertices + face + "\n";
}

const std::vector<Mistake>& mistakes() {
  static const std::vector<Mistake> all = {
      {"ObjEmpty", "a.obj", "", "a.obj: error: the mesh has no vertices"},
      {"ObjNoFaces", "a.obj", kTriangle, "a.obj: error: the mesh has no faces"},
      {"ObjNan", "a.obj", "v 0 0 0\nv 1 nan 0\n", "a.obj:2:1: error: vertex is not finite"},
      {"ObjInf", "a.obj", "\r\nv 0 0 -inf\r\n", "a.obj:2:1: error: vertex is not finite"},
      {"ObjTooLarge", "a.obj", "v 0 0 1e400\n", "a.obj:1:7: error: not a number: \"1e400\""},
      {"ObjBeyondFloat", "a.obj", kTriangle + "v 0 0 1e300\nf 1 2 4\n",
       "a.obj:4:1: error: vertex: a number is beyond a float's range (3.4e38)"},
      {"ObjBeyondLimit", "a.obj", kTriangle + "v 0 0 3e12\nf 1 2 4\n",
       "a.obj:4:1: error: vertex 3 (counted from 0) has a coordinate beyond 2e12, where "
       "rays miss it in single precision: use a larger unit"},
      {"ObjGarbage", "a.obj", "v 0 0 O\n", "a.obj:1:7: error: not a number: \"O\""},
      {"ObjShortVertex", "a.obj", "v 0 0\n", "a.obj:1:6: error: vertex needs 3 numbers, not 2"},
      {"ObjIndexTooLarge", "a.obj", kTriangle + "\nf 1 2 4\n",
       "a.obj:5:7: error: a face refers to vertex 4, but there are 3"},
      {"ObjIndexTooNegative", "a.obj", kTriangle + "f -1 -2 -4\n",
       "a.obj:4:9: error: a face refers to vertex -4, but there are 3 before it"},
      {"ObjIndexZero", "a.obj", kTriangle + "f 0 1 2\n",
       "a.obj:4:3: error: a face refers to vertex 0, but they count from 1"},
      {"ObjIndexWord", "a.obj", kTriangle + "f a b c\n", corner_error("4:3", "a")},
      {"ObjIndexWraps", "a.obj", kTriangle + "f 1 2 4294967299\n",
       "a.obj:4:7: error: a face refers to vertex 4294967299, but there are 3"},
      {"ObjIndexBeyondAnyNumber", "a.obj", kTriangle + "f 1 2 99999999999999999999\n",
       corner_error("4:7", "99999999999999999999")},
      {"ObjIndexFraction", "a.obj", kTriangle + "f 1.5 2 3\n", corner_error("4:3", "1.5")},
      {"ObjIndexSuffix", "a.obj", kTriangle + "f 1 2 3x\n", corner_error("4:7", "3x")},
      {"ObjIndexSlash", "a.obj", kTriangle + "f 1 2/ 3\n", corner_error("4:5", "2/")},
      {"ObjIndexSlashes", "a.obj", kTriangle + "f 1 2// 3\n", corner_error("4:5", "2//")},
      {"ObjIndexFourParts", "a.obj", kTriangle + "f 1 2/1/1/1 3\n", corner_error("4:5", "2/1/1/1")},
      {"ObjTextureIndex", "a.obj", kTriangle + "f 1/9 2/9 3/9\n",
       "a.obj:4:3: error: a face refers to texture coordinate 9, but there are 0"},
      {"ObjTextureWord", "a.obj", "vt 0 up\n", "a.obj:1:6: error: not a number: \"up\""},
      {"ObjTextureLong", "a.obj", "vt 0 1 2 3\n",
       "a.obj:1:10: error: texture coordinate: more than 3 numbers"},
      {"ObjVertexWord", "a.obj", "v 0 0 0 red\n", "a.obj:1:9: error: not a number: \"red\""},
      {"ObjVertexFive", "a.obj", "v 0 0 0 1 1\n",
       "a.obj:1:1: error: vertex: 5 numbers are neither x y z w nor x y z r g b"},
      {"ObjVertexLong", "a.obj", "v 0 0 0 1 1 1 1 1\n",
       "a.obj:1:17: error: vertex: more than 7 numbers"},
      {"ObjNormalLong", "a.obj", "vn 0 0 1 1\n", "a.obj:1:10: error: normal: more than 3 numbers"},
      {"ObjNul", "a.obj", std::string("v 0 0 0\0\n", 9),
       "a.obj:1:7: error: not a number: \"0\\x00\""},
      {"ObjContinued", "a.obj", kTriangle + "f 1 2 \\\n 4\n",
       "a.obj:5:2: error: a face refers to vertex 4, but there are 3"},
      {"ObjStatement", "a.obj", kTriangle + "F 1 2 3\n",
       "a.obj:4:1: error: unknown statement \"F\" (known: bevel, c_interp, ctech, d_interp, f, g, "
       "l, lod, maplib, mg, mtllib, o, p, s, shadow_obj, stech, trace_obj, usemap, usemtl, v, vn, "
       "vp, vt)"},
      {"ObjPointer", "a.obj", "version https://git-lfs.github.com/spec/v1\noid sha256:5e07\n",
       "a.obj: error: is a pointer of Git LFS in place of the file (git lfs pull gets it)"},
      // Of a file that is none nothing is quoted.
      {"ObjOther", "a.obj", "root:x:0:0:root:/root:/bin/sh\n",
       "a.obj:1:1: error: this is no statement of an OBJ file (known: bevel, c_interp, ctech, "
       "d_interp, f, g, l, lod, maplib, mg, mtllib, o, p, s, shadow_obj, stech, trace_obj, usemap, "
       "usemtl, v, vn, vp, vt)"},
      {"ObjConcave", "a.obj", comb(4098),
       "a.obj:4099:1: error: a concave face of 4098 corners (at most 4096): split it"},
      {"ObjNormalIndex", "a.obj", kTriangle + "vn 0 0 1\nf 1//1 2//1 3//2\n",
       "a.obj:5:13: error: a face refers to normal 2, but there are 1"},
      {"ObjTwoCorners", "a.obj", kTriangle + "f 1 2\n",
       "a.obj:4:1: error: a face needs at least three corners"},
      {"ObjNormalWord", "a.obj", kTriangle + "vn 0 0 up\n",
       "a.obj:4:8: error: not a number: \"up\""},
      {"ObjAllCollapsed", "a.obj", kTriangle + "f 1 1 2\n",
       "a.obj: error: the mesh has no faces: each of its 1 faces has two corners at the same "
       "position"},
      {"PlyEmpty", "a.ply", "", "a.ply:1: error: not a PLY file"},
      {"PlyFormat", "a.ply", "ply\nformat utf8 1.0\nend_header\n",
       "a.ply:3: error: unknown format \"utf8\" (known: ascii, binary_little_endian, "
       "binary_big_endian)"},
      {"PlyHeaderCut", "a.ply", "ply\nformat ascii 1.0\n",
       "a.ply:2: error: the file ends inside its header"},
      {"PlyKeyword", "a.ply", "ply\nformat ascii 1.0\nelements vertex 3\n",
       "a.ply:3: error: unknown keyword \"elements\" in the header"},
      {"PlyType", "a.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty real x\n",
       "a.ply:4: error: unknown type \"real\""},
      {"PlyNoZ", "a.ply",
       "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
       "end_header\n0 0\n",
       "a.ply:3: error: element vertex has no property z"},
      {"PlyCount", "a.ply", ply("-3", "1", ""),
       "a.ply:3: error: malformed element (element NAME COUNT)"},
      {"PlyNoVertices", "a.ply", ply("0", "0", ""), "a.ply: error: the mesh has no vertices"},
      {"PlyNoFaces", "a.ply", ply("3", "0", kPlyTriangle), "a.ply: error: the mesh has no faces"},
      {"PlyNan", "a.ply", ply("3", "1", "0 0 0\n0 nan 0\n"),
       "a.ply:11: error: vertex 1: the position is not finite"},
      {"PlyGarbage", "a.ply", ply("3", "1", "0 0 zero\n"),
       "a.ply:10:5: error: vertex 0: not a number: \"zero\""},
      {"PlyShortLine", "a.ply", ply("3", "1", "0 0\n"),
       "a.ply:10:3: error: vertex 0: too few numbers on the line"},
      {"PlyLongLine", "a.ply", ply("3", "1", "0 0 0 0\n"),
       "a.ply:10:7: error: vertex 0: too many numbers on the line"},
      {"PlyTruncated", "a.ply", ply("3", "1", "0 0 0\n1 0 0\n"),
       "a.ply:11: error: the file ends before vertex 2"},
      {"PlyQuad", "a.ply", ply("3", "1", kPlyTriangle + "4 0 1 2 0\n"),
       "a.ply:13: error: face 0 has 4 corners: only triangles are read"},
      {"PlyIndex", "a.ply", ply("3", "1", kPlyTriangle + "3 0 1 3\n"),
       "a.ply:13: error: face 0 refers to vertex 3, but there are 3 (counted from 0)"},
      {"PlyNegativeIndex", "a.ply", ply("3", "1", kPlyTriangle + "3 0 1 -1\n"),
       "a.ply:13: error: face 0 refers to vertex -1, but there are 3 (counted from 0)"},
      {"PlyBinaryTruncated", "a.ply", binary_ply(std::string(35, '\0')),
       "a.ply:3: error: element vertex: the file ends before 3 of them, of 12 bytes at least"},
      {"PlyBinaryFaceTruncated", "a.ply", binary_ply(std::string(36, '\0') + "\3abcd"),
       "a.ply: error: face 0: list vertex_indices of 3 numbers, but the file ends before (at byte "
       "206)"},
      {"PlyHugeCount", "a.ply", ply("99999999999", "1", ""), "a.ply:3: error: too many vertices"},
      {"PlyBinaryHugeCount", "a.ply", binary_ply("", "4294967294"),
       "a.ply:3: error: element vertex: the file ends before 4294967294 of them, of 12 bytes at "
       "least"},
      {"PlyBinaryCountBeyondAnyFile", "a.ply", binary_ply("", "9223372036854775807"),
       "a.ply:3: error: element vertex: the file ends before 9223372036854775807 of them, of 12 "
       "bytes at least"},
      {"PlyCountBeyondAnyNumber", "a.ply", binary_ply("", "9223372036854775808"),
       "a.ply:3: error: malformed element (element NAME COUNT)"},
      {"PlyVersion", "a.ply", "ply\nformat ascii 99.0\nend_header\n",
       "a.ply:2: error: version 99.0 is not read (known: 1.0)"},
      {"PlyNoFormat", "a.ply", "ply\nend_header\n", "a.ply:2: error: the header has no format"},
      {"PlyTwoFormats", "a.ply", "ply\nformat ascii 1.0\nformat ascii 1.0\n",
       "a.ply:3: error: a second format"},
      {"PlyTwoVertexElements", "a.ply",
       "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nelement vertex 3\n",
       "a.ply:5: error: a second element vertex"},
      {"PlyTwoProperties", "a.ply",
       "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty int x\n",
       "a.ply:5: error: element vertex has a second property x"},
      {"PlyTrailingText", "a.ply", ply("3", "1", kPlyTriangle + "3 0 1 2\n\n more\n"),
       "a.ply:15:2: error: \"more\" follows the last element of the header"},
      {"PlyTrailingBytes", "a.ply", binary_ply(std::string(36, '\0') + kPlyFace + "ab"),
       "a.ply: error: 2 bytes follow the last element of the header (at byte 218)"},
      {"PlyNegativeList", "a.ply",
       binary_ply(std::string(36, '\0') + std::string(4, '\xff') + kPlyFace, "3", "int"),
       "a.ply: error: face 0: list vertex_indices has a negative size (at byte 207)"},
      {"PlyHugeList", "a.ply",
       binary_ply(std::string(36, '\0') + std::string(4, '\xff') + kPlyFace, "3", "uint"),
       "a.ply: error: face 0: list vertex_indices of 4294967295 numbers, but the file ends before "
       "(at byte 208)"},
      {"PlyListOfTheLine", "a.ply", ply("3", "1", kPlyTriangle + "4 0 1 2\n"),
       "a.ply:13:1: error: face 0: list vertex_indices of 4 numbers, but the line ends before"},
      {"PlyFloatIndex", "a.ply", ply("3", "1", kPlyTriangle + "3 0.5 1 2\n"),
       "a.ply:13:3: error: face 0: not a whole number: \"0.5\""},
      {"PlyBeyondItsType", "a.ply", ply("3", "1", kPlyTriangle + "300 0 1 2\n"),
       "a.ply:13:1: error: face 0: beyond the range of its type: \"300\""},
      {"PlyBeyondFloat", "a.ply", ply("3", "1", "0 1e39 0\n"),
       "a.ply:10:3: error: vertex 0: beyond the range of its type: \"1e39\""},
      {"PlyFloatIndices", "a.ply",
       "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
       "property float z\nelement face 1\nproperty list uchar float vertex_indices\nend_header\n"
       "0 0 0\n",
       "a.ply:7: error: vertex_indices must be integers"},
      {"PlyCarriageReturns", "a.ply", "ply\rformat ascii 1.0\r", "a.ply:1: error: not a PLY file"},
  };
  return all;
}

std::string message_of(const TempFiles& files, const std::string& name,
                       const std::string& content) {
  const std::string file = files.write(name, content);
  try {
    read_mesh(file, false);
  } catch (const InputError& error) {
    const std::string text = error.what();
    EXPECT_EQ(text.rfind(file, 0), 0u) << text;
    return text.substr(file.size() - name.size());
  }
  return "no error";
}

class BadMesh : public testing::TestWithParam<Mistake> {};

TEST_P(BadMesh, SaysWhatAndWhere) {
  const TempFiles files;
  EXPECT_EQ(message_of(files, GetParam().file, GetParam().content), GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(All, BadMesh, testing::ValuesIn(mistakes()),
                         [](const auto& c) { return c.param.name; });

TEST(BadMesh, MissingFiles) {
  const TempFiles files;
  for (const std::string name : {"none.obj", "none.ply", "none.txt"}) {
    const std::string file = files.path(name);
    try {
      read_vertex_vectors(file);
      ADD_FAILURE() << name;
    } catch (const InputError& error) {
      EXPECT_EQ(error.what(), file + ": error: cannot read: No such file or directory");
    }
  }
}

TEST(BadMesh, Vectors) {
  const TempFiles files;
  const std::string file = files.write("v.txt", "# velocity\n0 0 1\n\n1 2\n");
  try {
    read_vertex_vectors(file);
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_EQ(error.what(), file + ":4: error: expected three numbers \"x y z\"");
  }
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"0 0 1x\n", ":1:5: error: not a number: \"1x\""},
      {"0 0 0\n 1, nan 0\n", ":2:5: error: the vector is not finite"},
      {"1e39 0 0\n", ":1:1: error: a number is beyond a float's range (3.4e38)"},
      {std::string("0 0 0\0\n", 7), ":1:5: error: not a number: \"0\\x00\""},
      {"user:x:8: Jane Doe:/home\n", ":1: error: expected three numbers \"x y z\""},
      {"1 2 3 4\n", ":1: error: expected three numbers \"x y z\""}};
  for (const auto& [content, message] : cases) {
    files.write("v.txt", content);
    try {
      read_vertex_vectors(file);
      ADD_FAILURE() << content;
    } catch (const InputError& error) {
      EXPECT_EQ(error.what(), file + message);
    }
  }
}

// Every truncation of a valid file ends in an error or, where only the end of the last line is
// missing, in the same mesh.
TEST(BadMesh, EveryTruncationOfAPly) {
  const TempFiles files;
  std::string content = binary_ply(std::string(36, '\0'));
  content[content.size() - 36 + 15] = 0x40;  // x of vertex 1 is 2
  content[content.size() - 36 + 31] = 0x40;  // z of vertex 2 is 2, all others are 0
  for (int i = 0; i < 3; ++i) {
    if (i == 0) content += '\3';
    content += static_cast<char>(i);
    content += std::string(3, '\0');
  }
  ASSERT_EQ(message_of(files, "a.ply", content), "no error");
  for (size_t size = 0; size < content.size(); ++size) {
    EXPECT_NE(message_of(files, "a.ply", content.substr(0, size)), "no error") << size;
  }
}

// Twice the area of all faces, seen from +z: each must be wound as the polygon is.
double doubled_area(const Mesh& mesh) {
  double sum = 0;
  for (const FaceIndices& f : mesh.faces) {
    const Vec3d a = cast<double>(mesh.positions[f[0]]), b = cast<double>(mesh.positions[f[1]]),
                c = cast<double>(mesh.positions[f[2]]);
    const double area = cross(b - a, c - a).z;
    EXPECT_GE(area, 0);
    sum += area;
  }
  return sum;
}

TEST(Polygon, ConcaveOnesLoseTheirEars) {
  const TempFiles files;
  // The fan from the first corner would fold over the fourth.
  const std::string quad = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 0.25 0\nf 1 2 3 4\n";
  const Mesh mesh = read_mesh(files.write("a.obj", quad), false);
  EXPECT_EQ(mesh.faces.size(), 2u);
  EXPECT_EQ(doubled_area(mesh), 2.5);  // 2 * 2 + (2 * 0.25 - 1 * 2), the shoelace formula
  for (const int corners : {8, 33, 64, 65, 300, 4096}) {
    const Mesh teeth = read_mesh(files.write("b.obj", comb(corners)), false);
    EXPECT_EQ(teeth.faces.size(), corners - 2u);
    double expected = 0;
    for (size_t i = 0; i < teeth.positions.size(); ++i) {
      const Vec3f p = teeth.positions[i], q = teeth.positions[(i + 1) % teeth.positions.size()];
      expected += double{p.x} * q.y - double{p.y} * q.x;
    }
    EXPECT_EQ(doubled_area(teeth), expected);
  }
}

// No corner of a large convex polygon lies in many triangles.
TEST(Polygon, LargeConvexOnesAreHalved) {
  constexpr int kCorners = 1000;
  std::string vertices, face = "f";
  for (int i = 0; i < kCorners; ++i) {
    const double turn = 2 * kPi * i / kCorners;
    vertices +=
        "v " + std::to_string(std::cos(turn)) + " " + std::to_string(std::sin(turn)) + " 0\n";
    face += " " + std::to_string(i + 1);
  }
  const TempFiles files;
  const Mesh mesh = read_mesh(files.write("a.obj", vertices + face), false);
  ASSERT_EQ(mesh.faces.size(), kCorners - 2u);
  EXPECT_GT(doubled_area(mesh), 6.28);
  std::vector<int> faces(mesh.positions.size());
  for (const FaceIndices& f : mesh.faces)
    for (const uint32_t v : f) ++faces[v];
  EXPECT_LE(*std::max_element(faces.begin(), faces.end()), 20);  // 2 log2(1000)
}

TEST(Obj, ContinuedLinesCommentsAndEnds) {
  const TempFiles files;
  const std::string text =
      "\xef\xbb\xbf# a mark and a comment \\\nv 0 0 0 1\rv 1 0 0 # one\r\nv 0 1 0 1 0 0\n"
      "usemtl #1\ng a \\\n b\nf 1 2 \\\r\n3";
  const Mesh mesh = read_mesh(files.write("a.obj", text), false);
  EXPECT_EQ(mesh.positions.size(), 3u);
  ASSERT_EQ(mesh.faces.size(), 1u);
  EXPECT_EQ(mesh.faces[0], (FaceIndices{0, 1, 2}));
}

std::vector<std::string> warnings_of(const TempFiles& files, const std::string& obj) {
  files.write("m.obj", obj);
  const std::string scene = files.write(
      "s.xml",
      "<scene version=\"3.0.0\"><sensor type=\"perspective\"/>"
      "<shape type=\"obj\"><string name=\"filename\" value=\"m.obj\"/></shape></scene>");
  std::vector<std::string> warnings;
  read_scene(scene, {}, &warnings);
  return warnings;
}

TEST(MendedMesh, WarnsOfCollapsedFaces) {
  const TempFiles files;
  const auto warnings = warnings_of(files, kTriangle + "v -0 0 0\nf 1 2 3\nf 1 4 2\nf 2 3 2\n");
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0], files.path("m.obj") +
                             ": warning: 2 of 3 faces have two corners at the same position and "
                             "are left out");
}

TEST(MendedMesh, KeepsFacesWithoutAreaWhoseCornersDiffer) {
  const TempFiles files;
  const std::string file = files.write("a.obj", kTriangle + "v 2 0 0\nf 1 2 3\nf 1 2 4\n");
  const Mesh mesh = read_mesh(file, false);
  EXPECT_EQ(mesh.faces.size(), 2u);
  EXPECT_EQ(mesh.collapsed_faces, 0u);
  // Only the face with an area shapes the normals.
  for (const Vec3d& n : {mesh.normals[0], mesh.normals[1], mesh.normals[2]}) {
    EXPECT_EQ(n, (Vec3d{0, 0, 1}));
  }
}

TEST(MendedMesh, WarnsOfNormalsAgainstTheWinding) {
  const TempFiles files;
  const std::string quad = kTriangle + "v 1 1 0\nvn 0 0 -1\nvn 0 0 1\n";
  const std::string all = quad + "f 1//1 2//1 3//1\nf 2//1 4//1 3//1\n";
  const std::string some = quad + "f 1//1 2//1 3//1\nf 2//2 4//2 3//2\n";
  EXPECT_EQ(warnings_of(files, all).at(0),
            files.path("m.obj") +
                ": warning: the vertex normals oppose the winding of (nearly) all faces; the file "
                "is inside out for one of the two");
  EXPECT_EQ(
      warnings_of(files, some).at(0),
      files.path("m.obj") + ": warning: the vertex normals oppose the winding of 1 of 2 faces");
}

// Two squares that meet at 45 degrees to the ground, in a hollow or on a ridge.
TEST(MendedMesh, WarnsOfLightLostInHollows) {
  const TempFiles files;
  const auto folded = [](double z, const std::string& normals) {
    const std::string low = " 0\nv ", high = " " + std::to_string(z) + "\n";
    return "v 0 0" + low + "0 1 0\nv 1 0" + high + "v 1 1" + high + "v -1 0" + high + "v -1 1" +
           high + normals +
           "f 1//1 3//2 4//2\nf 1//1 4//2 2//1\nf 5//3 1//1 2//1\nf 5//3 2//1 6//3\n";
  };
  const std::string up = "vn 0 0 1\nvn 0 0 1\nvn 0 0 1\n";
  // Of (1 - cos 45) / 2 the corners below, which do not lift, lose half.
  EXPECT_EQ(warnings_of(files, folded(1, up)).at(0),
            files.path("m.obj") +
                ": warning: faces block 7.3 % of uniform light from the smooth surface that their "
                "normals describe (in concave parts): use a finer mesh or face_normals");
  EXPECT_EQ(warnings_of(files, folded(1, "vn 0 0 1\nvn -1 0 1\nvn 1 0 1\n")).size(), 1u);
  EXPECT_TRUE(warnings_of(files, folded(-1, "vn 0 0 1\nvn 1 0 1\nvn -1 0 1\n")).empty());
}

TEST(MendedMesh, WarnsOfMissingNormals) {
  const TempFiles files;
  const std::string text = kTriangle +
                           "v 1 1 0\nv 0 0 1\nvn 0 0 1\nvn 0 nan 0\n"
                           "f 1//1 2//1 3//1\nf 2 4 3\nf 1//2 2//1 5//1\n";
  EXPECT_EQ(warnings_of(files, text).at(0),
            files.path("m.obj") +
                ": warning: 2 faces have corners without a usable normal: the "
                "face's own normal is used there");
}

}  // namespace
}  // namespace limn
