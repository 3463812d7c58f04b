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

// The back of a lamp, and a panel in its place that looks the other way, see nothing of it,
// whichever side of its plane their points are rounded to.
TEST(Analytic, LampsFromBehindAreBlack) {
  const std::string glow = R"(<emitter type="area"><rgb name="radiance" value="2"/></emitter>)";
  const std::string matt = R"(<bsdf type="twosided"><bsdf type="diffuse"/></bsdf>)";
  const std::string back = R"(<rotate y="1" angle="180"/>)";
  const std::string flip = R"(<boolean name="flip_normals" value="true"/>)";
  for (int k = 0; k < 6; ++k) {
    const std::string turn = fmt::format(
        R"(<rotate x="{}" y="0.6" z="{}" angle="{}"/><translate x="{}" y="{}" z="{}"/>)", 0.3 * k,
        1 - 0.2 * k, 17 + 61 * k, 0.7 - 0.37 * k, 0.31 * k - 1.1, 1.3 - 0.53 * k);
    const auto shape = [&](const std::string& type, const std::string& first,
                           const std::string& inner) {
      return "<shape type=\"" + type + "\"><transform name=\"to_world\">" + first + turn +
             "</transform>" + inner + "</shape>";
    };
    for (const auto& [name, body] : std::vector<std::pair<std::string, std::string>>{
             {"rectangle", shape("rectangle", "", matt + glow)},
             {"panel", shape("rectangle", "", glow) + shape("rectangle", back, matt)},
             {"large panel", shape("rectangle", "", glow) +
                                 shape("rectangle", back + "<scale value=\"3\"/>", matt)},
             {"box", shape("cube", "<translate z=\"1\"/>", flip + matt + glow)}}) {
      const std::string text =
          R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/>
          </integrator><sensor type="perspective"><float name="fov" value="30"/>
          <transform name="to_world"><lookat origin="0.2,0.3,-2.5" target="0,0,0" up="0,1,0"/>)" +
          turn +
          R"(</transform><film type="hdrfilm"><integer name="width" value="6"/>
          <integer name="height" value="6"/><rfilter type="box"/></film></sensor>)" +
          body + "</scene>";
      const Scene scene = read_scene_text(text, "", {}, nullptr);
      for (const std::string method : {"analytic", "lines"}) {
        RunSettings settings;
        settings.spp = 2;
        settings.threads = 1;
        const Moments image = render(scene, settings, {.method = method}).radiance;
        double brightest = 0;
        for (size_t i = 0; i < image.size(); ++i) brightest = std::max(brightest, image.mean(i));
        EXPECT_LT(brightest, 1e-6) << method << ", " << name << " " << k;
      }
    }
  }
}

// Normals of a file at a right angle to their face, and past it.
TEST(Analytic, NormalsAtRightAnglesToTheirFace) {
  const TempFiles files;
  for (const double up : {0.0, -0.5, 0.5}) {
    const std::string leaf = files.write(
        "leaf.obj", fmt::format("v -1 0 -1\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nvn 0 1 0\nvn 1 {} 0\n"
                                "f 1//2 2//2 3//1\nf 1//2 3//2 4//2\n",
                                up));
    SceneParts parts;
    parts.max_depth = 2;
    parts.body = square("lamp", 0.5, 90, {0.7, 2, 0}, area_light("glow", "5, 5, 5")) +
                 obj_shape("leaf", leaf, false, 1, {0, 0, 0},
                           R"(<bsdf type="twosided"><bsdf type="diffuse"/></bsdf>)");
    const Scene scene = make_scene(files, parts);
    const auto sum = [&](const std::string& method, int spp) {
      RunSettings settings;
      settings.spp = spp;
      const RenderResult result = render(scene, settings, {.method = method});
      EXPECT_EQ(result.non_finite.count, 0u) << method << ", " << up;
      std::pair<double, double> total;
      for (size_t i = 0; i < result.radiance.size(); ++i) {
        total.first += result.radiance.mean(i);
        total.second += result.radiance.variance(i);
      }
      return total;
    };
    const auto [sampled, variance] = sum("path", 64);
    for (const std::string method : {"analytic", "lines"}) {
      const auto [closed, of_film] = sum(method, 4);
      // Channels are alike: three times the variance of their sum if they were not.
      const double error = std::sqrt(3 * (variance + of_film));
      fmt::print("{:4}: {:8} {:.5g} +- {:.2g}, by paths {:.5g}\n", up, method, closed, error,
                 sampled);
      EXPECT_LE(std::fabs(closed - sampled), 4 * error + 1e-12) << method << ", " << up;
      EXPECT_GT(sampled, 0);
    }
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
