// Wavefront OBJ. Every word of a vertex, a normal and a face is read: what a parser skips in silence
// is a surface that is missing. Polygons are split here, in linear time.
#include <fmt/format.h>

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

// Vertices, texture coordinates or normals, and what faces ask of them.
struct Elements {
  const char* name;
  size_t count = 0;
  int64_t largest = 0;  // index from 1 that any face has
  ObjWords::Position place;
};

constexpr size_t kMostElements = std::numeric_limits<int>::max();  // not tuned

class ObjReader {
 public:
  ObjReader(const std::string& file, const std::string& text) : words_(file, text) {
    mesh_.where = {file};
    while (!words_.at_end()) {
      read_statement(words_.next());
      words_.skip_line();
    }
    for (const Elements* e : {&vertices_, &textures_, &normals_}) {
      if (e->largest <= static_cast<int64_t>(e->count)) continue;
      words_.fail(e->place, fmt::format("a face refers to {} {}, but there are {}", e->name,
                                        e->largest, e->count));
    }
  }

  RawMesh take_mesh() {
    complete_uv();
    split_faces();
    return std::move(mesh_);
  }

 private:
  void read_statement(std::string_view keyword) {
    if (keyword == "v") {
      read_position();
      count(vertices_);
    } else if (keyword == "vn") {
      const std::vector<double>& n = read_numbers("normal", 3, 3);
      // Normals that are not finite are not used: zero is such a one.
      const bool finite = std::isfinite(n[0] + n[1] + n[2]);
      mesh_.normals.push_back(finite ? Vec3d{n[0], n[1], n[2]} : Vec3d{});
      count(normals_);
    } else if (keyword == "vt") {
      const std::vector<double>& uv = read_numbers("texture coordinate", 1, 3);
      const double u = uv[0], v = uv.size() < 2 ? 0 : uv[1];
      // What is so far off is refused where it is used.
      const bool finite = std::isfinite(u) && std::isfinite(v);
      mesh_.uv_places.push_back(finite ? Vec3f{static_cast<float>(u), static_cast<float>(v), 0}
                                       : Vec3f{1e38f, 1e38f, 0});
      count(textures_);
    } else if (keyword == "f") {
      read_face();
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

  // The numbers of the rest of the line, as many as that.
  const std::vector<double>& read_numbers(const std::string& what, size_t least, size_t most) {
    numbers_.clear();
    for (std::string_view word = words_.next(); !word.empty(); word = words_.next()) {
      const std::optional<double> number = parse_double(word);
      if (!number) words_.fail("not a number: \"" + std::string(word) + "\"");
      if (numbers_.size() == most) words_.fail(fmt::format("{}: more than {} numbers", what, most));
      numbers_.push_back(*number);
    }
    if (numbers_.size() < least) {
      words_.fail(fmt::format("{} needs {} numbers, not {}", what, least, numbers_.size()));
    }
    return numbers_;
  }

  // x y z, then a weight, a colour, or both, which nothing here uses.
  void read_position() {
    const ObjWords::Position begin = words_.where();
    const std::vector<double>& n = read_numbers("vertex", 3, 7);
    if (n.size() == 5) words_.fail(begin, "vertex: 5 numbers are neither x y z w nor x y z r g b");
    for (const double v : n) {
      if (!std::isfinite(v)) words_.fail(begin, "vertex is not finite");
      if (std::fabs(v) > std::numeric_limits<float>::max()) {
        words_.fail(begin, "vertex: a number is beyond a float's range (3.4e38)");
      }
      if (std::fabs(v) > kLargestCoordinate && mesh_.far_position == SIZE_MAX) {
        mesh_.far_position = vertices_.count;
        mesh_.far_where = words_.location(begin);
      }
    }
    mesh_.positions.push_back({n[0], n[1], n[2]});
  }

  void read_face() {
    faces_.push_back(words_.where());
    for (std::string_view word = words_.next(); !word.empty(); word = words_.next()) {
      read_corner(word);
    }
    const size_t before = ends_.back();
    ends_.push_back(corners_[0].size());
    if (ends_.back() - before < 3) {
      words_.fail(faces_.back(), "a face needs at least three corners");
    }
  }

  // v, v/vt, v//vn or v/vt/vn.
  void read_corner(std::string_view word) {
    std::array<std::string_view, 3> parts;
    size_t last = 0;
    for (std::string_view rest = word;; ++last) {
      const size_t slash = last < 2 ? std::min(rest.find('/'), rest.size()) : rest.size();
      parts[last] = rest.substr(0, slash);
      if (slash == rest.size()) break;
      rest.remove_prefix(slash + 1);
    }
    corners_[0].push_back(read_index(word, parts[0], vertices_));
    const bool has_uv = last == 1 || !parts[1].empty();
    corners_[1].push_back(has_uv ? read_index(word, parts[1], textures_) : kNone);
    corners_[2].push_back(last == 2 ? read_index(word, parts[2], normals_) : kNone);
  }

  // From zero. Indices count from 1 and may point ahead (checked at the end), or, if negative,
  // backwards from the latest element.
  uint32_t read_index(std::string_view word, std::string_view part, Elements& of) {
    const std::optional<int64_t> number = parse_integer(part);
    const auto refers = [&](const std::string& what) {
      words_.fail(fmt::format("a face refers to {} {}, but {}", of.name, *number, what));
    };
    if (!number) {
      words_.fail(
          fmt::format("a corner is v, v/vt, v//vn or v/vt/vn in whole numbers, not \"{}\"", word));
    }
    if (*number == 0) refers("they count from 1");
    const auto count = static_cast<int64_t>(of.count);
    if (*number < -count) refers(fmt::format("there are {} before it", count));
    if (*number < 0) return static_cast<uint32_t>(count + *number);
    if (*number > of.largest) {
      of.largest = *number;
      of.place = words_.where();
    }
    return static_cast<uint32_t>(*number - 1);
  }

  // Corners without texture coordinates have (0, 0) where others have some, as in Mitsuba.
  void complete_uv() {
    std::vector<uint32_t>& uvs = corners_[1];
    if (std::all_of(uvs.begin(), uvs.end(), [](uint32_t t) { return t == kNone; })) {
      mesh_.uv_places.clear();
      return;
    }
    mesh_.uv_source = UvSource::kPlane;
    const auto none = static_cast<uint32_t>(mesh_.uv_places.size());
    mesh_.uv_places.push_back({});
    for (uint32_t& t : uvs) t = std::min(t, none);
  }

  void split_faces() {
    const auto& [vertices, uvs, normals] = corners_;
    const bool has_normals =
        std::any_of(normals.begin(), normals.end(), [](uint32_t n) { return n != kNone; });
    std::vector<Vec3d> points;
    for (size_t f = 0; f + 1 < ends_.size(); ++f) {
      points.clear();
      for (size_t i = ends_[f]; i < ends_[f + 1]; ++i) {
        points.push_back(mesh_.positions[vertices[i]]);
      }
      const auto triangles = split_polygon(points);
      if (triangles.empty()) {
        words_.fail(faces_[f], fmt::format("a concave face of {} corners (at most {}): split it",
                                           points.size(), kMaxConcaveCorners));
      }
      for (const auto& t : triangles) {
        const auto picked = [&, first = ends_[f]](const std::vector<uint32_t>& from) {
          return FaceIndices{from[first + t[0]], from[first + t[1]], from[first + t[2]]};
        };
        mesh_.faces.push_back(picked(vertices));
        if (has_normals) mesh_.normal_ids.push_back(picked(normals));
        if (!mesh_.uv_places.empty()) mesh_.uv_ids.push_back(picked(uvs));
      }
    }
  }

  static constexpr uint32_t kNone = kNoNormal;

  ObjWords words_;
  Elements vertices_{"vertex", 0, 0, {}}, textures_{"texture coordinate", 0, 0, {}},
      normals_{"normal", 0, 0, {}};
  std::vector<double> numbers_;  // of the line at hand
  RawMesh mesh_;
  std::vector<ObjWords::Position> faces_;         // where they stand
  std::array<std::vector<uint32_t>, 3> corners_;  // vertices, texture coordinates, normals
  std::vector<size_t> ends_{0};                   // of each face's corners
};

}  // namespace

RawMesh parse_obj(const std::string& file) {
  const std::optional<std::string> text = read_whole_file(file);
  if (!text) throw InputError({file}, "cannot read the file");
  return ObjReader(file, *text).take_mesh();
}

}  // namespace limn
