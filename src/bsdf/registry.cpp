// The table of BSDF types.
#include <fmt/format.h>

#include <cmath>

#include "limn/core/make_bsdf.h"
#include "limn/core/names.h"
#include "src/bsdf/types.h"

namespace limn {
namespace {

struct BsdfType {
  const char* name;
  std::shared_ptr<Bsdf> (*read)(Properties& properties);
};

constexpr BsdfType kTypes[] = {
    {"blendbsdf", read_blendbsdf},
    {"bumpmap", read_bumpmap},
    {"conductor", read_conductor},
    {"dielectric", read_dielectric},
    {"diffuse", read_diffuse},
    {"mask", read_mask},
    {"normalmap", read_normalmap},
    {"null", read_null},
    {"plastic", read_plastic},
    {"principled", read_principled},
    {"principledthin", read_principledthin},
    {"roughconductor", read_roughconductor},
    {"roughdielectric", read_roughdielectric},
    {"roughplastic", read_roughplastic},
    {"thindielectric", read_thindielectric},
    {"twosided", read_twosided},
};

}  // namespace

void Bsdf::eval_with_pdf_each(std::span<const Evaluation> evaluations) const {
  for (const Evaluation& e : evaluations) *e.value = eval_with_pdf(*e.n, *e.wi, *e.wo, e.at);
}

void Bsdf::sample_each(std::span<const Draw> draws) const {
  for (const Draw& draw : draws) {
    *draw.wo = sample(*draw.n, *draw.wi, draw.u[0], draw.u[1], draw.at).value_or(Vec3d{});
  }
}

std::shared_ptr<Bsdf> make_bsdf(Properties& properties) {
  for (const BsdfType& type : kTypes) {
    if (properties.type() == type.name) return type.read(properties);
  }
  throw InputError(properties.where(), unknown_type("bsdf", properties.type(), names_of(kTypes)));
}

std::shared_ptr<Texture> read_texture(Properties& properties, const char* name, double most) {
  std::shared_ptr<Texture> texture = properties.texture(name);
  if (texture && !(texture->range().least >= 0 && texture->range().most <= most)) {
    properties.fail(name, std::isinf(most) ? "the values of the texture must not be negative"
                                           : fmt::format("the values of the texture must lie in "
                                                         "[0, {:g}]",
                                                         most));
  }
  return texture;
}

ConstantOrTexture read_reflectance(Properties& properties, const char* name, double absent,
                                   double most_texel) {
  if (auto texture = read_texture(properties, name, most_texel)) return texture;
  const Rgb<double> c = properties.rgb(name, grey(absent));
  for (int i = 0; i < 3; ++i) {
    if (!(c[i] >= 0 && c[i] <= 1)) properties.fail(name, "a reflectance must lie in [0, 1]");
  }
  return c;
}

}  // namespace limn
