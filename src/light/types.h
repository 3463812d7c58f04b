#pragma once
// Readers of the emitter types in the registry, and their helpers. Each adds an element to the
// scene; shape: the enclosing shape, null directly under <scene>.
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
void read_projector(Properties& properties, Scene& scene, Shape* shape);
void read_spot(Properties& properties, Scene& scene, Shape* shape);

// A texture of emitted light; null if the property is none. InputError if it is negative anywhere.
std::shared_ptr<Texture> read_emission(Properties& properties, const char* name);
// The same of a light without extent, which must be a bitmap: no edges are known of others.
std::shared_ptr<Texture> read_light_bitmap(Properties& properties, const char* name);
// Texels of a light's bitmap at uv, that count `factor` times.
TexelMap::TexelWeights bitmap_weights(const Texture& bitmap, const std::array<double, 2>& uv,
                                      double factor);
// Reads the emitted power of a delta light: 1 if absent; finite and not negative.
Rgb<Dual> read_power(Properties& properties, const char* name);
// The columns of to_world, orthonormalised: a rotation or reflection with an optional uniform
// scale. what: "a spot", for the error message.
void read_axes(Properties& properties, const char* what, Vec3d axes[3]);

// Rotates a vector by angles [radians] about the world axes, x first. The angles are parameters
// that are 0 initially, so a rotation by any one of them is exact.
template <class S>
Vec3<S> turned(const Vec3d& v, const Vec3<Dual>& angles) {
  using std::cos;
  using std::sin;
  Vec3<S> r{v.x, v.y, v.z};
  for (int axis = 0; axis < 3; ++axis) {
    const int i = (axis + 1) % 3, j = (axis + 2) % 3;
    const S angle = as<S>(angles[axis]);
    if constexpr (std::is_same_v<S, double>) {
      if (angle == 0) continue;
    }
    const S c = cos(angle), s = sin(angle);
    const S a = c * r[i] - s * r[j];
    r[j] = s * r[i] + c * r[j];
    r[i] = a;
  }
  return r;
}

// Light arriving at p from a point source of that intensity [W/sr]; nothing at the source itself.
template <class S>
std::optional<Arrival<S>> arrival_from(const Vec3<S>& position, const Rgb<S>& intensity,
                                       const Vec3<S>& p) {
  const Vec3<S> w = position - p;
  const S squared = length_squared(w);
  if (value(squared) == 0) return {};
  using std::sqrt;
  return Arrival<S>{w / sqrt(squared), intensity * (1.0 / squared)};
}

// The parameter for a value that read_power() has read.
inline ParameterRef power_parameter(const char* name, Rgb<Dual>& c) {
  return {name, {&c.r, &c.g, &c.b}, ParameterRef::Unit::kValue, 0};
}
// Appends NAME.x, NAME.y, NAME.z.
void append_vector_parameters(const char* name, Vec3<Dual>& v, ParameterRef::Unit unit,
                              std::vector<ParameterRef>& parameters);

}  // namespace limn
