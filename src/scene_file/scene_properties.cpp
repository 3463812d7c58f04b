// Typed access to the properties of one element, and detection of unused ones.
#include "src/scene_file/scene_properties.h"

#include <algorithm>

#include "limn/core/names.h"
#include "src/scene_file/scene_tree.h"

namespace limn {

namespace {

std::vector<std::string> sorted(const std::set<std::string>& names) {
  return {names.begin(), names.end()};
}

}  // namespace

SourceLocation DescribedProperties::where(const std::string& name) const {
  const auto found = object_.properties.find(name);
  return found == object_.properties.end() ? object_.where : found->second.where;
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

bool DescribedProperties::has(const std::string& name) const { return find(name) != nullptr; }

double DescribedProperties::number(const std::string& name, double absent) {
  const DescribedProperty* p = find(name);
  if (!p) return absent;
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

// A constant spectrum is grey for reflectances only. For lights and indices of refraction Mitsuba
// gives a slightly pink colour, since it does not weight by a white illuminant.
Rgb<double> DescribedProperties::rgb(const std::string& name, const Rgb<double>& absent) {
  const DescribedProperty* p = find(name);
  if (!p) return absent;
  if (const Rgb<double>* v = std::get_if<Rgb<double>>(&p->value)) return *v;
  if (const double* v = std::get_if<double>(&p->value)) return grey(*v);
  if (const int64_t* v = std::get_if<int64_t>(&p->value)) return grey(static_cast<double>(*v));
  if (const ConstantSpectrum* v = std::get_if<ConstantSpectrum>(&p->value)) {
    if (name.ends_with("reflectance")) return grey(v->value);
    fail(name, "a constant <spectrum> is not grey here (Mitsuba makes it pinkish): use <rgb>");
  }
  fail_type(name, *p, "<rgb> or <float>");
}

Matrix4 DescribedProperties::transform(const std::string& name) {
  const DescribedProperty* p = find(name);
  if (!p) return {};
  if (const Matrix4* v = std::get_if<Matrix4>(&p->value)) return *v;
  fail_type(name, *p, "<transform>");
}

std::string DescribedProperties::file(const std::string& name) {
  const DescribedProperty* p = find(name);
  if (!p) fail("parameter \"" + name + "\" is missing");
  const std::string* text = std::get_if<std::string>(&p->value);
  if (!text) fail_type(name, *p, "<string>");
  std::string found = find_input_file(*text, p->where.file, scene_.search_path);
  if (found.empty()) {
    const bool from_build = text->find("build/generated/") != std::string::npos;
    fail(name, "no such file: \"" + *text + "\"" +
                   (from_build ? " (the build makes it: run tools/build)" : ""));
  }
  return found;
}

std::vector<std::shared_ptr<Bsdf>> DescribedProperties::bsdfs() {
  known_tags_.insert("bsdf");
  std::vector<std::shared_ptr<Bsdf>> made;
  for (const ChildDescription& child : object_.children) {
    if (child.object->tag == "bsdf") made.push_back(make_nested_(*child.object));
  }
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
  return found;
}

void DescribedProperties::check_all_used() const {
  // Visited in file order, so that the first mistake is reported.
  const DescribedProperty* first = nullptr;
  std::string first_name;
  const auto place = [](const SourceLocation& l) { return std::make_pair(l.line, l.column); };
  for (const auto& [name, property] : object_.properties) {
    if (known_.count(name)) continue;
    if (first && place(first->where) < place(property.where)) continue;
    first = &property;
    first_name = name;
  }
  if (first) {
    throw InputError(first->where, tag() + " \"" + type() + "\": " +
                                       unknown_name("parameter", first_name, sorted(known_)));
  }
  for (const ChildDescription& child : object_.children) {
    if (known_tags_.count(child.object->tag)) continue;
    throw InputError(child.where, tag() + " \"" + type() + "\": takes no " + child.object->tag +
                                      " (" + known_names(sorted(known_tags_)) + ")");
  }
}

}  // namespace limn
