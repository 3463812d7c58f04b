// Mitsuba's serialized meshes, versions 3 and 4: several meshes in a file, each a zlib stream, with
// a table of their offsets at the end.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "limn/core/memory.h"
#include "src/base/text.h"
#include "src/mesh/mesh_file.h"

namespace limn {

namespace {

static_assert(std::endian::native == std::endian::little, "files are little-endian");

constexpr uint16_t kFormat = 0x041C;
constexpr uint32_t kHasNormals = 0x1, kHasUv = 0x2, kHasColours = 0x8, kFaceNormals = 0x10,
                   kSingle = 0x1000, kDouble = 0x2000;

// The bytes of a file, and what to blame.
class SerializedFile {
 public:
  explicit SerializedFile(const std::string& file) : file_(file), data_(read_whole_file(file)) {}
  [[noreturn]] void fail(const std::string& message) const { throw InputError({file_}, message); }
  const std::string& name() const { return file_; }

  template <class T>
  T take(size_t offset) const {
    if (offset > data_.size() || data_.size() - offset < sizeof(T)) {
      fail("the file ends before byte " + std::to_string(offset + sizeof(T)));
    }
    T number;
    std::memcpy(&number, data_.data() + offset, sizeof(T));
    return number;
  }

  // Offset of a mesh; the first needs no table.
  size_t find(int64_t index) const {
    if (index == 0) return 0;
    if (data_.size() < 8) fail("the file has no table of meshes");
    const uint32_t count = take<uint32_t>(data_.size() - 4);
    const size_t entry = take<uint16_t>(2) == 4 ? 8 : 4;
    if (count > (data_.size() - 4) / entry) fail("the table of meshes is longer than the file");
    if (index >= count) {
      fail("there is no mesh " + std::to_string(index) + ", counted from 0: the file has " +
           std::to_string(count));
    }
    const size_t place = data_.size() - 4 - entry * (count - static_cast<size_t>(index));
    return entry == 8 ? take<uint64_t>(place) : take<uint32_t>(place);
  }
  std::string_view from(size_t offset) const { return std::string_view(data_).substr(offset); }

 private:
  const std::string& file_;
  std::string data_;
};

class MeshReader {
 public:
  MeshReader(const SerializedFile& file, int64_t index)
      : file_(file), body_(body_of(file, index, version_)), in_(body_) {}

  SerializedMesh read() {
    SerializedMesh result;
    const auto flags = take<uint32_t>();
    is_double_ = (flags & kDouble) != 0;  // without either, as some exporters write it, single
    if (is_double_ && (flags & kSingle) != 0) {
      file_.fail("positions are said to be both single and double");
    }
    for (int length = 0; version_ == 4 && take<char>() != 0; ++length) {
      if (length == 65536) file_.fail("the name of a mesh is too long");
    }
    const auto vertices = take<uint64_t>(), faces = take<uint64_t>();
    check_size(flags, vertices, faces);
    RawMesh& mesh = result.mesh;
    mesh.where = {file_.name()};
    for_numbers(vertices, 3, [&](const double* v) {
      mesh.positions.push_back({v[0], v[1], v[2]});
    });
    check_positions(mesh.positions);
    if (flags & kHasNormals) {
      for_numbers(vertices, 3, [&](const double* v) {
        mesh.normals.push_back({v[0], v[1], v[2]});
      });
    }
    if (flags & kHasUv) {
      for_numbers(vertices, 2, [&](const double* v) {
        mesh.uv_places.push_back({static_cast<float>(v[0]), static_cast<float>(v[1]), 0});
      });
    }
    if (flags & kHasColours) {
      RawMesh::Attribute& colours = mesh.attributes.emplace_back();
      colours.name = "vertex_color";
      for_numbers(vertices, 3, [&](const double* v) {
        colours.values.push_back(
            {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])});
      });
    }
    mesh.faces.resize(faces);
    take(mesh.faces.data(), faces * sizeof(FaceIndices));
    check_faces(mesh.faces, vertices);
    if (flags & kHasNormals) mesh.normal_ids = mesh.faces;
    if (flags & kHasUv) {
      mesh.uv_source = UvSource::kPlane;
      mesh.uv_ids = mesh.faces;
    }
    result.face_normals = (flags & kFaceNormals) != 0;
    return result;
  }

 private:
  static std::string_view body_of(const SerializedFile& file, int64_t index, int& version) {
    const size_t offset = file.find(index);
    if (file.take<uint16_t>(offset) != kFormat) file.fail("not a serialized mesh");
    version = file.take<uint16_t>(offset + 2);
    if (version != 3 && version != 4) {
      file.fail("version " + std::to_string(version) + " is not read (known: 3, 4)");
    }
    return file.from(offset + 4);
  }

  void take(void* out, size_t size) {
    if (!in_.read(out, size)) file_.fail("the compressed data of a mesh end early or are damaged");
  }
  template <class T>
  T take() {
    T number;
    take(&number, sizeof(T));
    return number;
  }

  // Before memory is taken: what the header counts must fit into the file.
  void check_size(uint32_t flags, uint64_t vertices, uint64_t faces) const {
    const std::string counts =
        std::to_string(vertices) + " vertices and " + std::to_string(faces) + " faces";
    if (vertices >= UINT32_MAX || faces >= UINT32_MAX) file_.fail("too large: " + counts);
    const int numbers = 3 + (flags & kHasNormals ? 3 : 0) + (flags & kHasUv ? 2 : 0) +
                        (flags & kHasColours ? 3 : 0);
    const double bytes = static_cast<double>(vertices) * numbers * (is_double_ ? 8 : 4) +
                         static_cast<double>(faces) * sizeof(FaceIndices);
    if (bytes > kLargestInflation * static_cast<double>(body_.size())) {
      file_.fail("the file is too short for " + counts);
    }
    require_memory({file_.name()}, 2 * bytes, "the mesh of " + counts, "use a smaller one");
  }

  // Calls back for every `width` numbers of `count`.
  template <class Use>
  void for_numbers(uint64_t count, int width, const Use& use) {
    double v[3] = {};
    float single[3];
    for (uint64_t i = 0; i < count; ++i) {
      if (is_double_) {
        take(v, static_cast<size_t>(width) * sizeof(double));
      } else {
        take(single, static_cast<size_t>(width) * sizeof(float));
        std::copy(single, single + width, v);
      }
      use(v);
    }
  }

  void check_positions(const std::vector<Vec3d>& positions) const {
    for (size_t i = 0; i < positions.size(); ++i) {
      for (int k = 0; k < 3; ++k) {
        if (std::fabs(positions[i][k]) <= std::numeric_limits<float>::max()) continue;
        file_.fail("vertex " + std::to_string(i) +
                   " (counted from 0): the position is not finite, or beyond a float's range");
      }
    }
  }

  void check_faces(const std::vector<FaceIndices>& faces, uint64_t vertices) const {
    for (size_t f = 0; f < faces.size(); ++f) {
      for (const uint32_t v : faces[f]) {
        if (v < vertices) continue;
        file_.fail("face " + std::to_string(f) + " (counted from 0) refers to vertex " +
                   std::to_string(v) + ", but there are " + std::to_string(vertices));
      }
    }
  }

  const SerializedFile& file_;
  int version_ = 0;
  std::string_view body_;
  Inflater in_;
  bool is_double_ = false;
};

}  // namespace

SerializedMesh parse_serialized(const std::string& file, int64_t index) {
  const SerializedFile bytes(file);
  return MeshReader(bytes, index).read();
}

}  // namespace limn
