#pragma once
// Functions that create BSDFs.
#include <memory>
#include <optional>

#include "limn/core/bsdf.h"

namespace limn {

class Properties;

// Creates the BSDF that an element describes. InputError for bad values and for an unknown type
// (the message lists the known ones).
std::shared_ptr<Bsdf> make_bsdf(Properties& properties);
std::shared_ptr<Bsdf> make_diffuse(const ConstantOrTexture& reflectance);

// A rough conductor. The defaults are Mitsuba's: eta = 0, k = 1 reflects all light at every angle.
struct RoughConductorValues {
  enum class Distribution { kBeckmann, kGgx };
  Distribution distribution = Distribution::kBeckmann;
  // Roughness of the microfacet distribution, not squared; with alpha_v, alpha is that along the
  // tangent and alpha_v that across.
  ConstantOrTexture alpha = 0.1;
  std::optional<ConstantOrTexture> alpha_v;
  Rgb<double> eta{0, 0, 0};
  Rgb<double> k{1, 1, 1};
  ConstantOrTexture specular_reflectance = 1;
};
std::shared_ptr<Bsdf> make_roughconductor(const RoughConductorValues& values);

// A rough plastic. The defaults are Mitsuba's.
struct RoughPlasticValues {
  RoughConductorValues::Distribution distribution = RoughConductorValues::Distribution::kBeckmann;
  double alpha = 0.1;
  double eta = 1.49 / 1.000277;  // index of refraction, inside over outside
  bool nonlinear = false;        // whether colours shift by light that is reflected inside
  ConstantOrTexture diffuse_reflectance = 0.5;
  ConstantOrTexture specular_reflectance = 1;
};
std::shared_ptr<Bsdf> make_roughplastic(const RoughPlasticValues& values);

}  // namespace limn
