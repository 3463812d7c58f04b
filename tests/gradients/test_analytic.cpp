// The method analytic: what it refuses, and lamps that lie in other surfaces.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "limn/integrators/gradient.h"
#include "limn/integrators/render.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

// A lamp flush in a ceiling far larger than it, both turned: how corners are rounded says nothing
// about which of them is before the other.
TEST(Analytic, LampsFlushInLargeSurfaces) {
  for (const double offset : {-21.0, 21.0}) {
    const auto turned = [](const std::string& scale, const std::string& place, const char* inner) {
      return R"(<shape type="rectangle"><transform name="to_world"><scale value=")" + scale +
             R"("/><translate )" + place +
             R"(/><rotate x="0.3" y="0.5" z="0.2" angle="37"/></transform>)" + inner + "</shape>";
    };
    const std::string text =
        R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/>
        </integrator><sensor type="perspective"><float name="fov" value="40"/>
        <transform name="to_world"><lookat origin="0,0,0.2" target="0,0,2" up="0,1,0"/>
        <rotate x="0.3" y="0.5" z="0.2" angle="37"/></transform>
        <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/>
        <rfilter type="box"/></film></sensor>)" +
        turned("50", fmt::format(R"(x="17" y="{}")", offset), "") +
        turned("0.5", R"(x="0")",
               R"(<emitter type="area"><rgb name="radiance" value="5"/></emitter>)") +
        R"(<shape type="rectangle"><transform name="to_world"><rotate y="1" angle="180"/>
        <scale value="2"/><translate z="2"/><rotate x="0.3" y="0.5" z="0.2" angle="37"/></transform>
        </shape></scene>)";
    const Scene scene = read_scene_text(text, "", {}, nullptr);
    // The sum over the image in green, and its variance.
    const auto sum = [&](const std::string& method, uint64_t seed) {
      RunSettings settings;
      settings.spp = 64;
      settings.seed = seed;
      const Moments image = render(scene, settings, {.method = method}).radiance;
      std::pair<double, double> total;
      for (size_t pixel = 0; pixel < 64; ++pixel) {
        total.first += image.mean(3 * pixel + 1);
        total.second += image.variance(3 * pixel + 1);
      }
      return total;
    };
    const auto [closed, closed_variance] = sum("analytic", 1);
    const auto [sampled, sampled_variance] = sum("path", 2);
    const double z = (closed - sampled) / std::sqrt(closed_variance + sampled_variance);
    fmt::print("offset {:5}: {:.6g}, by paths {:.6g}, z {:.2f}\n", offset, closed, sampled, z);
    EXPECT_GT(sampled, 0);
    EXPECT_LT(std::fabs(z), 4);
  }
}

TEST(Analytic, SaysWhatItCannotTake) {
  const TempFiles files;
  const std::string lamp = square("lamp", 0.5, 90, {0, 2, 0}, area_light("glow", "1, 1, 1"));
  const auto message = [&](int max_depth, const std::string& body) {
    SceneParts parts;
    parts.max_depth = max_depth;
    parts.body = lamp + body;
    const Scene scene = make_scene(files, parts);
    try {
      render(scene, {}, {.method = "analytic"});
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(message(2, ""), "");
  EXPECT_EQ(message(1, constant_light("sky", "1, 1, 1")), "");
  const auto expect = [&](const std::string& text, const std::string& words) {
    EXPECT_NE(text.find(words), text.npos) << text;
  };
  expect(message(3, ""), "set the integrator's max_depth to 2 (it is 3)");
  expect(message(-1, ""), "(it is -1)");
  expect(message(2, constant_light("sky", "1, 1, 1")), "emitter \"sky\": light from all around");
  expect(message(2, R"(<emitter type="point" id="spark"/>)"),
         "emitter \"spark\": only area lights");
  const std::string mirror = message(2, square("floor", 1, -90, {0, 0, 0}, conductor("m", 0.1)));
  expect(mirror, "shape \"floor\": only diffuse surfaces");
  expect(mirror, ".xml:");
  const std::string ball = write_mesh(files, "bulb.obj", icosphere_mesh(1));
  expect(message(2, obj_shape("bulb", ball, true, 1, {0, 0, 0}, area_light("g", "1, 1, 1"))),
         "shape \"bulb\" has 80 planes, at most 64");
  GradientOptions options;
  options.parameters = {"lamp.translate.x"};
  options.method = "analytic";
  options.terms = {"boundary"};
  SceneParts parts;
  parts.max_depth = 2;
  parts.body = lamp;
  EXPECT_THROW(gradient(make_scene(files, parts), options, {}), InputError);
}

}  // namespace
}  // namespace limn
