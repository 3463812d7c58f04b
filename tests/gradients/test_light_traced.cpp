// Images by particles and paths against those by paths alone.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "limn/core/error.h"
#include "limn/integrators/render.h"
#include "limn/integrators/statistics.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr double kLevel = 1e-4;

Moments image_of(const Scene& scene, const std::string& method, int spp, uint64_t seed,
                 int threads = 2) {
  RunSettings settings;
  settings.spp = spp;
  settings.seed = seed;
  settings.threads = threads;
  RenderOptions options;
  options.method = Method(method);
  options.generator = "independent";
  return render(scene, settings, options).radiance;
}

// A body on a floor under a light, which has the same power whatever its size.
Scene scene_with(const TempFiles& files, const std::string& bsdf, bool smooth, double lamp,
                 const std::string& sensor = "", bool under_body = false) {
  SceneParts parts;
  parts.max_depth = 5;
  parts.rr_depth = 3;
  parts.width = parts.height = 8;
  parts.origin = {0, 2.5, 5};
  if (under_body) {
    parts.origin = {1.6, 0.12, 1.6};
    parts.target = {0.16, 0, -0.05};
    parts.fov = 5;
  }
  const Mesh mesh = smooth ? icosphere_mesh(2) : cube_mesh();
  parts.body =
      square("floor", 2.5, -90, {0, 0, 0}, diffuse("chalk", "0.7, 0.6, 0.5")) +
      obj_shape("body", write_mesh(files, "body.obj", mesh), !smooth, 0.6, {0.2, 0.8, 0.1}, bsdf) +
      square("lamp", lamp, 90, {0.3, 3, 0.5},
             area_light("glow", fmt::format("{}", 3 / (lamp * lamp)))) +
      constant_light("sky", "0.1, 0.2, 0.3");
  std::string text = scene_text(parts);
  const std::string pinhole = "<sensor type=\"perspective\">";
  if (!sensor.empty()) text.replace(text.find(pinhole), pinhole.size(), sensor);
  return read_scene_text(text, "", {}, nullptr);
}

void expect_equal(const std::string& name, const Moments& a, const Moments& b) {
  std::vector<double> z;
  double sum = 0, other = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    const double error = std::sqrt(a.variance(i) + b.variance(i));
    // Of the sky alone there is rounding, and no error.
    if (error > 1e-9 * b.mean(i)) {
      const double degrees = std::min(a.degrees(), b.degrees());
      z.push_back(normal_from_student((a.mean(i) - b.mean(i)) / error, degrees));
    }
    sum += a.variance(i);
    other += b.variance(i);
  }
  const ZSummary summary = summarize(z);
  fmt::print("{:16} {:3} values, mean z {:5.2f}, largest |z| {:5.2f}, variance {:.3g} to {:.3g}\n",
             name, summary.count, summary.mean, summary.largest, sum, other);
  EXPECT_GT(summary.count, 100) << name;
  EXPECT_TRUE(summary.plausible(kLevel)) << name;
}

TEST(LightTraced, ImagesAreThoseOfPaths) {
  const TempFiles files;
  const std::string lens = R"(<sensor type="thinlens"><float name="aperture_radius" value="0.2"/>
                              <float name="focus_distance" value="4"/>)";
  const struct {
    std::string name, bsdf;
    bool smooth;
    std::string sensor;
  } cases[] = {
      {"glass", R"(<bsdf type="dielectric"/>)", false, ""},
      {"glass ball", R"(<bsdf type="dielectric"/>)", true, ""},
      {"metal", conductor("gloss", 0.15), false, ""},
      {"mirror", R"(<bsdf type="conductor"/>)", false, ""},
      {"plastic", R"(<bsdf type="plastic"/>)", false, ""},
      {"rough glass", R"(<bsdf type="roughdielectric"><float name="alpha" value="0.2"/></bsdf>)",
       false, ""},
      {"clay", diffuse("clay", "0.6, 0.6, 0.6"), false, lens},
  };
  for (const auto& one : cases) {
    const Scene scene = scene_with(files, one.bsdf, one.smooth, 0.8, one.sensor);
    expect_equal(one.name, image_of(scene, "light-traced", 2048, 1),
                 image_of(scene, "path", 4096, 2));
  }
}

// A screen between the camera and its near plane is not seen, and hides nothing from particles.
TEST(LightTraced, SeesFromTheNearPlaneOn) {
  const TempFiles files;
  Scene scenes[2];
  for (const bool screened : {false, true}) {
    SceneParts parts;
    parts.width = parts.height = 8;
    parts.origin = {0, 2.5, 5};
    parts.body = square("floor", 2.5, -90, {0, 0, 0}, diffuse("chalk", "0.7, 0.6, 0.5")) +
                 square("lamp", 0.3, 90, {0.3, 3, 0.5}, area_light("glow", "30")) +
                 (screened ? square("screen", 0.3, 0, {0, 2.1, 4}, diffuse("grey", "0")) : "");
    scenes[screened] = make_scene(files, parts);
    scenes[screened].camera.near_clip = 2;
  }
  const Moments open = image_of(scenes[0], "light-traced", 256, 1);
  const Moments screened = image_of(scenes[1], "light-traced", 256, 1);
  double sum = 0;
  for (size_t i = 0; i < open.size(); ++i) {
    EXPECT_NEAR(screened.mean(i), open.mean(i), 1e-6 + 1e-3 * open.mean(i)) << i;
    sum += open.mean(i);
  }
  EXPECT_GT(sum, 1);
}

// The caustic of a small light on the floor below a ball of glass, which paths meet by chance.
TEST(LightTraced, FindsCausticsOfSmallLights) {
  const TempFiles files;
  const Scene scene = scene_with(files, R"(<bsdf type="dielectric"/>)", true, 0.05, "", true);
  const auto variance = [&](const std::string& method) {
    const Moments m = image_of(scene, method, 1024, 3);
    double sum = 0;
    for (size_t i = 0; i < m.size(); ++i) sum += m.variance(i);
    return sum;
  };
  const double particles = variance("light-traced"), paths = variance("path");
  fmt::print("variance {:.3g}, of paths {:.3g}\n", particles, paths);
  EXPECT_LT(particles, 0.2 * paths);
}

TEST(LightTraced, HaveTheSameBitsOnAnyNumberOfThreads) {
  const TempFiles files;
  const Scene scene = scene_with(files, R"(<bsdf type="dielectric"/>)", true, 0.5);
  const Moments one = image_of(scene, "light-traced", 4, 3, 1);
  const Moments three = image_of(scene, "light-traced", 4, 3, 3);
  for (size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one.mean(i), three.mean(i));
}

// As the message of a sample that is not finite asks for.
TEST(LightTraced, TracesOneParticle) {
  const TempFiles files;
  const Scene scene = scene_with(files, diffuse("clay", "0.6, 0.6, 0.6"), true, 0.5);
  RunSettings settings;
  settings.spp = 4;
  RenderOptions options;
  options.method = Method("light-traced");
  int on_film = 0;
  for (int64_t k = 0; k < 64; ++k) {
    const auto log = trace_sample(scene, settings, {-1, -1, k, "particles"}, options);
    ASSERT_EQ(log.size(), 2u);
    on_film += log[0].find("film point") == 0;
  }
  EXPECT_GT(on_film, 0);
  EXPECT_LT(on_film, 64);
  EXPECT_EQ(trace_sample(scene, settings, {4, 4, 0, ""}, options)[0].find("film position"), 0u);
  EXPECT_THROW(trace_sample(scene, settings, {-1, -1, 4 * 64, "particles"}, options), InputError);
}

TEST(LightTraced, RefusesByName) {
  const TempFiles files;
  const auto refusal = [&](const Scene& scene) -> std::string {
    try {
      image_of(scene, "light-traced", 1, 1);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(refusal(scene_with(files, R"(<bsdf type="thindielectric"/>)", false, 0.5))
                .find("does not support masks and thin panes"),
            std::string::npos);
}

}  // namespace
}  // namespace limn
