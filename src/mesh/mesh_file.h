#pragma once
// Parsers of mesh files, and what they share; limn/core/mesh.h lists their errors.
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "limn/core/vec.h"
#include "src/mesh/mesh_build.h"

namespace limn {

// Parses OBJ or PLY, by extension.
RawMesh parse_mesh(const std::string& file);
RawMesh parse_obj(const std::string& file);  // read_obj.cpp
RawMesh parse_ply(const std::string& file);  // read_ply.cpp

struct SerializedMesh {
  RawMesh mesh;
  bool face_normals = false;  // the file wants flat shading
};
// Parses a mesh of Mitsuba's serialized format. index: of the mesh in the file, from 0.
SerializedMesh parse_serialized(const std::string& file, int64_t index);  // read_serialized.cpp

// Ear clipping takes quadratic time.
inline constexpr size_t kMaxConcaveCorners = 4096;  // not tuned: some hundredths of a second

// The corners.size() - 2 triangles of a polygon, as indices of its corners, in its orientation;
// none if it is concave with more than kMaxConcaveCorners corners. If no triangle folds over: a fan
// up to 64 corners, recursive bisection above (so few triangles share a corner). Else ear clipping.
// A self-intersecting polygon gets arbitrary triangles.
std::vector<std::array<uint32_t, 3>> split_polygon(const std::vector<Vec3d>& corners);

// Reads a zlib stream piece by piece.
class Inflater {
 public:
  // compressed: begins with the stream, may go on behind its end, and must outlive this object.
  explicit Inflater(std::string_view compressed);
  ~Inflater();
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  // Writes the next `size` bytes to `out`. False if the stream is damaged or ends before.
  bool read(void* out, size_t size);

 private:
  struct Stream;
  std::unique_ptr<Stream> stream_;
};

// The most bytes that a zlib stream of one byte can hold, by the format.
inline constexpr double kLargestInflation = 1032;

}  // namespace limn
