// Reads the roughness of microfacets.
#include <fmt/format.h>

#include <algorithm>

#include "limn/core/make_bsdf.h"
#include "limn/core/names.h"
#include "src/bsdf/microfacet_reflection.h"
#include "src/bsdf/types.h"

namespace limn::microfacet {

namespace {

ConstantOrTexture read_alpha(Properties& properties, const char* name) {
  if (auto texture = properties.texture(name)) return texture;
  const double alpha = properties.number_or_colour(name, 0.1);
  if (!(alpha >= 0)) properties.fail(name, "the roughness must not be negative");
  if (!(alpha < kMaximumAlpha)) {
    properties.fail(name, fmt::format("the roughness must be less than {:g}", kMaximumAlpha));
  }
  return std::max(alpha, kMinimumAlpha);
}

}  // namespace

Roughness read_roughness(Properties& properties) {
  const auto given = [&](const char* name) {
    return properties.has(name) || properties.texture(name) != nullptr;
  };
  const bool u = given("alpha_u"), v = given("alpha_v");
  if (!u && !v) return {read_alpha(properties, "alpha"), std::nullopt};
  const char* name = u ? "alpha_u" : "alpha_v";
  if (!(u && v)) properties.fail(name, "alpha_u and alpha_v come together");
  if (given("alpha")) properties.fail("alpha", "give either alpha or alpha_u, alpha_v");
  const ConstantOrTexture along = read_alpha(properties, "alpha_u");
  const ConstantOrTexture across = read_alpha(properties, "alpha_v");
  const bool textured = along.texture || across.texture;
  if (!textured && along.constant.r == across.constant.r) return {along, std::nullopt};
  return {along, across};
}

}  // namespace limn::microfacet

namespace limn {

ConstantOrTexture read_alpha(Properties& properties) {
  const microfacet::Roughness roughness = microfacet::read_roughness(properties);
  if (!roughness.v) return roughness.u;
  properties.fail("alpha_u", properties.type() + " is isotropic: alpha_u must equal alpha_v");
}

RoughConductorValues::Distribution read_distribution(Properties& properties) {
  using Distribution = RoughConductorValues::Distribution;
  properties.boolean("sample_visible", true);  // Mitsuba's way of sampling: it changes nothing here
  const std::string name = properties.string("distribution", "beckmann");
  if (name == "beckmann") return Distribution::kBeckmann;
  if (name == "ggx") return Distribution::kGgx;
  properties.fail("distribution", unknown_name("distribution", name, {"beckmann", "ggx"}));
}

}  // namespace limn
