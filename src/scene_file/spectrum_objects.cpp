// Reads spectra that are objects.
#include "src/scene_file/scene_properties.h"

#include <cmath>

#include "limn/core/names.h"
#include "src/base/text.h"

namespace limn {

namespace {

std::vector<double> numbers(Properties& p, const std::string& name) {
  std::vector<double> read;
  for (std::string_view word : split(p.string(name, ""), ", \t\r\n")) {
    const std::optional<double> number = parse_double(word);
    if (!number || !std::isfinite(*number)) p.fail(name, "must be a list of finite numbers");
    read.push_back(*number);
  }
  return read;
}

Rgb<double> times(const Rgb<double>& c, double factor) {
  return {c.r * factor, c.g * factor, c.b * factor};
}

Rgb<double> read_uniform(DescribedProperties& p, ColourUse use) {
  return constant_spectrum(p.number("value", 1), use);
}

// Three numbers as they are, in any tag.
Rgb<double> read_rawconstant(DescribedProperties& p, ColourUse) { return p.triple("value"); }

Rgb<double> read_srgb(DescribedProperties& p, ColourUse) {
  p.boolean("unbounded", false);  // changes what Mitsuba accepts
  return p.rgb("color", grey(1.0));
}

Rgb<double> read_d65(DescribedProperties& p, ColourUse) {
  return times(p.rgb("color", grey(1.0)), p.number("scale", 1));
}

Rgb<double> read_regular(DescribedProperties& p, ColourUse use) {
  const std::vector<double> range = {p.number("wavelength_min", 360),
                                     p.number("wavelength_max", 830)};
  return integrate_spectrum(make_spectrum(range, numbers(p, "values"), p.where()), use);
}

Rgb<double> read_irregular(DescribedProperties& p, ColourUse use) {
  const std::vector<double> wavelengths = numbers(p, "wavelengths");
  return integrate_spectrum(make_spectrum(wavelengths, numbers(p, "values"), p.where()), use);
}

Rgb<double> read_blackbody(DescribedProperties& p, ColourUse) {
  const double temperature = p.number("temperature", 5000);
  if (!(temperature > 0)) p.fail("temperature", "must be positive (kelvin)");
  return times(blackbody(temperature), p.number("scale", 1));
}

struct SpectrumType {
  const char* name;
  Rgb<double> (*read)(DescribedProperties& p, ColourUse use);
};
constexpr SpectrumType kTypes[] = {
    {"blackbody", read_blackbody},     {"d65", read_d65},         {"irregular", read_irregular},
    {"rawconstant", read_rawconstant}, {"regular", read_regular}, {"srgb", read_srgb},
    {"uniform", read_uniform},
};

const SpectrumType* find_type(const std::string& name) {
  for (const SpectrumType& type : kTypes) {
    if (name == type.name) return &type;
  }
  return nullptr;
}

}  // namespace

bool is_spectrum_type(const std::string& type) { return find_type(type) != nullptr; }

Rgb<double> read_spectrum_object(DescribedProperties& properties, ColourUse use) {
  const SpectrumType* type = find_type(properties.type());
  if (!type) {
    throw InputError(properties.where(),
                     unknown_name(properties.tag() + " type", properties.type(), names_of(kTypes)));
  }
  const Rgb<double> colour = type->read(properties, use);
  properties.check_all_used();
  return colour;
}

}  // namespace limn
