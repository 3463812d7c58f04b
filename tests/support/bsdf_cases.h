#pragma once
// The BSDFs that every general test runs over.
#include <memory>
#include <string>
#include <vector>

#include "limn/core/bsdf.h"
#include "limn/core/make_bsdf.h"
#include "support/held_textures.h"
#include "support/test_properties.h"

namespace limn::test {

struct BsdfCase {
  std::string name;
  std::shared_ptr<Bsdf> bsdf;
  double alpha;  // width of the lobe; 1 if diffuse
  bool beckmann;
  bool conductor;  // nothing but reflecting microfacets
  bool reciprocal = true;
};

// Matt with sheen; metal with a clearcoat; anisotropic.
inline void add_principled(std::vector<BsdfCase>& cases, bool copper) {
  const auto make = [&](std::map<std::string, TestProperties::Value> values) {
    values["base_color"] = copper ? Rgb<double>{0.9, 0.4, 0.2} : Rgb<double>{0.3, 0.6, 0.8};
    TestProperties properties("bsdf", "principled", std::move(values));
    return make_bsdf(properties);
  };
  cases.push_back({"principled matt",
                   make({{"roughness", 0.8},
                         {"metallic", 0.1},
                         {"clearcoat", 0.2},
                         {"sheen", 0.6},
                         {"sheen_tint", 0.5},
                         {"flatness", 0.4},
                         {"spec_tint", 0.3}}),
                   0.6, false, false});
  cases.push_back({"principled metal",
                   make({{"roughness", 0.5},
                         {"metallic", 0.7},
                         {"sheen", 0.1},
                         {"spec_tint", 0.2},
                         {"eta", 1.6},
                         {"clearcoat", 0.5},
                         {"clearcoat_gloss", 0.2}}),
                   0.1, false, false});
  cases.push_back({"principled anisotropic",
                   std::make_shared<HeldTextures>(make({{"roughness", 0.5},
                                                        {"anisotropic", 0.6},
                                                        {"metallic", 0.4},
                                                        {"sheen", 0.1},
                                                        {"clearcoat", 0.1}}),
                                                  std::vector<Rgb<double>>{{0.9, -1.3, 0.4}}),
                   0.2, false, false});
}

// Normals from maps: about a diffuse and a glossy BSDF. Values: the colour, the tangent and the
// side that is outward; the gradient of heights and the outward normal.
inline void add_mapped(std::vector<BsdfCase>& cases) {
  TestProperties texture("texture", "checkerboard");
  RoughConductorValues glossy;
  glossy.distribution = RoughConductorValues::Distribution::kGgx;
  glossy.alpha = 0.5;
  glossy.eta = {0.2010, 0.9237, 1.1022};
  const auto make = [&](const char* type, std::shared_ptr<Bsdf> inside) {
    TestProperties properties("bsdf", type, {}, {std::move(inside)});
    properties.textures["normalmap"] = make_texture(texture);
    return make_bsdf(properties);
  };
  const std::vector<Rgb<double>> map{{0.6, 0.45, 0.95}, {0.9, -1.3, 0.4}, {0.1, 0.2, 0.7}};
  cases.push_back({"normalmap",
                   std::make_shared<HeldTextures>(
                       make("normalmap", make_diffuse(Rgb<double>{0.2, 0.5, 0.9})), map),
                   1, false, false, false});
  cases.push_back(
      {"normalmap of ggx",
       std::make_shared<HeldTextures>(make("normalmap", make_roughconductor(glossy)), map), 0.5,
       false, false, false});
  const std::vector<Rgb<double>> bump{{0.1, -0.3, 0.2}, {0.3, -0.6, 0.9}};
  cases.push_back({"bumpmap",
                   std::make_shared<HeldTextures>(
                       make("bumpmap", make_diffuse(Rgb<double>{0.2, 0.5, 0.9})), bump),
                   1, false, false, false});
}

// A diffuse one, GGX and Beckmann over five orders of roughness, reflecting everything (F = 1) or
// as copper, plastics, anisotropic and principled ones, and maps.
inline std::vector<BsdfCase> bsdf_cases(bool copper) {
  std::vector<BsdfCase> cases;
  cases.push_back({"diffuse", make_diffuse(Rgb<double>{0.2, 0.5, 0.9}), 1, false, false});
  using Distribution = RoughConductorValues::Distribution;
  for (double alpha : {0.001, 0.01, 0.1, 0.5, 1.0}) {
    for (bool beckmann : {false, true}) {
      RoughConductorValues v;
      v.distribution = beckmann ? Distribution::kBeckmann : Distribution::kGgx;
      v.alpha = alpha;
      if (copper) {
        v.eta = {0.2010, 0.9237, 1.1022};
        v.k = {3.9133, 2.4530, 2.1421};
        v.specular_reflectance = Rgb<double>{0.9, 0.7, 0.8};
      }
      cases.push_back({(beckmann ? "beckmann " : "ggx ") + std::to_string(alpha),
                       make_roughconductor(v), alpha, beckmann, true});
    }
  }
  for (const auto& [alpha, beckmann] : {std::pair{0.05, true}, {0.3, false}}) {
    RoughPlasticValues v;
    v.distribution = beckmann ? Distribution::kBeckmann : Distribution::kGgx;
    v.alpha = alpha;
    v.eta = 1.6;
    v.nonlinear = copper;
    v.diffuse_reflectance = Rgb<double>{0.2, 0.5, 0.9};
    if (copper) v.specular_reflectance = Rgb<double>{0.9, 0.7, 0.8};
    cases.push_back(
        {"roughplastic " + std::to_string(alpha), make_roughplastic(v), alpha, beckmann, false});
  }
  for (const bool beckmann : {true, false}) {
    RoughConductorValues v;
    v.distribution = beckmann ? Distribution::kBeckmann : Distribution::kGgx;
    v.alpha = 0.3;
    v.alpha_v = 0.1;
    if (copper) v.eta = {0.2010, 0.9237, 1.1022};
    // The tangent, of some length and slope.
    cases.push_back({std::string("anisotropic ") + (beckmann ? "beckmann" : "ggx"),
                     std::make_shared<HeldTextures>(make_roughconductor(v),
                                                    std::vector<Rgb<double>>{{0.9, -1.3, 0.4}}),
                     0.1, beckmann, false});
  }
  add_principled(cases, copper);
  add_mapped(cases);
  return cases;
}

// The unit vector at polar angle theta from unit n and azimuth phi (in some frame around n).
inline Vec3d around(const Vec3d& n, double theta, double phi) {
  return Frame(n).to_world(
      {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)});
}

}  // namespace limn::test
