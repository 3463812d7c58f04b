#pragma once
// Property tags of a scene file and their values.
#include <optional>
#include <string>
#include <variant>

#include "limn/core/properties.h"
#include "src/scene_file/spectrum.h"
#include "src/scene_file/xml_tree.h"

namespace limn {

// <spectrum>: one value for all wavelengths, a list of samples, or a file of them.
struct SpectrumValue {
  std::optional<double> constant;
  std::vector<SpectrumSample> samples;
  std::string filename;
};

// <animation>: transforms at times, which grow.
struct TimedTransform {
  double time;
  Matrix4 transform;
  SourceLocation where;
};
using Animation = std::vector<TimedTransform>;

using PropertyValue = std::variant<bool, int64_t, double, std::string, Vec3d, Rgb<double>,
                                   SpectrumValue, Matrix4, Animation>;

// Names of the property tags: boolean, integer, ...
const std::vector<std::string>& property_tags();
bool is_property_tag(const std::string& tag);

// Parses a property element; InputError for an unknown, missing or malformed attribute.
PropertyValue parse_property(const XmlElement& element);

}  // namespace limn
