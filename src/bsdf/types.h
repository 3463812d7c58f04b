#pragma once
// Factories of the BSDF types in the registry.
#include <memory>

#include "limn/core/bsdf.h"
#include "limn/core/properties.h"

namespace limn {

std::shared_ptr<Bsdf> read_blendbsdf(Properties& properties);
std::shared_ptr<Bsdf> read_conductor(Properties& properties);
std::shared_ptr<Bsdf> read_dielectric(Properties& properties);
std::shared_ptr<Bsdf> read_diffuse(Properties& properties);
std::shared_ptr<Bsdf> read_mask(Properties& properties);
std::shared_ptr<Bsdf> read_null(Properties& properties);
std::shared_ptr<Bsdf> read_plastic(Properties& properties);
std::shared_ptr<Bsdf> read_roughconductor(Properties& properties);
std::shared_ptr<Bsdf> read_thindielectric(Properties& properties);
std::shared_ptr<Bsdf> read_twosided(Properties& properties);

// Reads a colour whose channels lie in [0, 1], as Mitsuba requires of reflectances, or a texture.
ConstantOrTexture read_reflectance(Properties& properties, const char* name, double absent);

}  // namespace limn
