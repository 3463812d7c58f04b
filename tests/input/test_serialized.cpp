// Mitsuba's serialized meshes, made here, and every way in which such a file can be wrong.
#include <gtest/gtest.h>
#include <zlib.h>

#include "limn/core/error.h"
#include "src/mesh/mesh_file.h"
#include "support/temp_files.h"

namespace limn {
namespace {

template <class T>
std::string bytes(const std::vector<T>& numbers) {
  return {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(T)};
}
template <class T>
std::string bytes(T number) {
  return bytes(std::vector<T>{number});
}

std::string compressed(const std::string& text) {
  uLongf size = compressBound(text.size());
  std::string result(size, '\0');
  EXPECT_EQ(compress(reinterpret_cast<Bytef*>(result.data()), &size,
                     reinterpret_cast<const Bytef*>(text.data()), text.size()),
            Z_OK);
  return result.substr(0, size);
}

std::string header(int version) {
  return bytes<uint16_t>(0x041C) + bytes(static_cast<uint16_t>(version));
}

// What is compressed: V, F, then the arrays as they come.
std::string body(int version, uint32_t flags, uint64_t vertices, uint64_t faces,
                 const std::string& arrays) {
  const std::string name = version == 4 ? std::string("name\0", 5) : "";
  return bytes(flags) + name + bytes(vertices) + bytes(faces) + arrays;
}

const std::vector<float> kCorners = {0, 0, 0, 1, 0, 0, 0, 2, 0};
const std::string kFace = bytes(std::vector<uint32_t>{0, 1, 2});

// A triangle whose third corner is at y.
std::string triangle(int version, double y) {
  const std::string arrays = bytes(std::vector<double>{0, 0, 0, 1, 0, 0, 0, y, 0}) + kFace;
  return header(version) + compressed(body(version, 0x2000, 3, 1, arrays));
}

template <class Offset>
std::string with_table(const std::vector<std::string>& meshes) {
  std::string file;
  std::vector<Offset> offsets;
  for (const std::string& mesh : meshes) {
    offsets.push_back(static_cast<Offset>(file.size()));
    file += mesh;
  }
  return file + bytes(offsets) + bytes(static_cast<uint32_t>(meshes.size()));
}

TEST(Serialized, FindsMeshesOfBothVersions) {
  const TempFiles files;
  const std::string v4 =
      files.write("4", with_table<uint64_t>({triangle(4, 1), triangle(4, 2), triangle(4, 3)}));
  const std::string v3 =
      files.write("3", with_table<uint32_t>({triangle(3, 1), triangle(3, 2), triangle(3, 3)}));
  for (const std::string& file : {v4, v3}) {
    for (int i = 0; i < 3; ++i) {
      const RawMesh mesh = parse_serialized(file, i).mesh;
      ASSERT_EQ(mesh.positions.size(), 3u);
      EXPECT_EQ(mesh.positions[2].y, i + 1);
      EXPECT_EQ(mesh.faces, (std::vector<FaceIndices>{{0, 1, 2}}));
      EXPECT_TRUE(mesh.normals.empty());
    }
  }
}

TEST(Serialized, ReadsPastWhatIsNotUsed) {
  const TempFiles files;
  const std::string arrays = bytes(kCorners) +
                             bytes(std::vector<float>{0, 0, 1, 0, 0, 1, 0, 0, 2}) +
                             bytes(std::vector<float>{0, 0, 0.25f, 0.5f, 1, 1}) +
                             bytes(std::vector<float>(9, 0.25f)) + kFace;
  const SerializedMesh read = parse_serialized(
      files.write("a", header(4) + compressed(body(4, 0x1000 | 1 | 2 | 8 | 16, 3, 1, arrays))), 0);
  EXPECT_TRUE(read.face_normals);
  ASSERT_EQ(read.mesh.normals.size(), 3u);
  EXPECT_EQ(read.mesh.normals[2].z, 2);
  EXPECT_EQ(read.mesh.normal_ids, read.mesh.faces);
  EXPECT_EQ(read.mesh.uv_ids, read.mesh.faces);
  ASSERT_EQ(read.mesh.uv_places.size(), 3u);
  EXPECT_EQ(read.mesh.uv_places[1].x, 0.25f);
}

std::string message_of(const std::string& content, int64_t index = 0) {
  const TempFiles files;
  const std::string file = files.write("a.serialized", content);
  try {
    parse_serialized(file, index);
  } catch (const InputError& error) {
    return std::string(error.what()).substr(file.size());
  }
  return "no error";
}

std::string wrong(uint32_t flags, uint64_t vertices, uint64_t faces, const std::string& arrays) {
  return message_of(header(4) + compressed(body(4, flags, vertices, faces, arrays)));
}

TEST(Serialized, SaysWhatIsWrong) {
  EXPECT_EQ(message_of(""), ": error: the file ends before byte 2");
  EXPECT_EQ(message_of("solid cube"), ": error: not a serialized mesh");
  EXPECT_EQ(message_of(header(5)), ": error: version 5 is not read (known: 3, 4)");
  EXPECT_EQ(message_of(with_table<uint64_t>({triangle(4, 1)}), 1),
            ": error: there is no mesh 1, counted from 0: the file has 1");
  EXPECT_EQ(message_of(triangle(4, 1) + bytes(uint32_t{0xffffffff}), 1),
            ": error: the table of meshes is longer than the file");
  EXPECT_EQ(
      message_of(
          triangle(4, 1) + bytes(uint64_t{0}) + bytes(uint64_t{1} << 63) + bytes(uint32_t{2}), 1),
      ": error: the file ends before byte 9223372036854775810");
  EXPECT_EQ(wrong(0x3000, 3, 1, ""), ": error: positions are said to be both single and double");
  const std::string early = ": error: the compressed data of a mesh end early or are damaged";
  EXPECT_EQ(wrong(0x1000, 3, 1, bytes(kCorners)), early);
  EXPECT_EQ(message_of(header(4) + "no zlib stream"), early);
  EXPECT_EQ(wrong(0x1000, 3, 1, bytes(kCorners) + bytes(std::vector<uint32_t>{0, 1, 3})),
            ": error: face 0 (counted from 0) refers to vertex 3, but there are 3");
  std::vector<float> corners = kCorners;
  corners[4] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(wrong(0x1000, 3, 1, bytes(corners) + kFace),
            ": error: vertex 1 (counted from 0): the position is not finite, or beyond a float's "
            "range");
}

// Counts that no stream of this length can hold are refused before memory is taken.
TEST(Serialized, RefusesBombs) {
  EXPECT_EQ(wrong(0x1000, 1000000000, 1, std::string(100, '\0')),
            ": error: the file is too short for 1000000000 vertices and 1 faces");
  EXPECT_EQ(wrong(0x1000, uint64_t{1} << 60, 1, ""),
            ": error: too large: 1152921504606846976 vertices and 1 faces");
  // More zeros than the counts ask for are never inflated.
  EXPECT_EQ(wrong(0x1000, 3, 1, bytes(kCorners) + kFace + std::string(1 << 26, '\0')), "no error");
}

TEST(Serialized, EveryTruncationIsAnError) {
  const std::string content = triangle(4, 1);
  // The checksum at the end is not needed.
  for (size_t size = 0; size < content.size() - 8; ++size) {
    EXPECT_NE(message_of(content.substr(0, size)), "no error") << size;
  }
}

}  // namespace
}  // namespace limn
