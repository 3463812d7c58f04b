// Wavefront OBJ. Every word of a vertex, a normal or a face is read, and one that is not understood
// is an error: what is skipped in silence is a surface that is missing.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "limn/core/names.h"
#include "src/base/text.h"
#include "src/mesh/mesh_file.h"
#include "src/mesh/polygon.h"

namespace limn {

namespace {

// Statements that carry no surface: groups, materials, lines and points, how others show them.
const std::vector<std::string> kSkipped = {
    "bevel",  "c_interp",  "ctech",  "d_interp", "g", "l", "lod",
    "maplib", "mg",        "mtllib", "o",        "p", "s", "shadow_obj",
    "stech",  "trace_obj", "usemap", "usemtl",   "vp"};

// The words of a text, line by line. \n, \r\n or \r ends a line, unless a backslash is before it.
class ObjWords {
 public:
  ObjWords(const std::string& file, const std::string& text) : file_(file), text_(text) {
    if (text_.starts_with("\xef\xbb\xbf")) next_ = line_begin_ = 3;  // a byte order mark
  }

  bool at_end() const { return next_ >= text_.size(); }

  // The next word of this line, "" at its end. A word that begins with # begins a comment.
  std::string_view next() {
    while (!at_end()) {
      const char c = text_[next_];
      if (joins(next_)) {
        ++next_;
        end_line();
      } else if (c == ' ' || c == '\t') {
        ++next_;
      } else {
        break;
      }
    }
    where_ = {line_, static_cast<int>(next_ - line_begin_) + 1};
    if (at_end() || ends_line(next_) || text_[next_] == '#') return {};
    const size_t begin = next_;
    while (!at_end() && !is_blank(next_)) ++next_;
    return std::string_view(text_).substr(begin, next_ - begin);
  }

  // Past the words that are left and the comment; a backslash in a comment joins nothing.
  void skip_line() {
    while (!next().empty()) {
    }
    while (!at_end() && !ends_line(next_)) ++next_;
    end_line();
  }

  struct Place {
    int line = 1, column = 1;
  };
  // Of the word that next() gave last, or of the end that it met.
  Place where() const { return where_; }
  SourceLocation location(const Place& place) const { return {file_, place.line, place.column}; }
  [[noreturn]] void fail(const Place& place, const std::string& message) const {
    throw InputError(location(place), message);
  }
  [[noreturn]] void fail(const std::string& message) const { fail(where_, message); }

 private:
  bool ends_line(size_t i) const {
    return i < text_.size() && (text_[i] == '\n' || text_[i] == '\r');
  }
  bool joins(size_t i) const { return text_[i] == '\\' && ends_line(i + 1); }
  bool is_blank(size_t i) const {
    return text_[i] == ' ' || text_[i] == '\t' || ends_line(i) || joins(i);
  }
  void end_line() {
    if (at_end()) return;
    next_ += text_.compare(next_, 2, "\r\n") == 0 ? 2 : 1;
    line_begin_ = next_;
    ++line_;
  }

  const std::string& file_;
  const std::string& text_;
  size_t next_ = 0, line_begin_ = 0;
  int line_ = 1;
  Place where_;
};

// Vertices, texture coordinates and normals, and what faces ask of them.
struct Elements {
  const char* name;
  size_t count = 0;
  int64_t largest = 0;  // index from 1 that any face has
  ObjWords::Place place;
};

constexpr size_t kMostVertices = std::numeric_limits<uint32_t>::max() - 1;

class ObjReader {
 public:
  ObjReader(const std::string& file, const std::string& text) : words_(file, text) {
    mesh_.where = {file};
  }

  RawMesh read() {
    while (!words_.at_end()) {
      read_statement(words_.next());
      words_.skip_line();
    }
    for (const Elements* e : {&vertices_, &textures_, &normals_}) {
      if (e->largest <= static_cast<int64_t>(e->count)) continue;
      words_.fail(e->place, "a face refers to " + std::string(e->name) + " " +
                                std::to_string(e->largest) + ", but there are " +
                                std::to_string(e->count));
    }
    split_faces();
    return std::move(mesh_);
  }

 private:
  struct Face {
    uint32_t corners;
    ObjWords::Place place;
  };

  void read_statement(std::string_view keyword) {
    if (keyword == "v") {
      mesh_.positions.push_back(read_position());
      if (++vertices_.count > kMostVertices) words_.fail("too many vertices");
    } else if (keyword == "vn") {
      const std::vector<double>& n = read_numbers("normal", 3, 3);
      mesh_.normals.push_back({n[0], n[1], n[2]});
      if (++normals_.count > kMostVertices) words_.fail("too many normals");
    } else if (keyword == "vt") {
      read_numbers("texture coordinate", 1, 3);
      ++textures_.count;
    } else if (keyword == "f") {
      read_face();
    } else if (!keyword.empty() &&
               std::find(kSkipped.begin(), kSkipped.end(), keyword) == kSkipped.end()) {
      std::vector<std::string> known = kSkipped;
      known.insert(known.end(), {"f", "v", "vn", "vt"});
      std::sort(known.begin(), known.end());
      // What is no OBJ file may be none that a message should quote.
      if (mesh_.positions.empty()) {
        words_.fail("this is no statement of an OBJ file (" + known_names(known) + ")");
      }
      words_.fail(unknown_name("statement", std::string(keyword), known));
    }
  }

  // The numbers of the rest of the line, as many as that.
  const std::vector<double>& read_numbers(const std::string& what, size_t least, size_t most) {
    numbers_.clear();
    for (std::string_view word = words_.next(); !word.empty(); word = words_.next()) {
      const std::optional<double> number = parse_double(word);
      if (!number) words_.fail("not a number: \"" + std::string(word) + "\"");
      if (numbers_.size() == most) {
        words_.fail(what + ": more than " + std::to_string(most) + " numbers");
      }
      numbers_.push_back(*number);
    }
    if (numbers_.size() < least) {
      words_.fail(what + " needs " + std::to_string(least) + " numbers, not " +
                  std::to_string(numbers_.size()));
    }
    return numbers_;
  }

  // x y z, then a weight, a colour, or both, which nothing here uses.
  Vec3d read_position() {
    const ObjWords::Place begin = words_.where();
    const std::vector<double>& n = read_numbers("vertex", 3, 7);
    if (n.size() == 5) words_.fail(begin, "vertex: 5 numbers are neither x y z w nor x y z r g b");
    for (const double v : n) {
      if (!std::isfinite(v)) words_.fail(begin, "vertex is not finite");
      if (std::fabs(v) > std::numeric_limits<float>::max()) {
        words_.fail(begin, "vertex: a number is beyond a float's range (3.4e38)");
      }
      if (std::fabs(v) > kLargestCoordinate && mesh_.far_position == SIZE_MAX) {
        mesh_.far_position = mesh_.positions.size();
        mesh_.far_where = words_.location(begin);
      }
    }
    return {n[0], n[1], n[2]};
  }

  void read_face() {
    const ObjWords::Place begin = words_.where();
    uint32_t corners = 0;
    for (std::string_view word = words_.next(); !word.empty(); word = words_.next()) {
      read_corner(word);
      ++corners;
    }
    if (corners < 3) words_.fail(begin, "a face needs at least three corners");
    faces_.push_back({corners, begin});
  }

  // v, v/vt, v//vn or v/vt/vn.
  void read_corner(std::string_view word) {
    std::array<std::string_view, 3> parts;
    size_t count = 0;
    for (std::string_view rest = word; count < 3; ++count) {
      const size_t slash = std::min(rest.find('/'), rest.size());
      parts[count] = count < 2 ? rest.substr(0, slash) : rest;
      if (slash == rest.size()) break;
      rest.remove_prefix(slash + 1);
    }
    const size_t last = std::min<size_t>(count, 2);
    corner_vertices_.push_back(index(word, parts[0], vertices_));
    if (last == 1 || !parts[1].empty()) index(word, parts[1], textures_);
    corner_normals_.push_back(last == 2 ? index(word, parts[2], normals_) : kNoNormal);
  }

  // From 0. Indices of files count from 1 and may point ahead (checked at the end), or, if
  // negative, backwards from the latest element.
  uint32_t index(std::string_view word, std::string_view part, Elements& of) {
    const std::optional<int64_t> number = parse_integer(part);
    if (!number) {
      words_.fail("a corner is v, v/vt, v//vn or v/vt/vn in whole numbers, not \"" +
                  std::string(word) + "\"");
    }
    if (*number == 0)
      words_.fail("a face refers to " + std::string(of.name) + " 0, but they count from 1");
    if (*number < 0) {
      const auto count = static_cast<int64_t>(of.count);
      if (*number < -count) {
        words_.fail("a face refers to " + std::string(of.name) + " " + std::to_string(*number) +
                    ", but there are " + std::to_string(count) + " before it");
      }
      return static_cast<uint32_t>(count + *number);
    }
    if (*number > of.largest) {
      of.largest = *number;
      of.place = words_.where();
    }
    return static_cast<uint32_t>(*number - 1);
  }

  void split_faces() {
    const bool has_normals = std::any_of(corner_normals_.begin(), corner_normals_.end(),
                                         [](uint32_t n) { return n != kNoNormal; });
    size_t first = 0;
    std::vector<Vec3d> corners;
    for (const Face& face : faces_) {
      corners.clear();
      for (size_t i = first; i < first + face.corners; ++i) {
        corners.push_back(mesh_.positions[corner_vertices_[i]]);
      }
      const auto triangles = split_polygon(corners);
      if (triangles.empty()) {
        words_.fail(face.place, "a concave face of " + std::to_string(corners.size()) +
                                    " corners (at most " + std::to_string(kMaxConcaveCorners) +
                                    "): split it");
      }
      for (const auto& t : triangles) {
        mesh_.faces.push_back(picked(corner_vertices_, first, t));
        if (has_normals) mesh_.normal_ids.push_back(picked(corner_normals_, first, t));
      }
      first += face.corners;
    }
  }

  static FaceIndices picked(const std::vector<uint32_t>& from, size_t first,
                            const std::array<uint32_t, 3>& triangle) {
    return {from[first + triangle[0]], from[first + triangle[1]], from[first + triangle[2]]};
  }

  ObjWords words_;
  RawMesh mesh_;
  Elements vertices_{"vertex", 0, 0, {}}, textures_{"texture coordinate", 0, 0, {}},
      normals_{"normal", 0, 0, {}};
  std::vector<double> numbers_;  // of the line at hand
  std::vector<Face> faces_;
  std::vector<uint32_t> corner_vertices_, corner_normals_;  // of all faces
};

}  // namespace

RawMesh parse_obj(const std::string& file) {
  const std::optional<std::string> text = read_whole_file(file);
  if (!text) throw InputError({file}, "cannot read the file");
  return ObjReader(file, *text).read();
}

}  // namespace limn
