#pragma once
// The readers that the registry lists, one per emitter type, and what they share. Each reads an
// element into the scene; shape: the one around it, null directly under <scene>.
#include <optional>

#include "limn/core/environment.h"
#include "limn/core/properties.h"
#include "limn/core/scene.h"

namespace limn {

void read_area(Properties& properties, Scene& scene, Shape* shape);
void read_constant(Properties& properties, Scene& scene, Shape* shape);
void read_directional(Properties& properties, Scene& scene, Shape* shape);
void read_envmap(Properties& properties, Scene& scene, Shape* shape);
void read_point(Properties& properties, Scene& scene, Shape* shape);
void read_spot(Properties& properties, Scene& scene, Shape* shape);

// What leaves a delta light: 1 if absent; finite and not negative.
Rgb<Dual> read_power(Properties& properties, const char* name);
// The columns of to_world, orthonormal: a rotation or a reflection, perhaps with one factor for all
// axes. what: "a spot", for the error.
void read_axes(Properties& properties, const char* what, Vec3d axes[3]);

// A vector turned by angles [radians] about the world's axes, x first. Angles are stored as
// parameters that are 0 in the file, so that a rotation by any one of them is exact.
template <class S>
Vec3<S> turned(const Vec3d& v, const Vec3<Dual>& angles) {
  using std::cos;
  using std::sin;
  Vec3<S> r{v.x, v.y, v.z};
  for (int axis = 0; axis < 3; ++axis) {
    const int i = (axis + 1) % 3, j = (axis + 2) % 3;
    const S angle = as<S>(angles[axis]);
    const S c = cos(angle), s = sin(angle);
    const S a = c * r[i] - s * r[j];
    r[j] = s * r[i] + c * r[j];
    r[i] = a;
  }
  return r;
}

// What a source of that intensity [W/sr] at `position` gives at p; none at the source itself.
template <class S>
std::optional<Arrival<S>> arrival_from(const Vec3<S>& position, const Rgb<S>& intensity,
                                       const Vec3<S>& p) {
  const Vec3<S> w = position - p;
  const S squared = length_squared(w);
  if (value(squared) == 0) return {};
  using std::sqrt;
  return Arrival<S>{w / sqrt(squared), intensity * (1.0 / squared)};
}

// What read_power() reads.
inline ParameterRef power_parameter(const char* name, Rgb<Dual>& c) {
  return {name, {&c.r, &c.g, &c.b}, ParameterRef::Unit::kValue, 0};
}
// NAME.x, NAME.y, NAME.z
void append_vector_parameters(const char* name, Vec3<Dual>& v, ParameterRef::Unit unit,
                              std::vector<ParameterRef>& parameters);

}  // namespace limn
