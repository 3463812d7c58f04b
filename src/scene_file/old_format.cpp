// Renames the parameters of formats before 2.0.0.
#include "src/scene_file/old_format.h"

#include <algorithm>

#include "src/base/text.h"
#include "src/scene_file/scene_tree.h"

namespace limn {

namespace {

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

void upgrade_element(XmlElement& element, std::vector<std::string>& warnings) {
  if (element.name == "lookAt") element.name = "lookat";
  if (element.name != "default") {
    if (XmlAttribute* name = attribute(element, "name")) name->value = snake_case(name->value);
  }
  if (element.name == "integrator" &&
      (has_value(element, "type", "sppm") || has_value(element, "type", "photonmapper"))) {
    XmlAttribute& type = *attribute(element, "type");
    warnings.push_back(format_warning(
        element.where,
        "integrator \"" + type.value + "\" is read as path, without its parameters"));
    type.value = "path";
    std::erase_if(element.children, [](const XmlElement& child) {
      const XmlAttribute* name = child.find("name");
      return !name || (name->value != "maxDepth" && name->value != "rrDepth");
    });
  }
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

void upgrade(XmlElement& scene, std::vector<std::string>& warnings) {
  if (scene.name != "scene") return;
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
}

}  // namespace limn
