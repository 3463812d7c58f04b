// Wavefront OBJ, parsed by tinyobjloader: this file is the one door to it. A check in front of it
// reads every word of a vertex, a normal and a face: what a parser skips in silence is a surface
// that is missing. Polygons are split here, in linear time.
#define TINYOBJLOADER_IMPLEMENTATION
#define TINYOBJLOADER_USE_DOUBLE
#include <fmt/format.h>
#include <tiny_obj_loader.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <sstream>

#include "limn/core/names.h"
#include "src/base/text.h"
#include "src/mesh/mesh_file.h"

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

  struct Position {
    int line = 1, column = 1;
  };
  // Of the word that next() gave last, or of the end that it met.
  Position where() const { return where_; }
  SourceLocation location(const Position& place) const { return {file_, place.line, place.column}; }
  [[noreturn]] void fail(const Position& place, const std::string& message) const {
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
  Position where_;
};

// Vertices, texture coordinates and normals, and what faces ask of them.
struct Elements {
  const char* name;
  size_t count = 0;
  int64_t largest = 0;  // index from 1 that any face has
  ObjWords::Position place;
};

// Of tinyobjloader's indices.
constexpr size_t kMostElements = std::numeric_limits<int>::max();

// What the check leaves for the parser: lines with v, vn, vt and f alone, none continued, all of
// them sound; and where the faces stand in the file.
class ObjCheck {
 public:
  ObjCheck(const std::string& file, const std::string& text) : words_(file, text) {
    while (!words_.at_end()) {
      check_statement(words_.next());
      words_.skip_line();
    }
    for (const Elements* e : {&vertices_, &textures_, &normals_}) {
      if (e->largest <= static_cast<int64_t>(e->count)) continue;
      words_.fail(e->place, fmt::format("a face refers to {} {}, but there are {}", e->name,
                                        e->largest, e->count));
    }
  }

  std::string take_lines() { return std::move(lines_); }
  const std::vector<ObjWords::Position>& faces() const { return faces_; }
  const ObjWords& words() const { return words_; }
  // The first vertex beyond kLargestCoordinate; SIZE_MAX if there is none.
  size_t far_position() const { return far_position_; }
  SourceLocation far_where() const { return words_.location(far_place_); }

 private:
  void check_statement(std::string_view keyword) {
    if (keyword == "v") {
      check_position();
      count(vertices_);
    } else if (keyword == "vn") {
      const std::vector<double>& n = check_numbers("normal", 3, 3);
      // Normals that are not finite are not used: zero is such a one.
      lines_ += "vn" + (std::isfinite(n[0] + n[1] + n[2]) ? rest_ : " 0 0 0") + "\n";
      count(normals_);
    } else if (keyword == "vt") {
      const std::vector<double>& uv = check_numbers("texture coordinate", 1, 3);
      const bool finite = std::isfinite(uv[0]) && (uv.size() < 2 || std::isfinite(uv[1]));
      // The parser would read others as 0; what is so far off is refused where it is used.
      lines_ += "vt" + (finite ? rest_ : " 1e38 1e38") + "\n";
      count(textures_);
    } else if (keyword == "f") {
      check_face();
    } else if (!keyword.empty() &&
               std::find(kSkipped.begin(), kSkipped.end(), keyword) == kSkipped.end()) {
      std::vector<std::string> known = kSkipped;
      known.insert(known.end(), {"f", "v", "vn", "vt"});
      std::sort(known.begin(), known.end());
      // What is no OBJ file may be none that a message should quote.
      if (vertices_.count == 0) {
        words_.fail("this is no statement of an OBJ file (" + known_names(known) + ")");
      }
      words_.fail(unknown_name("statement", std::string(keyword), known));
    }
  }

  void count(Elements& of) const {
    if (++of.count > kMostElements) words_.fail("more of a kind than 2147483647: split the file");
  }

  // The numbers of the rest of the line, as many as that; their words in rest_.
  const std::vector<double>& check_numbers(const std::string& what, size_t least, size_t most) {
    numbers_.clear();
    rest_.clear();
    for (std::string_view word = words_.next(); !word.empty(); word = words_.next()) {
      const std::optional<double> number = parse_double(word);
      if (!number) words_.fail("not a number: \"" + std::string(word) + "\"");
      if (numbers_.size() == most) words_.fail(fmt::format("{}: more than {} numbers", what, most));
      numbers_.push_back(*number);
      (rest_ += ' ') += word;
    }
    if (numbers_.size() < least) {
      words_.fail(fmt::format("{} needs {} numbers, not {}", what, least, numbers_.size()));
    }
    return numbers_;
  }

  // x y z, then a weight, a colour, or both, which nothing here uses.
  void check_position() {
    const ObjWords::Position begin = words_.where();
    const std::vector<double>& n = check_numbers("vertex", 3, 7);
    if (n.size() == 5) words_.fail(begin, "vertex: 5 numbers are neither x y z w nor x y z r g b");
    for (const double v : n) {
      if (!std::isfinite(v)) words_.fail(begin, "vertex is not finite");
      if (std::fabs(v) > std::numeric_limits<float>::max()) {
        words_.fail(begin, "vertex: a number is beyond a float's range (3.4e38)");
      }
      if (std::fabs(v) > kLargestCoordinate && far_position_ == SIZE_MAX) {
        far_position_ = vertices_.count;
        far_place_ = begin;
      }
    }
    lines_ += "v" + rest_ + "\n";
  }

  void check_face() {
    faces_.push_back(words_.where());
    lines_ += 'f';
    int corners = 0;
    for (std::string_view word = words_.next(); !word.empty(); word = words_.next(), ++corners) {
      check_corner(word);
      (lines_ += ' ') += word;
    }
    lines_ += '\n';
    if (corners < 3) words_.fail(faces_.back(), "a face needs at least three corners");
  }

  // v, v/vt, v//vn or v/vt/vn.
  void check_corner(std::string_view word) {
    std::array<std::string_view, 3> parts;
    size_t last = 0;
    for (std::string_view rest = word;; ++last) {
      const size_t slash = last < 2 ? std::min(rest.find('/'), rest.size()) : rest.size();
      parts[last] = rest.substr(0, slash);
      if (slash == rest.size()) break;
      rest.remove_prefix(slash + 1);
    }
    check_index(word, parts[0], vertices_);
    if (last == 1 || !parts[1].empty()) check_index(word, parts[1], textures_);
    if (last == 2) check_index(word, parts[2], normals_);
  }

  // Indices count from 1 and may point ahead (checked at the end), or, if negative, backwards from
  // the latest element.
  void check_index(std::string_view word, std::string_view part, Elements& of) {
    const std::optional<int64_t> number = parse_integer(part);
    const auto refers = [&](const std::string& what) {
      words_.fail(fmt::format("a face refers to {} {}, but {}", of.name, *number, what));
    };
    if (!number) {
      words_.fail(
          fmt::format("a corner is v, v/vt, v//vn or v/vt/vn in whole numbers, not \"{}\"", word));
    }
    if (*number == 0) refers("they count from 1");
    if (*number < -static_cast<int64_t>(of.count)) {
      refers(fmt::format("there are {} before it", of.count));
    }
    if (*number <= of.largest) return;
    of.largest = *number;
    of.place = words_.where();
  }

  ObjWords words_;
  Elements vertices_{"vertex", 0, 0, {}}, textures_{"texture coordinate", 0, 0, {}},
      normals_{"normal", 0, 0, {}};
  std::vector<double> numbers_;  // of the line at hand
  std::string rest_, lines_;
  std::vector<ObjWords::Position> faces_;
  size_t far_position_ = SIZE_MAX;
  ObjWords::Position far_place_;
};

// What the parser calls back with: elements as they come, faces with all their corners.
struct Parsed {
  RawMesh mesh;
  std::vector<uint32_t> vertices, normals, uvs;  // of all corners
  std::vector<size_t> ends{0};                   // of each face's corners

  static constexpr uint32_t kNoUv = UINT32_MAX;

  static uint32_t from_zero(int index, size_t count) {
    return static_cast<uint32_t>(index > 0 ? index - 1 : static_cast<int64_t>(count) + index);
  }
  static Parsed& of(void* parsed) { return *static_cast<Parsed*>(parsed); }
  static tinyobj::callback_t callbacks() {
    tinyobj::callback_t calls;
    calls.vertex_cb = [](void* to, double x, double y, double z, double) {
      of(to).mesh.positions.push_back({x, y, z});
    };
    calls.normal_cb = [](void* to, double x, double y, double z) {
      of(to).mesh.normals.push_back({x, y, z});
    };
    calls.texcoord_cb = [](void* to, double u, double v, double) {
      of(to).mesh.uv_places.push_back({static_cast<float>(u), static_cast<float>(v), 0});
    };
    calls.index_cb = [](void* to, tinyobj::index_t* corners, int count) {
      Parsed& p = of(to);
      for (const tinyobj::index_t& c : std::span(corners, static_cast<size_t>(count))) {
        p.vertices.push_back(from_zero(c.vertex_index, p.mesh.positions.size()));
        p.normals.push_back(c.normal_index == 0 ? kNoNormal
                                                : from_zero(c.normal_index, p.mesh.normals.size()));
        p.uvs.push_back(
            c.texcoord_index == 0 ? kNoUv : from_zero(c.texcoord_index, p.mesh.uv_places.size()));
      }
      p.ends.push_back(p.vertices.size());
    };
    return calls;
  }

  // Corners without texture coordinates have (0, 0) where others have some, as in Mitsuba.
  void complete_uv() {
    if (std::all_of(uvs.begin(), uvs.end(), [](uint32_t t) { return t == kNoUv; })) {
      mesh.uv_places.clear();
      return;
    }
    mesh.uv_source = UvSource::kPlane;
    const auto none = static_cast<uint32_t>(mesh.uv_places.size());
    mesh.uv_places.push_back({});
    for (uint32_t& t : uvs) t = std::min(t, none);
  }

  void split_faces(const ObjCheck& check) {
    complete_uv();
    const bool has_normals =
        std::any_of(normals.begin(), normals.end(), [](uint32_t n) { return n != kNoNormal; });
    std::vector<Vec3d> corners;
    for (size_t f = 0; f + 1 < ends.size(); ++f) {
      corners.clear();
      for (size_t i = ends[f]; i < ends[f + 1]; ++i) corners.push_back(mesh.positions[vertices[i]]);
      const auto triangles = split_polygon(corners);
      if (triangles.empty()) {
        check.words().fail(check.faces()[f],
                           fmt::format("a concave face of {} corners (at most {}): split it",
                                       corners.size(), kMaxConcaveCorners));
      }
      for (const auto& t : triangles) {
        const auto picked = [&, first = ends[f]](const std::vector<uint32_t>& from) {
          return FaceIndices{from[first + t[0]], from[first + t[1]], from[first + t[2]]};
        };
        mesh.faces.push_back(picked(vertices));
        if (has_normals) mesh.normal_ids.push_back(picked(normals));
        if (!mesh.uv_places.empty()) mesh.uv_ids.push_back(picked(uvs));
      }
    }
  }
};

}  // namespace

RawMesh parse_obj(const std::string& file) {
  const std::string text = read_whole_file(file);
  ObjCheck check(file, text);
  Parsed parsed;
  std::istringstream lines(check.take_lines());
  if (!tinyobj::LoadObjWithCallback(lines, Parsed::callbacks(), &parsed)) {
    throw InputError({file}, "cannot be parsed");
  }
  parsed.mesh.where = {file};
  parsed.mesh.far_position = check.far_position();
  if (check.far_position() != SIZE_MAX) parsed.mesh.far_where = check.far_where();
  parsed.split_faces(check);
  return std::move(parsed.mesh);
}

}  // namespace limn
