// Parses property tags: numbers, colours, vectors, transforms.
#include "src/scene_file/scene_values.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "limn/core/names.h"
#include "src/base/text.h"
#include "src/scene_file/scene_tree.h"

namespace limn {

namespace {

[[noreturn]] void fail(const XmlAttribute& attribute, const XmlElement& element,
                       const std::string& expected) {
  throw InputError(attribute.where, "<" + element.name + ">: " + attribute.name + " must be " +
                                        expected + ", not \"" + attribute.value + "\"");
}

// Parses a number; values beyond the range of floats are errors, as they overflow later.
double parse_number(const XmlElement& element, const XmlAttribute& attribute, std::string_view word,
                    const std::string& expected) {
  const std::optional<double> number = parse_double(word);
  if (!number || !std::isfinite(*number)) fail(attribute, element, expected);
  if (std::fabs(*number) > std::numeric_limits<float>::max()) {
    fail(attribute, element, "within a float's range (3.4e38)");
  }
  return *number;
}

double parse_number(const XmlElement& element, const XmlAttribute& attribute) {
  return parse_number(element, attribute, attribute.value, "a finite number");
}

// Parses numbers separated by commas and blanks; `counts` lists the allowed numbers of them.
std::vector<double> parse_numbers(const XmlElement& element, const XmlAttribute& attribute,
                                  const std::vector<size_t>& counts) {
  std::vector<double> numbers;
  std::string expected;
  for (size_t count : counts) {
    expected += (expected.empty() ? "" : " or ") + std::to_string(count);
  }
  expected += expected == "1" ? " finite number" : " finite numbers";
  for (std::string_view word : split(attribute.value, ", \t\r\n")) {
    numbers.push_back(parse_number(element, attribute, word, expected));
  }
  if (std::find(counts.begin(), counts.end(), numbers.size()) == counts.end()) {
    fail(attribute, element, expected);
  }
  return numbers;
}

Vec3d three(const std::vector<double>& n) {
  return n.size() == 1 ? Vec3d{n[0], n[0], n[0]} : Vec3d{n[0], n[1], n[2]};
}

// A vector from value="..." or from x, y, z. Missing coordinates are `absent`, or an error if
// `all_needed`. Nothing if no attribute is present.
std::optional<Vec3d> parse_vector(const XmlElement& element, double absent, bool all_needed) {
  const XmlAttribute* value = element.find("value");
  Vec3d v{absent, absent, absent};
  int found = 0;
  std::string missing;
  for (int k = 0; k < 3; ++k) {
    const std::string axis(1, "xyz"[k]);
    const XmlAttribute* a = element.find(axis);
    if (a && value) {
      throw InputError(a->where,
                       "<" + element.name + ">: value and " + axis + " exclude each other");
    }
    if (a) {
      v[k] = parse_number(element, *a);
      ++found;
    } else {
      missing = axis;
    }
  }
  if (value) return three(parse_numbers(element, *value, {1, 3}));
  if (found == 0) return std::nullopt;
  if (all_needed && found < 3) {
    throw InputError(element.where,
                     "<" + element.name + ">: attribute \"" + missing + "\" is missing");
  }
  return v;
}

Matrix4 from_columns(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& translation) {
  Matrix4 r;
  for (int i = 0; i < 3; ++i) {
    r.m[i][0] = a[i];
    r.m[i][1] = b[i];
    r.m[i][2] = c[i];
    r.m[i][3] = translation[i];
  }
  return r;
}

Matrix4 parse_translate(const XmlElement& e) {
  check_attributes(e, {"value", "x", "y", "z"}, {});
  return from_columns({1, 0, 0}, {0, 1, 0}, {0, 0, 1}, parse_vector(e, 0, false).value_or(Vec3d{}));
}

Matrix4 parse_scale(const XmlElement& e) {
  check_attributes(e, {"value", "x", "y", "z"}, {});
  const Vec3d s = parse_vector(e, 1, false).value_or(Vec3d{1, 1, 1});
  return from_columns({s.x, 0, 0}, {0, s.y, 0}, {0, 0, s.z}, {});
}

// Rodrigues' formula, applied to the unit vectors.
Matrix4 parse_rotate(const XmlElement& e) {
  check_attributes(e, {"value", "x", "y", "z", "angle"}, {"angle"});
  Vec3d axis = parse_vector(e, 0, false).value_or(Vec3d{});
  const double angle = parse_number(e, *e.find("angle")) * (kPi / 180);
  if (angle == 0) return {};  // about whatever axis, or none
  const double size = std::hypot(axis.x, axis.y, axis.z);
  if (!(size > 0)) throw InputError(e.where, "<rotate>: the axis is zero");
  axis = axis / size;
  const double c = std::cos(angle), s = std::sin(angle);
  Vec3d columns[3];
  for (int i = 0; i < 3; ++i) {
    Vec3d unit;
    unit[i] = 1;
    columns[i] = unit * c + cross(axis, unit) * s + axis * (axis[i] * (1 - c));
  }
  return from_columns(columns[0], columns[1], columns[2], {});
}

Matrix4 parse_matrix(const XmlElement& e) {
  check_attributes(e, {"value"}, {"value"});
  const std::vector<double> n = parse_numbers(e, *e.find("value"), {9, 16});
  const size_t size = n.size() == 9 ? 3 : 4;
  Matrix4 r;
  for (size_t i = 0; i < size; ++i) {
    for (size_t j = 0; j < size; ++j) r.m[i][j] = n[i * size + j];
  }
  if (r.m[3][0] != 0 || r.m[3][1] != 0 || r.m[3][2] != 0 || r.m[3][3] != 1) {
    throw InputError(e.find("value")->where, "<matrix>: the last row must be 0 0 0 1");
  }
  return r;
}

// Camera to world: +X left, +Y up, +Z along the view. Without `up` an arbitrary perpendicular
// direction is used.
Matrix4 parse_lookat(const XmlElement& e) {
  check_attributes(e, {"origin", "target", "up"}, {"origin", "target"});
  const Vec3d origin = three(parse_numbers(e, *e.find("origin"), {3}));
  const Vec3d target = three(parse_numbers(e, *e.find("target"), {3}));
  Vec3d up;
  if (const XmlAttribute* a = e.find("up")) up = three(parse_numbers(e, *a, {3}));
  const Vec3d view = target - origin;
  const double distance = std::hypot(view.x, view.y, view.z);
  if (!(distance > 0)) throw InputError(e.where, "<lookat>: origin and target coincide");
  const Vec3d forward = view / distance;
  const double up_size = std::hypot(up.x, up.y, up.z);
  up = up_size > 0 ? up / up_size : Frame(forward).s;
  const Vec3d left = cross(up, forward);
  // The sine of the angle to `up`: below this, rounding decides the direction of left.
  if (length(left) < 1e-7) {
    throw InputError(e.where, "<lookat>: up points along the view");
  }
  const Vec3d unit_left = normalize(left);
  return from_columns(unit_left, cross(forward, unit_left), forward, origin);
}

using MatrixParser = Matrix4 (*)(const XmlElement&);

const std::map<std::string, MatrixParser>& transform_operations() {
  static const std::map<std::string, MatrixParser> operations = {{"lookat", parse_lookat},
                                                                 {"matrix", parse_matrix},
                                                                 {"rotate", parse_rotate},
                                                                 {"scale", parse_scale},
                                                                 {"translate", parse_translate}};
  return operations;
}

Matrix4 transform_in(const XmlElement& e) {
  Matrix4 result;
  for (const XmlElement& child : e.children) {
    const auto operation = transform_operations().find(child.name);
    if (operation == transform_operations().end()) {
      std::vector<std::string> known;
      for (const auto& [name, parser] : transform_operations()) known.push_back(name);
      throw InputError(child.where, "<transform>: unknown element <" + child.name + "> (" +
                                        known_names(known) + ")");
    }
    if (!child.children.empty()) {
      throw InputError(child.children[0].where, "<" + child.name + "> takes no elements");
    }
    result = operation->second(child) * result;
  }
  return result;
}

PropertyValue parse_transform(const XmlElement& e) {
  check_attributes(e, {"name"}, {"name"});
  return transform_in(e);
}

PropertyValue parse_animation(const XmlElement& e) {
  check_attributes(e, {"name"}, {"name"});
  Animation animation;
  for (const XmlElement& child : e.children) {
    if (child.name != "transform") {
      throw InputError(child.where,
                       "<animation>: takes <transform time=\"...\">, not <" + child.name + ">");
    }
    check_attributes(child, {"time"}, {"time"});
    const XmlAttribute& time = *child.find("time");
    animation.push_back({parse_number(child, time), transform_in(child), child.where});
    if (animation.size() > 1 && !(animation.back().time > animation.end()[-2].time)) {
      throw InputError(time.where, "<animation>: times must increase");
    }
  }
  if (animation.empty()) throw InputError(e.where, "<animation>: needs a <transform>");
  return animation;
}

const XmlAttribute& value_of(const XmlElement& e) {
  check_attributes(e, {"name", "value"}, {"name", "value"});
  return *e.find("value");
}

PropertyValue parse_boolean(const XmlElement& e) {
  const XmlAttribute& a = value_of(e);
  const std::string word = lower_case(a.value);
  if (word != "true" && word != "false") fail(a, e, "true or false");
  return word == "true";
}

PropertyValue parse_integer_property(const XmlElement& e) {
  const XmlAttribute& a = value_of(e);
  const std::optional<int64_t> number = parse_integer(a.value);
  if (!number) fail(a, e, "an integer");
  return *number;
}

PropertyValue parse_float(const XmlElement& e) { return parse_number(e, value_of(e)); }

PropertyValue parse_string(const XmlElement& e) { return value_of(e).value; }

PropertyValue parse_point(const XmlElement& e) {
  check_attributes(e, {"name", "value", "x", "y", "z"}, {"name"});
  const std::optional<Vec3d> v = parse_vector(e, 0, true);
  if (!v) throw InputError(e.where, "<" + e.name + ">: attribute \"value\" is missing");
  return *v;
}

PropertyValue parse_rgb(const XmlElement& e) {
  const Vec3d v = three(parse_numbers(e, value_of(e), {1, 3}));
  return Rgb<double>{v.x, v.y, v.z};
}

PropertyValue parse_spectrum(const XmlElement& e) {
  check_attributes(e, {"name", "value", "filename"}, {"name"});
  const XmlAttribute* value = e.find("value");
  const XmlAttribute* file = e.find("filename");
  if ((value != nullptr) == (file != nullptr)) {
    throw InputError(e.where, "<spectrum>: give either value or filename");
  }
  if (file) return SpectrumValue{{}, {}, file->value};
  if (value->value.find(':') == std::string::npos) {
    return SpectrumValue{parse_number(e, *value), {}, {}};
  }
  return SpectrumValue{{}, parse_spectrum(value->value, value->where), {}};
}

using PropertyParser = PropertyValue (*)(const XmlElement&);

const std::map<std::string, PropertyParser>& property_parsers() {
  static const std::map<std::string, PropertyParser> parsers = {
      {"animation", parse_animation}, {"boolean", parse_boolean},
      {"float", parse_float},         {"integer", parse_integer_property},
      {"point", parse_point},         {"rgb", parse_rgb},
      {"spectrum", parse_spectrum},   {"string", parse_string},
      {"transform", parse_transform}, {"vector", parse_point}};
  return parsers;
}

}  // namespace

const std::vector<std::string>& property_tags() {
  static const std::vector<std::string> tags = [] {
    std::vector<std::string> names;
    for (const auto& [name, parser] : property_parsers()) names.push_back(name);
    return names;
  }();
  return tags;
}

bool is_property_tag(const std::string& tag) { return property_parsers().count(tag) > 0; }

PropertyValue parse_property(const XmlElement& element) {
  if (element.name != "transform" && element.name != "animation" && !element.children.empty()) {
    throw InputError(element.children[0].where, "<" + element.name + "> takes no elements");
  }
  return property_parsers().at(element.name)(element);
}

}  // namespace limn
