// The table of emitter types, and helpers of their readers.
#include <string>

#include "limn/core/names.h"
#include "src/light/types.h"

namespace limn {
namespace {

struct LightType {
  const char* name;
  bool in_shape;  // nested in a shape, else directly under <scene>
  void (*read)(Properties& properties, Scene& scene, Shape* shape);
};

constexpr LightType kTypes[] = {
    {"area", true, read_area},
    {"constant", false, read_constant},
    {"directional", false, read_directional},
    {"envmap", false, read_envmap},
    {"point", false, read_point},
    {"projector", false, read_projector},
    {"spot", false, read_spot},
};

}  // namespace

void read_light(Properties& properties, Scene& scene, Shape* shape) {
  const bool in_shape = shape != nullptr;
  std::string known;
  for (const LightType& type : kTypes) {
    const bool named = properties.type() == type.name;
    if (named && in_shape == type.in_shape) return type.read(properties, scene, shape);
    if (named && type.in_shape) {
      throw InputError(properties.where(),
                       "an " + std::string(type.name) + " emitter belongs inside a shape");
    }
    if (in_shape != type.in_shape) continue;
    known += known.empty() ? type.name : std::string(", ") + type.name;
  }
  const std::string place = in_shape ? "of an emitter inside a shape " : "";
  throw InputError(properties.where(), "unknown " + std::string(in_shape ? "" : "emitter ") +
                                           "type \"" + properties.type() + "\" " + place +
                                           "(known: " + known + ")" + advice_on(properties.type()));
}

std::shared_ptr<Texture> read_emission(Properties& properties, const char* name) {
  std::shared_ptr<Texture> texture = properties.texture(name);
  if (!texture) return nullptr;
  texture->set_valid({0, std::numeric_limits<float>::max()});
  if (!(texture->range().least >= 0)) properties.fail(name, "the texture must not be negative");
  return texture;
}

std::shared_ptr<Texture> read_light_bitmap(Properties& properties, const char* name) {
  std::shared_ptr<Texture> texture = read_emission(properties, name);
  if (texture && texture->map().width == 0) properties.fail(name, "must be a bitmap");
  return texture;
}

TexelMap::TexelWeights bitmap_weights(const Texture& bitmap, const std::array<double, 2>& uv,
                                      double factor) {
  TexelMap::TexelWeights weights = bitmap.texel_weights({nullptr, FaceId(0), {}, uv});
  for (TexelMap::TexelWeight& w : weights) w.weight *= factor;
  return weights;
}

Rgb<Dual> read_power(Properties& properties, const char* name) {
  const Rgb<double> c = properties.rgb(name, grey(1.0));
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(c[i])) properties.fail(name, "must be finite");
    if (c[i] < 0) properties.fail(name, "must not be negative");
  }
  return {c.r, c.g, c.b};
}

void read_axes(Properties& properties, const char* what, Vec3d axes[3]) {
  const Matrix4 m = properties.transform("to_world");
  for (int c = 0; c < 3; ++c) axes[c] = {m.m[0][c], m.m[1][c], m.m[2][c]};
  const double size2 = length_squared(axes[0]);
  constexpr double kDigits = 1e-4;  // tolerance for hand-written matrices
  for (int c = 0; c < 3; ++c) {
    const double across = dot(axes[c], axes[(c + 1) % 3]);
    if (!(std::fabs(across) <= kDigits * size2 &&
          std::fabs(length_squared(axes[c]) - size2) <= kDigits * size2 && size2 > 0)) {
      properties.fail("to_world",
                      std::string(what) + " can be rotated, not sheared or scaled unevenly");
    }
  }
  axes[0] = normalize(axes[0]);
  axes[1] = normalize(axes[1] - axes[0] * dot(axes[0], axes[1]));
  const Vec3d third = cross(axes[0], axes[1]);
  axes[2] = dot(third, axes[2]) > 0 ? third : -third;
}

void append_vector_parameters(const char* name, Vec3<Dual>& v, ParameterRef::Unit unit,
                              std::vector<ParameterRef>& parameters) {
  for (int axis = 0; axis < 3; ++axis) {
    parameters.push_back({std::string(name) + "." + "xyz" [axis], { &v[axis] }, unit});
  }
}

}  // namespace limn
