// Stanford PLY: ascii and both binary byte orders.
#include <algorithm>
#include <bit>
#include <cfloat>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>

#include "src/base/text.h"
#include "src/mesh/mesh_file.h"

namespace limn {

namespace {

enum class Number { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

std::optional<Number> number_type(std::string_view name) {
  static const std::map<std::string_view, Number> types = {
      {"char", Number::kInt8},      {"int8", Number::kInt8},       {"uchar", Number::kUint8},
      {"uint8", Number::kUint8},    {"short", Number::kInt16},     {"int16", Number::kInt16},
      {"ushort", Number::kUint16},  {"uint16", Number::kUint16},   {"int", Number::kInt32},
      {"int32", Number::kInt32},    {"uint", Number::kUint32},     {"uint32", Number::kUint32},
      {"float", Number::kFloat32},  {"float32", Number::kFloat32}, {"double", Number::kFloat64},
      {"float64", Number::kFloat64}};
  const auto found = types.find(name);
  if (found == types.end()) return std::nullopt;
  return found->second;
}

bool is_integer(Number type) { return type != Number::kFloat32 && type != Number::kFloat64; }

constexpr size_t bytes_of(Number type) {
  constexpr size_t kBytes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kBytes[static_cast<size_t>(type)];
}

// The smallest and the largest number of a type.
std::pair<double, double> range_of(Number type) {
  switch (type) {
    case Number::kInt8:
      return {INT8_MIN, INT8_MAX};
    case Number::kUint8:
      return {0, UINT8_MAX};
    case Number::kInt16:
      return {INT16_MIN, INT16_MAX};
    case Number::kUint16:
      return {0, UINT16_MAX};
    case Number::kInt32:
      return {INT32_MIN, INT32_MAX};
    case Number::kUint32:
      return {0, UINT32_MAX};
    case Number::kFloat32:
      return {-FLT_MAX, FLT_MAX};
    case Number::kFloat64:
      return {-DBL_MAX, DBL_MAX};
  }
  return {};
}

struct PlyProperty {
  std::string name;
  Number type;
  std::optional<Number> list_size;  // set for lists
};

struct PlyElement {
  std::string name;
  uint64_t count = 0;
  std::vector<PlyProperty> properties;
  int line = 0;  // of its declaration
};

// Where reading is, and what to blame.
class PlyCursor {
 public:
  PlyCursor(std::string file, const std::string& data)
      : file_(std::move(file)), data_(data), line_begin_(data.data()) {}

  // In text at the latest word; in binary bodies the byte is stated, counted from 0.
  [[noreturn]] void fail(const std::string& message) const { fail_at_column(column_, message); }
  // Of an element as a whole.
  [[noreturn]] void fail_element(const std::string& message) const { fail_at_column(0, message); }
  [[noreturn]] void fail_at(int line, const std::string& message) const {
    throw InputError({file_, line}, message);
  }
  int line() const { return line_; }

  // The next line without its end; nothing at the end of the file.
  std::optional<std::string_view> next_line() {
    if (next_ >= data_.size()) return std::nullopt;
    const size_t end = std::min(data_.find('\n', next_), data_.size());
    std::string_view line(data_.data() + next_, end - next_);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    line_begin_ = line.data();
    next_ = std::min(end + 1, data_.size());
    ++line_;
    column_ = 0;
    return line;
  }

  bool is_binary() const { return binary_; }
  size_t bytes_left() const { return data_.size() - next_; }

  void start_body(bool binary, bool big_endian) {
    binary_ = binary;
    swap_ = big_endian == (std::endian::native == std::endian::little);
  }

  // Ascii bodies have one element per line, blank lines apart.
  void start_element(const std::string& what) {
    what_ = what;
    if (binary_) return;
    words_.clear();
    used_ = 0;
    while (words_.empty()) {
      const std::optional<std::string_view> line = next_line();
      if (!line) fail_element("the file ends before " + what_);
      words_ = split(*line, " \t");
    }
  }
  void end_element() {
    if (binary_ || used_ == words_.size()) return;
    set_column(words_[used_]);
    fail(what_ + ": too many numbers on the line");
  }

  // Nothing but blank lines may follow the last element.
  void end_body() {
    if (binary_) {
      if (bytes_left() > 0)
        fail(std::to_string(bytes_left()) + " bytes follow the last element of the header");
      return;
    }
    while (const std::optional<std::string_view> line = next_line()) {
      const std::vector<std::string_view> words = split(*line, " \t");
      if (words.empty()) continue;
      set_column(words[0]);
      fail("\"" + std::string(words[0]) + "\" follows the last element of the header");
    }
  }

  double number(Number type) { return binary_ ? binary_number(type) : ascii_number(type); }

  // Numbers of this type that can still come for this element, at most.
  size_t numbers_left(Number type) const {
    return binary_ ? bytes_left() / bytes_of(type) : words_.size() - used_;
  }

 private:
  [[noreturn]] void fail_at_column(int column, const std::string& message) const {
    if (!binary_) throw InputError({file_, line_, column}, message);
    throw InputError({file_}, message + " (at byte " + std::to_string(next_) + ")");
  }
  void set_column(std::string_view word) {
    column_ = static_cast<int>(word.data() - line_begin_) + 1;
  }

  double ascii_number(Number type) {
    if (used_ >= words_.size()) fail(what_ + ": too few numbers on the line");
    const std::string_view word = words_[used_++];
    set_column(word);
    const std::optional<double> number = parse_double(word);
    if (!number) fail(what_ + ": not a number: \"" + std::string(word) + "\"");
    if (is_integer(type) && *number != std::floor(*number)) {
      fail(what_ + ": not a whole number: \"" + std::string(word) + "\"");
    }
    const auto [least, most] = range_of(type);
    if (*number < least || *number > most) {
      // Infinity is no mistake in what nobody uses.
      if (is_integer(type) || std::isfinite(*number)) {
        fail(what_ + ": beyond the range of its type: \"" + std::string(word) + "\"");
      }
    }
    return *number;
  }

  template <class T>
  double take() {
    if (data_.size() - next_ < sizeof(T)) fail("the file ends inside " + what_);
    char bytes[sizeof(T)];
    std::memcpy(bytes, data_.data() + next_, sizeof(T));
    next_ += sizeof(T);
    if (swap_) std::reverse(bytes, bytes + sizeof(T));
    T number;
    std::memcpy(&number, bytes, sizeof(T));
    return static_cast<double>(number);
  }

  double binary_number(Number type) {
    switch (type) {
      case Number::kInt8:
        return take<int8_t>();
      case Number::kUint8:
        return take<uint8_t>();
      case Number::kInt16:
        return take<int16_t>();
      case Number::kUint16:
        return take<uint16_t>();
      case Number::kInt32:
        return take<int32_t>();
      case Number::kUint32:
        return take<uint32_t>();
      case Number::kFloat32:
        return take<float>();
      case Number::kFloat64:
        return take<double>();
    }
    return 0;
  }

  std::string file_;
  const std::string& data_;
  size_t next_ = 0;
  const char* line_begin_;
  int line_ = 0, column_ = 0;
  bool binary_ = false;
  bool swap_ = false;
  std::string what_;
  std::vector<std::string_view> words_;
  size_t used_ = 0;
};

Number declared_type(const PlyCursor& in, std::string_view name) {
  const std::optional<Number> type = number_type(name);
  if (!type) in.fail("unknown type \"" + std::string(name) + "\"");
  return *type;
}

PlyProperty parse_property(const PlyCursor& in, const std::vector<std::string_view>& words) {
  if (words.size() == 3) {
    return {std::string(words[2]), declared_type(in, words[1]), std::nullopt};
  }
  if (words.size() == 5 && words[1] == "list") {
    const Number size = declared_type(in, words[2]);
    if (!is_integer(size)) in.fail("the size of a list must be an integer");
    return {std::string(words[4]), declared_type(in, words[3]), size};
  }
  in.fail("malformed property (property TYPE NAME, or property list TYPE TYPE NAME)");
}

void parse_format(PlyCursor& in, const std::vector<std::string_view>& words) {
  if (words.empty()) in.fail("the header has no format");
  const std::string_view kind = words[1];
  if (kind == "ascii") {
    in.start_body(false, false);
  } else if (kind == "binary_little_endian" || kind == "binary_big_endian") {
    in.start_body(true, kind == "binary_big_endian");
  } else {
    in.fail("unknown format \"" + std::string(kind) +
            "\" (known: ascii, binary_little_endian, binary_big_endian)");
  }
}

constexpr size_t kMostParts = 1024;  // elements, and properties of each; not tuned

void add_property(const PlyCursor& in, PlyElement& element, const PlyProperty& property) {
  for (const PlyProperty& p : element.properties) {
    if (p.name == property.name) {
      in.fail("element " + element.name + " has a second property " + p.name);
    }
  }
  if (element.properties.size() == kMostParts) in.fail("more than 1024 properties");
  element.properties.push_back(property);
}

// Before anything is taken for them: that a binary file can hold what its header counts. (Text is
// read line by line, and nothing is taken for lines that do not come.)
void check_counts(const PlyCursor& in, const std::vector<PlyElement>& elements) {
  if (!in.is_binary()) return;
  auto left = static_cast<double>(in.bytes_left());
  for (const PlyElement& e : elements) {
    size_t each = 0;
    for (const PlyProperty& p : e.properties) each += bytes_of(p.list_size.value_or(p.type));
    const double needed = static_cast<double>(each) * static_cast<double>(e.count);
    if (needed > left) {
      in.fail_at(e.line, "element " + e.name + ": the file ends before " + std::to_string(e.count) +
                             " of them, of " + std::to_string(each) + " bytes at least");
    }
    left -= needed;
  }
}

std::vector<PlyElement> parse_header(PlyCursor& in) {
  std::vector<PlyElement> elements;
  if (in.next_line().value_or("") != "ply") in.fail_at(1, "not a PLY file");
  std::vector<std::string_view> format;
  while (true) {
    const std::optional<std::string_view> line = in.next_line();
    if (!line) in.fail_at(in.line(), "the file ends inside its header");
    const std::vector<std::string_view> words = split(*line, " \t");
    if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
    if (words[0] == "end_header") break;
    if (words[0] == "format") {
      if (!format.empty()) in.fail("a second format");
      if (words.size() != 3) in.fail("malformed format (format KIND VERSION)");
      if (words[2] != "1.0") {
        in.fail("version " + std::string(words[2]) + " is not read (known: 1.0)");
      }
      format = words;
    } else if (words[0] == "element") {
      const auto count = words.size() == 3 ? parse_integer(words[2]) : std::nullopt;
      if (!count || *count < 0) in.fail("malformed element (element NAME COUNT)");
      const auto same = [&](const PlyElement& e) { return e.name == words[1]; };
      if (std::any_of(elements.begin(), elements.end(), same)) {
        in.fail("a second element " + std::string(words[1]));
      }
      if (elements.size() == kMostParts) in.fail("more than 1024 elements");
      elements.push_back({std::string(words[1]), static_cast<uint64_t>(*count), {}, in.line()});
    } else if (words[0] == "property") {
      if (elements.empty()) in.fail("property before any element");
      add_property(in, elements.back(), parse_property(in, words));
    } else {
      in.fail("unknown keyword \"" + std::string(words[0]) + "\" in the header");
    }
  }
  for (const PlyElement& e : elements) {
    if (e.properties.empty()) in.fail_at(e.line, "element " + e.name + " has no properties");
  }
  parse_format(in, format);
  check_counts(in, elements);
  return elements;
}

// Number of an element's scalar property; nothing if it has none of this name.
std::optional<size_t> scalar_index(const PlyElement& element, const std::string& name) {
  for (size_t i = 0; i < element.properties.size(); ++i) {
    if (element.properties[i].name == name && !element.properties[i].list_size) return i;
  }
  return std::nullopt;
}

// All numbers of one element: values[property][item].
void read_element(PlyCursor& in, const PlyElement& element, uint64_t index,
                  std::vector<std::vector<double>>& values) {
  const std::string what = element.name + " " + std::to_string(index);
  in.start_element(what);
  values.resize(element.properties.size());
  for (size_t i = 0; i < element.properties.size(); ++i) {
    const PlyProperty& property = element.properties[i];
    double size = property.list_size ? in.number(*property.list_size) : 1;
    if (size < 0) in.fail(what + ": list " + property.name + " has a negative size");
    if (property.list_size && size > static_cast<double>(in.numbers_left(property.type))) {
      in.fail(what + ": list " + property.name + " of " +
              std::to_string(static_cast<int64_t>(size)) + " numbers, but the " +
              (in.is_binary() ? "file" : "line") + " ends before");
    }
    values[i].clear();
    for (; size > 0; --size) values[i].push_back(in.number(property.type));
  }
  in.end_element();
}

// Of the texture coordinates, by any of their names.
std::optional<std::array<size_t, 2>> uv_indices(const PlyElement& element) {
  constexpr const char* kNames[][2] = {{"u", "v"}, {"s", "t"}, {"texture_u", "texture_v"}};
  for (const auto& name : kNames) {
    const auto u = scalar_index(element, name[0]), v = scalar_index(element, name[1]);
    if (u && v) return std::array<size_t, 2>{*u, *v};
  }
  return std::nullopt;
}

// An attribute, and the properties that are its numbers: one or three.
struct PlyAttribute {
  RawMesh::Attribute attribute;
  std::vector<size_t> properties;

  void add(const std::vector<std::vector<double>>& values) {
    std::array<float, 3> numbers{};
    for (size_t c = 0; c < 3; ++c) {
      const double v = values[properties[std::min(c, properties.size() - 1)]][0];
      numbers[c] = std::fabs(v) <= FLT_MAX ? static_cast<float>(v) : NAN;
    }
    attribute.values.push_back(numbers);
  }
};

// Properties that share what stands before their last "_" are an attribute; r g b, or red green
// blue, are "color". kind: "vertex_" or "face_".
std::vector<PlyAttribute> find_attributes(const PlyElement& element, const std::string& kind) {
  std::vector<PlyAttribute> found;
  constexpr const char* kColours[][3] = {{"r", "g", "b"}, {"red", "green", "blue"}};
  for (const auto& [r, g, b] : kColours) {
    const auto i = scalar_index(element, r), j = scalar_index(element, g),
               k = scalar_index(element, b);
    if (!i || !j || !k || !found.empty()) continue;
    found.emplace_back().attribute.name = kind + "color";
    found[0].properties = {*i, *j, *k};
  }
  for (size_t i = 0; i < element.properties.size(); ++i) {
    const PlyProperty& property = element.properties[i];
    const size_t end = property.name.rfind('_');
    if (end == std::string::npos || property.list_size || property.name.starts_with("texture_")) {
      continue;
    }
    const std::string name = kind + property.name.substr(0, end);
    size_t same = 0;
    while (same < found.size() && found[same].attribute.name != name) ++same;
    if (same == found.size()) found.emplace_back().attribute.name = name;
    found[same].properties.push_back(i);
  }
  std::erase_if(found, [](const PlyAttribute& a) {
    return a.properties.size() != 1 && a.properties.size() != 3;
  });
  return found;
}

void keep(std::vector<PlyAttribute>& attributes, RawMesh& mesh) {
  for (PlyAttribute& a : attributes) mesh.attributes.push_back(std::move(a.attribute));
}

void read_vertices(PlyCursor& in, const PlyElement& element, RawMesh& mesh) {
  std::array<std::optional<size_t>, 3> p, n;
  for (int k = 0; k < 3; ++k) {
    const std::string axis(1, "xyz"[k]);
    p[k] = scalar_index(element, axis);
    n[k] = scalar_index(element, "n" + axis);
    if (!p[k]) in.fail_at(element.line, "element vertex has no property " + axis);
  }
  const bool has_normals = n[0] && n[1] && n[2];
  const auto uv = uv_indices(element);
  std::vector<PlyAttribute> attributes = find_attributes(element, "vertex_");
  std::vector<std::vector<double>> values;
  for (uint64_t i = 0; i < element.count; ++i) {
    read_element(in, element, i, values);
    Vec3d position, normal;
    for (int k = 0; k < 3; ++k) {
      position[k] = values[*p[k]][0];
      if (has_normals) normal[k] = values[*n[k]][0];
      const std::string what = "vertex " + std::to_string(i);
      if (!std::isfinite(position[k])) in.fail_element(what + ": the position is not finite");
      if (std::fabs(position[k]) > FLT_MAX) {
        in.fail_element(what + ": the position is beyond a float's range (3.4e38)");
      }
    }
    mesh.positions.push_back(position);
    if (has_normals) mesh.normals.push_back(normal);
    for (PlyAttribute& a : attributes) a.add(values);
    if (!uv) continue;
    mesh.uv_places.push_back(
        {static_cast<float>(values[(*uv)[0]][0]), static_cast<float>(values[(*uv)[1]][0]), 0});
  }
  keep(attributes, mesh);
}

void read_faces(PlyCursor& in, const PlyElement& element, uint64_t vertex_count, RawMesh& mesh) {
  size_t list = element.properties.size();
  for (size_t i = 0; i < element.properties.size(); ++i) {
    const PlyProperty& p = element.properties[i];
    if (p.list_size && (p.name == "vertex_indices" || p.name == "vertex_index")) list = i;
  }
  if (list == element.properties.size()) {
    in.fail_at(element.line, "element face has no list vertex_indices (or vertex_index)");
  }
  if (!is_integer(element.properties[list].type)) {
    in.fail_at(element.line, "vertex_indices must be integers");
  }
  std::vector<PlyAttribute> attributes = find_attributes(element, "face_");
  std::vector<std::vector<double>> values;
  for (uint64_t i = 0; i < element.count; ++i) {
    read_element(in, element, i, values);
    const std::vector<double>& corners = values[list];
    const std::string what = "face " + std::to_string(i);
    if (corners.size() != 3) {
      in.fail_element(what + " has " + std::to_string(corners.size()) +
                      " corners: only triangles are read");
    }
    FaceIndices face{};
    for (int k = 0; k < 3; ++k) {
      if (!(corners[k] >= 0 && corners[k] < static_cast<double>(vertex_count))) {
        in.fail_element(what + " refers to vertex " +
                        std::to_string(static_cast<int64_t>(corners[k])) + ", but there are " +
                        std::to_string(vertex_count) + " (counted from 0)");
      }
      face[k] = static_cast<uint32_t>(corners[k]);
    }
    mesh.faces.push_back(face);
    for (PlyAttribute& a : attributes) a.add(values);
  }
  keep(attributes, mesh);
}

}  // namespace

RawMesh parse_ply(const std::string& file) {
  const std::string data = read_whole_file(file);
  PlyCursor in(file, data);
  const std::vector<PlyElement> elements = parse_header(in);
  const auto vertices = std::find_if(elements.begin(), elements.end(),
                                     [](const PlyElement& e) { return e.name == "vertex"; });
  const uint64_t vertex_count = vertices == elements.end() ? 0 : vertices->count;
  if (vertex_count >= UINT32_MAX) in.fail_at(vertices->line, "too many vertices");
  RawMesh mesh;
  mesh.where = {file};
  std::vector<std::vector<double>> skipped;
  for (const PlyElement& element : elements) {
    if (element.name == "vertex") {
      read_vertices(in, element, mesh);
    } else if (element.name == "face") {
      read_faces(in, element, vertex_count, mesh);
    } else {
      for (uint64_t i = 0; i < element.count; ++i) read_element(in, element, i, skipped);
    }
  }
  in.end_body();
  if (!mesh.normals.empty()) mesh.normal_ids = mesh.faces;
  if (!mesh.uv_places.empty()) {
    mesh.uv_source = UvSource::kPlane;
    mesh.uv_ids = mesh.faces;
  }
  return mesh;
}

}  // namespace limn
