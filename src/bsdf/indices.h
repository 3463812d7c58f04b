#pragma once
// Indices of refraction: named metals and named dielectrics, as in Mitsuba 3.9.1.
#include <optional>
#include <string>

#include "limn/core/dual.h"
#include "limn/core/properties.h"

namespace limn {

// The index of a dielectric by name ("bk7", "Water"), in any case; nothing if it is unknown.
std::optional<double> named_ior(const std::string& name);

// Reads an index of refraction: a name or a positive number. absent: a name.
double read_ior(Properties& properties, const char* property, const std::string& absent);

// Range of relative indices of refraction, of readers and derivatives.
inline constexpr double kLeastIor = 0.1, kMostIor = 10;
// Reads int_ior and ext_ior (air): the index inside over that outside. inside: the default, a name.
double read_relative_ior(Properties& properties, const std::string& inside);

// The complex index of a conductor, per channel: eta + i k.
struct ConductorIndices {
  Rgb<double> eta, k;
};

// Reads `material` (a name; "none" is eta 0, k 1), or eta and k.
ConductorIndices read_conductor_indices(Properties& properties);

}  // namespace limn
