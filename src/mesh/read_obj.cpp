// Wavefront OBJ: the only file that knows tinyobjloader. It splits the file into statements; the
// numbers of vertices are read again from the line at hand, because the library turns what it
// cannot read into 0, rounds to float, and has no line numbers for its callbacks.
#include <tiny_obj_loader.h>

#include <array>
#include <cmath>
#include <istream>
#include <streambuf>

#include "src/base/text.h"
#include "src/mesh/mesh_file.h"

namespace limn {

namespace {

// Hands a text to a stream one line at a time, so that whoever is called back by a reader of the
// stream can ask for the line that is being read. Any of \n, \r\n and \r ends a line.
class LineFeeder : public std::streambuf {
 public:
  explicit LineFeeder(const std::string& text) : text_(text) {}
  int number() const { return number_; }
  std::string_view line() const { return std::string_view(line_).substr(0, line_.size() - 1); }

 protected:
  int_type underflow() override {
    if (next_ >= text_.size()) return traits_type::eof();
    const size_t end = std::min(text_.find_first_of("\r\n", next_), text_.size());
    line_.assign(text_, next_, end - next_);
    line_ += '\n';
    next_ = end + (text_.compare(end, 2, "\r\n") == 0 ? 2 : 1);
    ++number_;
    setg(line_.data(), line_.data(), line_.data() + line_.size());
    return traits_type::to_int_type(line_[0]);
  }

 private:
  const std::string& text_;
  std::string line_;
  size_t next_ = 0;
  int number_ = 0;
};

constexpr int64_t kAbsent = INT64_MIN;

struct Triangle {
  std::array<int64_t, 3> v, n;  // from 0, unchecked; kAbsent for no normal
  int line;
};

struct ObjReader {
  explicit ObjReader(const std::string& text) : lines(text) {}

  LineFeeder lines;
  RawMesh mesh;
  std::vector<Triangle> triangles;
  bool has_normals = false;

  [[noreturn]] void fail(const std::string& message) const {
    throw InputError({mesh.where.file, lines.number()}, message);
  }

  // The three numbers after the keyword of the current line.
  Vec3d three_numbers(const char* what) const {
    const std::vector<std::string_view> words = split(lines.line(), " \t");
    if (words.size() < 4) fail(std::string(what) + " needs three numbers");
    Vec3d v;
    for (int k = 0; k < 3; ++k) {
      const std::optional<double> number = parse_double(words[k + 1]);
      if (!number) fail("not a number: \"" + std::string(words[k + 1]) + "\"");
      v[k] = *number;
    }
    return v;
  }

  // From 0. Indices of files count from 1 and may point ahead (checked at the end), or, if
  // negative, backwards from the latest element.
  int64_t from_zero(int index, size_t count_so_far) const {
    return index > 0 ? int64_t{index} - 1 : static_cast<int64_t>(count_so_far) + index;
  }

  void add_polygon(const tinyobj::index_t* corners, int count) {
    if (count < 3) fail("a face needs at least three corners");
    std::vector<int64_t> v(count), n(count);
    for (int i = 0; i < count; ++i) {
      const int vertex = corners[i].vertex_index, normal = corners[i].normal_index;
      if (vertex == 0) fail("a face's corner is not the number of a vertex");
      v[i] = from_zero(vertex, mesh.positions.size());
      n[i] = normal == 0 ? kAbsent : from_zero(normal, mesh.normals.size());
    }
    for (int i = 2; i < count; ++i) {
      triangles.push_back({{v[0], v[i - 1], v[i]}, {n[0], n[i - 1], n[i]}, lines.number()});
    }
  }

  uint32_t checked(int64_t index, size_t count, const char* what, int line) const {
    if (index < 0 || index >= static_cast<int64_t>(count)) {
      throw InputError({mesh.where.file, line}, "a face refers to " + std::string(what) + " " +
                                                    std::to_string(index + 1) + ", but there are " +
                                                    std::to_string(count));
    }
    return static_cast<uint32_t>(index);
  }

  void resolve_triangles() {
    for (const Triangle& t : triangles) {
      FaceIndices v{}, n{};
      for (int i = 0; i < 3; ++i) {
        v[i] = checked(t.v[i], mesh.positions.size(), "vertex", t.line);
        n[i] = kNoNormal;
        if (t.n[i] == kAbsent) continue;
        n[i] = checked(t.n[i], mesh.normals.size(), "normal", t.line);
        has_normals = true;
      }
      mesh.faces.push_back(v);
      mesh.normal_ids.push_back(n);
    }
    if (!has_normals) mesh.normal_ids.clear();
  }
};

ObjReader& reader(void* user) { return *static_cast<ObjReader*>(user); }

}  // namespace

RawMesh parse_obj(const std::string& file) {
  const std::optional<std::string> text = read_whole_file(file);
  if (!text) throw InputError({file}, "cannot read the file");
  ObjReader obj(*text);
  obj.mesh.where = {file};

  using tinyobj::real_t;
  tinyobj::callback_t callback;
  callback.vertex_cb = [](void* user, real_t, real_t, real_t, real_t) {
    const Vec3d p = reader(user).three_numbers("vertex");
    if (!std::isfinite(p.x + p.y + p.z)) reader(user).fail("vertex is not finite");
    reader(user).mesh.positions.push_back(p);
  };
  callback.normal_cb = [](void* user, real_t, real_t, real_t) {
    reader(user).mesh.normals.push_back(reader(user).three_numbers("normal"));
  };
  callback.index_cb = [](void* user, tinyobj::index_t* corners, int count) {
    reader(user).add_polygon(corners, count);
  };
  std::istream stream(&obj.lines);
  std::string warnings, errors;
  if (!tinyobj::LoadObjWithCallback(stream, callback, &obj, nullptr, &warnings, &errors)) {
    obj.fail(errors.empty() ? "not an OBJ file" : errors);
  }
  obj.resolve_triangles();
  return std::move(obj.mesh);
}

}  // namespace limn
