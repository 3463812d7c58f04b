// Derivatives of values against differences along the same paths, to a thousandth.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "limn/core/error.h"
#include "limn/integrators/check.h"
#include "support/scenes.h"

namespace limn {
namespace {

struct Case {
  const char* bsdf;
  std::vector<const char*> parameters;
};
const Case kCases[] = {
    {R"(<bsdf type="diffuse" id="paint"><texture type="checkerboard" name="reflectance"/></bsdf>)",
     {"paint.reflectance.color0.g", "glow.radiance.r", "sky.radiance.b"}},
    {R"(<bsdf type="roughconductor" id="paint"><string name="material" value="Cu"/></bsdf>)",
     {"paint.alpha"}},
    // Its tables' slopes by alpha and eta are those of smoothed tables.
    {R"(<bsdf type="roughplastic" id="paint"/>)", {"paint.diffuse_reflectance.g"}},
    {R"(<bsdf type="plastic" id="paint"/>)", {"paint.eta", "paint.diffuse_reflectance.r"}},
    {R"(<bsdf type="dielectric" id="paint"/>)", {"paint.specular_transmittance.r"}},
    {R"(<bsdf type="roughdielectric" id="paint"/>)", {"paint.alpha", "paint.eta"}},
    {R"(<bsdf type="principled" id="paint"><float name="roughness" value="0.4"/>
        <float name="clearcoat" value="0.5"/><float name="spec_trans" value="0.2"/>
        <float name="specular" value="0.5"/></bsdf>)",
     {"paint.roughness", "paint.clearcoat", "paint.spec_trans"}},
    {R"(<bsdf type="mask"><float name="opacity" value="0.6"/><bsdf type="diffuse"/></bsdf>)",
     {"object.bsdf.opacity"}},
    {R"(<bsdf type="blendbsdf" id="paint"><float name="weight" value="0.3"/>
        <bsdf type="diffuse"/><bsdf type="conductor"/></bsdf>)",
     {"paint.weight"}}};

Scene scene_with(const TempFiles& files, const std::string& bsdf) {
  SceneParts parts;
  parts.max_depth = 6;
  parts.rr_depth = 3;
  parts.width = parts.height = 8;
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("ground", "0.5, 0.5, 0.5")) +
               square("object", 1.5, -40, {0, 1, 0}, bsdf) +
               square("lamp", 1, 90, {0, 3, 1}, area_light("glow", "5, 5, 5")) +
               constant_light("sky", "0.5, 0.4, 0.3");
  return make_scene(files, parts);
}

TEST(CheckPaths, AgreesForEveryKind) {
  const TempFiles files;
  RunSettings settings;
  settings.spp = 16;
  for (const Case& c : kCases) {
    const Scene scene = scene_with(files, c.bsdf);
    for (const char* parameter : c.parameters) {
      const PathsCheck check = check_paths(scene, parameter, 0, settings);
      EXPECT_NE(check.gradient_sum, 0) << parameter;
      EXPECT_TRUE(check.agrees()) << c.bsdf << " " << parameter << " " << check.error;
    }
    EXPECT_THROW(check_paths(scene, "object.translate.x", 0, settings), InputError);
  }
}

// One step of three agrees with the slopes of smoothed tables.
TEST(CheckPaths, NeedsTwoSteps) {
  const TempFiles files;
  RunSettings settings;
  settings.spp = 16;
  const Scene scene = scene_with(files, R"(<bsdf type="roughplastic" id="paint">
                                             <float name="alpha" value="0.16"/></bsdf>)");
  EXPECT_TRUE(check_paths(scene, "paint.alpha", 0.0016, settings).agrees());
  EXPECT_FALSE(check_paths(scene, "paint.alpha", 0, settings).agrees());
}

}  // namespace
}  // namespace limn
