// Typed access to the properties of one element, and detection of unused ones.
#include "src/scene_file/scene_properties.h"

#include <algorithm>

#include "limn/core/names.h"
#include "src/scene_file/scene_tree.h"

namespace limn {

namespace {

bool is_value(const ObjectDescription& object) {
  return object.tag == "spectrum" || object.tag == "texture";
}

ColourUse use_of(const std::string& tag, const std::string& name) {
  if (tag == "emitter") return ColourUse::kEmission;
  return name == "eta" || name == "k" ? ColourUse::kUnbounded : ColourUse::kReflectance;
}

// An object that is read on: one that did not fail.
const ObjectDescription& sound(const ObjectDescription& object) {
  if (object.failed) throw InputErrors();
  return object;
}

std::vector<std::string> sorted(const std::set<std::string>& names) {
  return {names.begin(), names.end()};
}

}  // namespace

SourceLocation DescribedProperties::where(const std::string& name) const {
  const auto found = object_.properties.find(name);
  if (found != object_.properties.end()) return found->second.where;
  const ObjectDescription* object = find_object(name);
  return object ? object->where : object_.where;
}

const DescribedProperty* DescribedProperties::find(const std::string& name) const {
  known_.insert(name);
  const auto found = object_.properties.find(name);
  return found == object_.properties.end() ? nullptr : &found->second;
}

void DescribedProperties::fail_type(const std::string& name, const DescribedProperty& property,
                                    const std::string& expected) const {
  fail(name, "must be given as " + expected + ", not <" + property.tag + ">");
}

const ObjectDescription* DescribedProperties::find_object(const std::string& name) const {
  for (const ChildDescription& child : object_.children) {
    if (child.name == name && is_value(*child.object)) return &sound(*child.object);
  }
  return nullptr;
}

bool DescribedProperties::has(const std::string& name) const {
  return find(name) != nullptr || find_object(name) != nullptr;
}

bool DescribedProperties::has_text(const std::string& name) const {
  const DescribedProperty* p = find(name);
  return p && std::holds_alternative<std::string>(p->value);
}

double DescribedProperties::number(const std::string& name, double absent) {
  const DescribedProperty* p = find(name);
  if (!p) {
    const ObjectDescription* object = find_object(name);
    return object ? number_of(rgb_of(*object, name, ColourUse::kReflectance)) : absent;
  }
  if (const double* v = std::get_if<double>(&p->value)) return *v;
  if (const int64_t* v = std::get_if<int64_t>(&p->value)) return static_cast<double>(*v);
  fail_type(name, *p, "<float>");
}

int64_t DescribedProperties::integer(const std::string& name, int64_t absent) {
  const DescribedProperty* p = find(name);
  if (!p) return absent;
  if (const int64_t* v = std::get_if<int64_t>(&p->value)) return *v;
  fail_type(name, *p, "<integer>");
}

bool DescribedProperties::boolean(const std::string& name, bool absent) {
  const DescribedProperty* p = find(name);
  if (!p) return absent;
  if (const bool* v = std::get_if<bool>(&p->value)) return *v;
  fail_type(name, *p, "<boolean>");
}

std::string DescribedProperties::string(const std::string& name, const std::string& absent) {
  const DescribedProperty* p = find(name);
  if (!p) return absent;
  if (const std::string* v = std::get_if<std::string>(&p->value)) return *v;
  fail_type(name, *p, "<string>");
}

Vec3d DescribedProperties::point(const std::string& name, const Vec3d& absent) {
  const DescribedProperty* p = find(name);
  if (!p) return absent;
  if (const Vec3d* v = std::get_if<Vec3d>(&p->value)) return *v;
  fail_type(name, *p, "<point>");
}

Rgb<double> DescribedProperties::rgb(const std::string& name, const Rgb<double>& absent) {
  const DescribedProperty* p = find(name);
  const ColourUse use = use_of(tag(), name);
  if (!p) {
    const ObjectDescription* object = find_object(name);
    return object ? rgb_of(*object, name, use) : absent;
  }
  if (const Rgb<double>* v = std::get_if<Rgb<double>>(&p->value)) return *v;
  if (const double* v = std::get_if<double>(&p->value)) return grey(*v);
  if (const int64_t* v = std::get_if<int64_t>(&p->value)) return grey(static_cast<double>(*v));
  if (const SpectrumValue* v = std::get_if<SpectrumValue>(&p->value)) {
    if (v->constant) return constant_spectrum(*v->constant, use);
    if (v->filename.empty()) return integrate_spectrum(v->samples, use);
    return integrate_spectrum(read_spectrum_file(existing_file(name, v->filename, p->where)), use);
  }
  fail_type(name, *p, "<rgb>, <spectrum> or <float>");
}

Rgb<double> DescribedProperties::rgb_of(const ObjectDescription& object, const std::string& name,
                                        ColourUse use) {
  if (!is_spectrum_type(object.type)) {
    fail(name, "a <" + object.tag + " type=\"" + object.type + "\"> is not supported here");
  }
  DescribedProperties p(object, scene_, make_nested_);
  return read_spectrum_object(p, use);
}

Rgb<double> DescribedProperties::triple(const std::string& name) {
  const DescribedProperty* p = find(name);
  if (!p) fail("parameter \"" + name + "\" is missing");
  if (const Vec3d* v = std::get_if<Vec3d>(&p->value)) return {v->x, v->y, v->z};
  return rgb(name, {});
}

Matrix4 DescribedProperties::transform(const std::string& name) {
  const DescribedProperty* p = find(name);
  if (!p) return {};
  if (const Matrix4* v = std::get_if<Matrix4>(&p->value)) return *v;
  fail_type(name, *p, "<transform>");
}

const Animation* DescribedProperties::animation(const std::string& name) {
  const DescribedProperty* p = find(name);
  return p ? std::get_if<Animation>(&p->value) : nullptr;
}

std::string DescribedProperties::file(const std::string& name) {
  const DescribedProperty* p = find(name);
  if (!p) fail("parameter \"" + name + "\" is missing");
  const std::string* text = std::get_if<std::string>(&p->value);
  if (!text) fail_type(name, *p, "<string>");
  return existing_file(name, *text, p->where);
}

std::string DescribedProperties::existing_file(const std::string& name, const std::string& text,
                                               const SourceLocation& mentioned) const {
  std::string found = find_input_file(text, mentioned.file, scene_.search_path);
  if (found.empty()) {
    const bool from_build = text.find("build/generated/") != std::string::npos;
    fail(name, "no such file: \"" + text + "\"" +
                   (from_build ? " (the build makes it: run tools/build)" : ""));
  }
  return found;
}

std::shared_ptr<Texture> DescribedProperties::texture(const std::string& name) {
  known_.insert(name);
  const ObjectDescription* object = find_object(name);
  if (!object || object->tag != "texture" || is_spectrum_type(object->type)) return nullptr;
  return make_nested_.texture(*object);
}

std::shared_ptr<Texture> DescribedProperties::only_texture() {
  const ObjectDescription* object = nested("texture");
  return object ? make_nested_.texture(*object) : nullptr;
}

std::vector<std::shared_ptr<Bsdf>> DescribedProperties::bsdfs() {
  known_tags_.insert("bsdf");
  std::vector<std::shared_ptr<Bsdf>> made;
  ErrorList errors;
  bool all_made = true;
  for (const ChildDescription& child : object_.children) {
    if (child.object->tag != "bsdf") continue;
    const auto make = [&] { made.push_back(make_nested_.bsdf(*child.object)); };
    all_made = errors.keep(make) && all_made;
  }
  errors.throw_any();
  if (!all_made) throw InputErrors();
  return made;
}

const ObjectDescription* DescribedProperties::nested(const std::string& wanted) {
  known_tags_.insert(wanted);
  const ObjectDescription* found = nullptr;
  for (const ChildDescription& child : object_.children) {
    if (child.object->tag != wanted) continue;
    if (found) {
      throw InputError(child.where,
                       tag() + " \"" + type() + "\": a second " + wanted + " (one at most)");
    }
    found = child.object.get();
  }
  return found ? &sound(*found) : nullptr;
}

std::vector<const ObjectDescription*> DescribedProperties::all_nested(const std::string& wanted) {
  known_tags_.insert(wanted);
  std::vector<const ObjectDescription*> found;
  for (const ChildDescription& child : object_.children) {
    if (child.object->tag == wanted) found.push_back(&sound(*child.object));
  }
  return found;
}

void DescribedProperties::check_all_used() const {
  // Visited in file order, properties first.
  std::vector<std::pair<SourceLocation, std::string>> unused;
  for (const auto& [name, property] : object_.properties) {
    if (known_.count(name)) continue;
    unused.emplace_back(property.where, unknown_name("parameter", name, sorted(known_)));
  }
  const auto place = [](const auto& u) { return std::pair(u.first.line, u.first.column); };
  std::sort(unused.begin(), unused.end(),
            [&](const auto& a, const auto& b) { return place(a) < place(b); });
  for (const ChildDescription& child : object_.children) {
    if (known_tags_.count(child.object->tag)) continue;
    if (is_value(*child.object) && known_.count(child.name)) continue;
    const bool is_named = is_value(*child.object) && !child.name.empty();
    unused.emplace_back(child.where, is_named
                                         ? unknown_name("parameter", child.name, sorted(known_))
                                         : "takes no " + child.object->tag + " (" +
                                               known_names(sorted(known_tags_)) + ")");
  }
  ErrorList errors;
  for (const auto& [where, problem] : unused) {
    errors.keep([&, &where = where, &problem = problem] {
      throw InputError(where, tag() + " \"" + type() + "\": " + problem);
    });
  }
  errors.throw_any();
}

}  // namespace limn
