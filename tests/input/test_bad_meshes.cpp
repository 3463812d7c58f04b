// The exact message of every kind of mistake in a mesh file, and the mistakes that are mended.
#include <gtest/gtest.h>

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

std::string binary_ply(const std::string& body) {
  std::string text = ply("3", "1", body);
  return text.replace(text.find("ascii"), 5, "binary_little_endian");
}

const std::vector<Mistake>& mistakes() {
  static const std::vector<Mistake> all = {
      {"ObjEmpty", "a.obj", "", "a.obj: error: the mesh has no vertices"},
      {"ObjNoFaces", "a.obj", kTriangle, "a.obj: error: the mesh has no faces"},
      {"ObjNan", "a.obj", "v 0 0 0\nv 1 nan 0\n", "a.obj:2: error: vertex is not finite"},
      {"ObjInf", "a.obj", "\r\nv 0 0 -inf\r\n", "a.obj:2: error: vertex is not finite"},
      {"ObjTooLarge", "a.obj", "v 0 0 1e400\n", "a.obj:1: error: not a number: \"1e400\""},
      {"ObjBeyondFloat", "a.obj", kTriangle + "v 0 0 1e300\nf 1 2 4\n",
       "a.obj: error: vertex 3 (counted from 0) has a coordinate beyond 2e12, where "
       "rays miss it in single precision: use a larger unit"},
      {"ObjGarbage", "a.obj", "v 0 0 O\n", "a.obj:1: error: not a number: \"O\""},
      {"ObjShortVertex", "a.obj", "v 0 0\n", "a.obj:1: error: vertex needs three numbers"},
      {"ObjIndexTooLarge", "a.obj", kTriangle + "\nf 1 2 4\n",
       "a.obj:5: error: a face refers to vertex 4, but there are 3"},
      {"ObjIndexTooNegative", "a.obj", kTriangle + "f -1 -2 -4\n",
       "a.obj:4: error: a face refers to vertex 0, but there are 3"},
      {"ObjIndexZero", "a.obj", kTriangle + "f 0 1 2\n",
       "a.obj:4: error: a face's corner is not the number of a vertex"},
      {"ObjIndexWord", "a.obj", kTriangle + "f a b c\n",
       "a.obj:4: error: a face's corner is not the number of a vertex"},
      {"ObjNormalIndex", "a.obj", kTriangle + "vn 0 0 1\nf 1//1 2//1 3//2\n",
       "a.obj:5: error: a face refers to normal 2, but there are 1"},
      {"ObjTwoCorners", "a.obj", kTriangle + "f 1 2\n",
       "a.obj:4: error: a face needs at least three corners"},
      {"ObjNormalWord", "a.obj", kTriangle + "vn 0 0 up\n", "a.obj:4: error: not a number: \"up\""},
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
       "a.ply:10: error: vertex 0: not a number: \"zero\""},
      {"PlyShortLine", "a.ply", ply("3", "1", "0 0\n"),
       "a.ply:10: error: vertex 0: too few numbers on the line"},
      {"PlyLongLine", "a.ply", ply("3", "1", "0 0 0 0\n"),
       "a.ply:10: error: vertex 0: too many numbers on the line"},
      {"PlyTruncated", "a.ply", ply("3", "1", "0 0 0\n1 0 0\n"),
       "a.ply:11: error: the file ends before vertex 2"},
      {"PlyQuad", "a.ply", ply("3", "1", kPlyTriangle + "4 0 1 2 0\n"),
       "a.ply:13: error: face 0 has 4 corners: only triangles are read"},
      {"PlyIndex", "a.ply", ply("3", "1", kPlyTriangle + "3 0 1 3\n"),
       "a.ply:13: error: face 0 refers to vertex 3, but there are 3 (counted from 0)"},
      {"PlyNegativeIndex", "a.ply", ply("3", "1", kPlyTriangle + "3 0 1 -1\n"),
       "a.ply:13: error: face 0 refers to vertex -1, but there are 3 (counted from 0)"},
      {"PlyBinaryTruncated", "a.ply", binary_ply(std::string(35, '\0')),
       "a.ply: error: the file ends inside vertex 2"},
      {"PlyBinaryFaceTruncated", "a.ply", binary_ply(std::string(36, '\0') + "\3abcd"),
       "a.ply: error: the file ends inside face 0"},
      {"PlyHugeCount", "a.ply", ply("99999999999", "1", ""), "a.ply:3: error: too many vertices"},
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
      EXPECT_EQ(error.what(), file + ": error: cannot read the file");
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
  for (double h : mesh.horizon) EXPECT_EQ(h, 0);
}

TEST(MendedMesh, WarnsOfNormalsAgainstTheWinding) {
  const TempFiles files;
  const std::string quad = kTriangle + "v 1 1 0\nvn 0 0 -1\nvn 0 0 1\n";
  const std::string all = quad + "f 1//1 2//1 3//1\nf 2//1 4//1 3//1\n";
  const std::string some = quad + "f 1//1 2//1 3//1\nf 2//2 4//2 3//2\n";
  EXPECT_EQ(warnings_of(files, all).at(0),
            files.path("m.obj") +
                ": warning: the vertex normals oppose the winding of (nearly) all faces; the file "
                "is inside out for one of the two, or its transform mirrors it");
  EXPECT_EQ(
      warnings_of(files, some).at(0),
      files.path("m.obj") + ": warning: the vertex normals oppose the winding of 1 of 2 faces");
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
