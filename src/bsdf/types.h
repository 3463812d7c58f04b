#pragma once
// Factories of the BSDF types in the registry.
#include <memory>
#include <optional>

#include "limn/core/bsdf.h"
#include "limn/core/make_bsdf.h"
#include "limn/core/properties.h"

namespace limn {

std::shared_ptr<Bsdf> read_blendbsdf(Properties& properties);
std::shared_ptr<Bsdf> read_bumpmap(Properties& properties);
std::shared_ptr<Bsdf> read_conductor(Properties& properties);
std::shared_ptr<Bsdf> read_dielectric(Properties& properties);
std::shared_ptr<Bsdf> read_diffuse(Properties& properties);
std::shared_ptr<Bsdf> read_mask(Properties& properties);
std::shared_ptr<Bsdf> read_normalmap(Properties& properties);
std::shared_ptr<Bsdf> read_null(Properties& properties);
std::shared_ptr<Bsdf> read_plastic(Properties& properties);
std::shared_ptr<Bsdf> read_principled(Properties& properties);
std::shared_ptr<Bsdf> read_principledthin(Properties& properties);
std::shared_ptr<Bsdf> read_roughconductor(Properties& properties);
std::shared_ptr<Bsdf> read_roughdielectric(Properties& properties);
std::shared_ptr<Bsdf> read_roughplastic(Properties& properties);
std::shared_ptr<Bsdf> read_thindielectric(Properties& properties);
std::shared_ptr<Bsdf> read_twosided(Properties& properties);

// A rough dielectric, see roughdielectric.cpp.
struct RoughDielectricValues {
  RoughConductorValues::Distribution distribution = RoughConductorValues::Distribution::kBeckmann;
  ConstantOrTexture alpha = 0.1;  // or alpha_u, with alpha_v
  std::optional<ConstantOrTexture> alpha_v = {};
  double eta = 1.5;  // index of refraction, inside over outside; not 1
  ConstantOrTexture specular_reflectance = 1;
  ConstantOrTexture specular_transmittance = 1;
};
std::shared_ptr<Bsdf> make_roughdielectric(const RoughDielectricValues& values);

// Read alpha (0.1), and a distribution (beckmann).
ConstantOrTexture read_alpha(Properties& properties);
RoughConductorValues::Distribution read_distribution(Properties& properties);

// The texture of this name, whose values must lie in [0, most]; null if there is none.
std::shared_ptr<Texture> read_texture(Properties& properties, const char* name, double most);
// Reads a colour whose channels lie in [0, 1], as Mitsuba requires of reflectances, or a texture of
// at most most_texel.
ConstantOrTexture read_reflectance(Properties& properties, const char* name, double absent,
                                   double most_texel = 1);

}  // namespace limn
