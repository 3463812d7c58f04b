// Renames the parameters of formats before 2.0.0, and replaces types that are gone.
#include "src/scene_file/old_format.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>

#include "limn/core/image.h"
#include "src/base/text.h"
#include "src/scene_file/scene_tree.h"

namespace limn {

namespace {

std::optional<double> parse_hexadecimal(std::string_view digits) {
  int number = 0;
  const char* const end = digits.data() + digits.size();
  const auto [stop, error] = std::from_chars(digits.data(), end, number, 16);
  return error == std::errc() && stop == end && number >= 0 ? std::optional(1.0 * number)
                                                            : std::nullopt;
}

bool is_lower(char c) { return c >= 'a' && c <= 'z'; }
bool is_upper(char c) { return c >= 'A' && c <= 'Z'; }

// "toWorld" becomes "to_world", "intIOR" "int_ior".
std::string snake_case(const std::string& name) {
  std::string result;
  bool in_capitals = false;
  for (size_t i = 0; i < name.size(); ++i) {
    const bool begins = i > 0 && is_lower(name[i - 1]) && is_upper(name[i]);
    in_capitals = is_upper(name[i]) && (begins || in_capitals);
    if (begins) result += '_';
    result += in_capitals ? static_cast<char>(name[i] - 'A' + 'a') : name[i];
  }
  return result;
}

XmlAttribute* attribute(XmlElement& element, const std::string& name) {
  for (XmlAttribute& a : element.attributes) {
    if (a.name == name) return &a;
  }
  return nullptr;
}

bool has_value(const XmlElement& element, const std::string& name, const std::string& value) {
  const XmlAttribute* a = element.find(name);
  return a && a->value == value;
}

// uscale, vscale, uoffset and voffset become a transform to_uv.
void join_uv(XmlElement& texture) {
  static const std::vector<std::string> kNames = {"uscale", "vscale", "uoffset", "voffset"};
  XmlElement scale{"scale", texture.where, {}, {}}, translate{"translate", texture.where, {}, {}};
  std::vector<XmlElement> kept;
  for (XmlElement& child : texture.children) {
    const XmlAttribute* name = child.find("name");
    const XmlAttribute* value = child.find("value");
    const bool taken = name && value && child.name == "float" &&
                       std::find(kNames.begin(), kNames.end(), name->value) != kNames.end();
    if (!taken) {
      kept.push_back(std::move(child));
      continue;
    }
    XmlElement& operation = name->value.ends_with("scale") ? scale : translate;
    operation.attributes.push_back({name->value[0] == 'u' ? "x" : "y", value->value, value->where});
  }
  texture.children = std::move(kept);
  if (scale.attributes.empty() && translate.attributes.empty()) return;
  XmlElement to_uv{"transform", texture.where, {{"name", "to_uv", texture.where}}, {}};
  for (XmlElement* operation : {&scale, &translate}) {
    if (!operation->attributes.empty()) to_uv.children.push_back(std::move(*operation));
  }
  texture.children.push_back(std::move(to_uv));
}

// Objects that Mitsuba 3 lacks, and what images like theirs come from.
struct Replacement {
  const char* tag;
  std::vector<std::string> types;
  const char* type;               // in their place
  std::vector<std::string> kept;  // of their named parameters
};

const std::vector<Replacement>& replacements() {
  static const std::vector<Replacement> all = {
      {"integrator",
       {"bdpt", "erpt", "guided_path", "guidedpath", "mlt", "photonmapper", "ppm", "pssmlt",
        "recursive_path", "sppm", "vcm", "vpl"},
       "path",
       {"maxDepth", "rrDepth"}},
      {"film",
       {"ldrfilm"},
       "hdrfilm",
       {"width", "height", "cropOffsetX", "cropOffsetY", "cropWidth", "cropHeight"}},
      {"sampler", {"halton", "hammersley", "sobol"}, "independent", {"sampleCount"}},
  };
  return all;
}

bool is_among(const std::vector<std::string>& list, const std::string& word) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

void replace_type(XmlElement& element, std::vector<std::string>& warnings) {
  XmlAttribute* const type = attribute(element, "type");
  if (!type) return;
  for (const Replacement& r : replacements()) {
    if (element.name != r.tag || !is_among(r.types, type->value)) continue;
    const bool is_film = element.name == "film";
    warnings.push_back(format_warning(element.where, element.name + " \"" + type->value +
                                                         "\" is read as " + r.type +
                                                         ", without parameters of its own"));
    type->value = r.type;
    std::erase_if(element.children, [&](const XmlElement& child) {
      const XmlAttribute* name = child.find("name");
      return name ? !is_among(r.kept, name->value) : !is_film;  // a film keeps its filter
    });
  }
}

// Parameters that Mitsuba 3 lacks.
void drop_parameters(XmlElement& element, std::vector<std::string>& warnings) {
  static const std::vector<std::string> kDropped = {"attachLog", "highQualityEdges",
                                                    "strictNormals"};
  const bool is_sampler = element.name == "sampler";
  std::erase_if(element.children, [&](const XmlElement& child) {
    const XmlAttribute* name = child.find("name");
    if (is_sampler && has_value(child, "name", "dimension")) return true;
    if (child.name != "boolean" || !name || !is_among(kDropped, name->value)) return false;
    if (has_value(child, "value", "true")) {
      warnings.push_back(format_warning(child.where, name->value + " is ignored"));
    }
    return true;
  });
}

// A <spectrum> of three numbers and an <srgb> become an <rgb>, also where they are "#rrggbb".
void upgrade_colour(XmlElement& element) {
  XmlAttribute* const value = attribute(element, "value");
  if (!value) return;
  const bool is_srgb = element.name == "srgb";
  const bool is_list = element.name == "spectrum" && value->value.find(':') == std::string::npos &&
                       split(value->value, ", \t\n\r").size() == 3;
  if (!is_srgb && !is_list && element.name != "rgb") return;
  std::array<std::optional<double>, 3> channels;
  if (value->value.starts_with('#') && value->value.size() == 7) {
    for (size_t i = 0; i < 3; ++i) {
      channels[i] = parse_hexadecimal(std::string_view(value->value).substr(1 + 2 * i, 2));
      if (channels[i]) *channels[i] /= 255;
    }
  } else if (is_srgb) {
    const std::vector<std::string_view> parts = split(value->value, ", \t\n\r");
    for (size_t i = 0; i < 3 && (parts.size() == 3 || parts.size() == 1); ++i) {
      channels[i] = parse_double(parts[i % parts.size()]);
    }
  }
  element.name = "rgb";
  if (!channels[0] || !channels[1] || !channels[2]) return;  // as it is, or an error of <rgb>
  value->value.clear();
  for (const std::optional<double>& c : channels) {
    value->value += fmt::format("{} ", is_srgb ? srgb_decode(*c) : *c);
  }
}

// Bitmaps that were filtered over pixels are looked up bilinearly: samples filter.
void upgrade_filter(XmlElement& element, std::vector<std::string>& warnings) {
  if (!has_value(element, "name", "filter_type")) return;
  for (const char* const type : {"trilinear", "ewa"}) {
    if (!has_value(element, "value", type)) continue;
    attribute(element, "value")->value = "bilinear";
    warnings.push_back(
        format_warning(element.where, std::string("filterType ") + type + " is read as bilinear"));
  }
}

void upgrade_element(XmlElement& element, std::vector<std::string>& warnings) {
  if (element.name == "lookAt") element.name = "lookat";
  if (element.name != "default") {
    if (XmlAttribute* name = attribute(element, "name")) name->value = snake_case(name->value);
  }
  replace_type(element, warnings);
  drop_parameters(element, warnings);
  const bool is_diffuse = element.name == "bsdf" && has_value(element, "type", "diffuse");
  for (XmlElement& child : element.children) {
    upgrade_element(child, warnings);
    if (is_diffuse && has_value(child, "name", "diffuse_reflectance")) {
      attribute(child, "name")->value = "reflectance";
    }
  }
  if (element.name == "texture") join_uv(element);
}

}  // namespace

void upgrade_values(XmlElement& element, std::vector<std::string>& warnings) {
  upgrade_colour(element);
  upgrade_filter(element, warnings);
  for (XmlElement& child : element.children) upgrade_values(child, warnings);
}

bool upgrade(XmlElement& scene, std::vector<std::string>& warnings) {
  if (scene.name != "scene") return false;
  check_attributes(scene, {"version"}, {"version"});
  const XmlAttribute& version = *scene.find("version");
  const std::vector<std::string_view> parts = split(version.value, ".");
  bool ok = parts.size() == 3;
  for (std::string_view part : parts) ok = ok && parse_integer(part).value_or(-1) >= 0;
  if (!ok) {
    throw InputError(version.where,
                     "<scene>: version must be like \"3.0.0\", not \"" + version.value + "\"");
  }
  const int64_t major = *parse_integer(parts[0]);
  if (major > 3) {
    throw InputError(version.where, "<scene>: version " + version.value +
                                        " is not supported (known: 0.4.0 to 3.x)");
  }
  if (major < 2) upgrade_element(scene, warnings);
  return major < 2;
}

}  // namespace limn
