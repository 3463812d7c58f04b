// Caustics by particles among blurred faces: against paths, and against differences of images.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/error.h"
#include "limn/integrators/check.h"
#include "limn/integrators/fit.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/render.h"
#include "limn/integrators/statistics.h"
#include "support/meshes.h"
#include "support/motion_scenes.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr double kLevel = 1e-4;
constexpr const char* kParticles = "blurred:caustics=particles";
const Blur kBlur{0.01};
const char* const kTent = R"(<boolean name="sample_border" value="true"/>
                             <rfilter type="tent"><float name="radius" value="1.5"/></rfilter>)";

RunSettings run_settings(int spp, uint64_t seed, int threads = 2) {
  RunSettings settings;
  settings.spp = spp;
  settings.seed = seed;
  settings.threads = threads;
  return settings;
}
Moments image_of(const Scene& scene, const std::string& method, int spp, uint64_t seed,
                 int threads = 2) {
  RenderOptions options;
  options.method = Method(method);
  options.blur = kBlur;
  options.generator = "independent";
  return render(scene, run_settings(spp, seed, threads), options).radiance;
}
GradientResult gradient_of(const Scene& scene, const std::vector<std::string>& names,
                           const std::string& method, int spp, uint64_t seed, int threads = 2) {
  GradientOptions options;
  options.parameters = names;
  options.method = Method(method);
  options.block = 4;  // single pixels of paths meet a caustic too seldom to know their errors
  options.blur = kBlur;
  return gradient(scene, options, run_settings(spp, seed, threads));
}

// A body between a light, which has the same power whatever its size, and a floor that is seen from
// the side.
Scene scene_with(const std::string& body, double lamp = 0.5, const std::string& film = kTent) {
  SceneParts parts;
  parts.max_depth = 5;
  parts.width = parts.height = 8;
  parts.origin = {0, 0.9, 3.5};
  parts.target = {0, 0.2, 0};
  parts.fov = 35;
  parts.film = film;
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.6)) + body +
               square("lamp", lamp, 90, {0.1, 3, 0.2},
                      area_light("glow", fmt::format("{}", 2 / (lamp * lamp)))) +
               constant_light("sky", "0.1, 0.2, 0.3");
  return scene_of_text(scene_text(parts));
}
std::string sheet() {
  return square("body", 0.5, -75, {0.1, 1.2, 0}, R"(<bsdf type="dielectric" id="glass"/>)");
}
std::string cube(const TempFiles& files, const std::string& bsdf) {
  return obj_shape("body", write_mesh(files, "body.obj", cube_mesh()), true, 0.4, {0.1, 1, 0.1},
                   bsdf);
}

double z_of(const Moments& a, const Moments& b, size_t i) {
  const double error = std::sqrt(a.variance(i) + b.variance(i));
  if (!(error > 1e-9 * std::fabs(b.mean(i)))) return 0;
  return normal_from_student((a.mean(i) - b.mean(i)) / error, std::min(a.degrees(), b.degrees()));
}
// By the largest z of many: neighbours share particles.
void expect_equal(const std::string& name, const Moments& a, const Moments& b) {
  double largest = 0;
  for (size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::fabs(z_of(a, b, i)));
  fmt::print("{:24} {} values, largest |z| {:5.2f}\n", name, a.size(), largest);
  EXPECT_GT(largest, 0) << name;
  EXPECT_GT(static_cast<double>(a.size()) * std::erfc(largest / std::sqrt(2)), kLevel) << name;
}

TEST(BlurredCaustics, ImagesAreThoseOfPaths) {
  const TempFiles files;
  const std::pair<std::string, std::string> bodies[] = {
      {"sheet", sheet()},
      {"glass cube", cube(files, R"(<bsdf type="dielectric"/>)")},
      {"metal cube", cube(files, R"(<bsdf type="conductor"/>)")},
      {"plastic cube", cube(files, R"(<bsdf type="plastic"/>)")}};
  for (const auto& [name, body] : bodies) {
    const Scene scene = scene_with(body);
    expect_equal(name, image_of(scene, kParticles, 1024, 1), image_of(scene, "blurred", 4096, 2));
  }
}

TEST(BlurredCaustics, DerivativesAreThoseOfPaths) {
  const Scene scene = scene_with(sheet());
  const std::vector<std::string> names{"body.translate.x", "body.translate.y",  "body.rotate.x",
                                       "glass.eta",        "lamp.translate.x",  "lamp.rotate.z",
                                       "glow.radiance",    "sensor.translate.x"};
  const auto particles = gradient_of(scene, names, kParticles, 4096, 3);
  const auto paths = gradient_of(scene, names, "blurred", 8192, 4);
  for (size_t k = 0; k < names.size(); ++k) {
    const ParameterGradient &a = particles.parameters[k], &b = paths.parameters[k];
    expect_equal(names[k], a.total_blocks, b.total_blocks);
    expect_equal(names[k], a.image_sum, b.image_sum);
  }
}

// All light comes by the body: a window over the whole floor, or a mirror over a lamp that faces
// up.
Scene scene_by(const std::string& body, double lamp_angle, const Vec3d& lamp, double size = 0.3,
               double radiance = 20) {
  SceneParts parts;
  parts.max_depth = 3;
  parts.width = parts.height = 8;
  parts.origin = {0, 0.9, 3.5};
  parts.target = {0, 0.2, 0};
  parts.fov = 35;
  parts.film = kTent;
  parts.body =
      square("floor", 2.5, -90, {0, 0, 0}, diffuse("chalk", "0.7, 0.6, 0.5")) + body +
      square("lamp", size, lamp_angle, lamp, area_light("glow", fmt::format("{}", radiance)));
  return scene_of_text(scene_text(parts));
}

TEST(BlurredCaustics, DerivativesAreThoseOfImages) {
  const std::string glass = R"(<bsdf type="dielectric" id="glass"/>)";
  const Scene window = scene_by(square("body", 4, -80, {0, 1.7, 0}, glass), 90, {0.1, 3, 0.2});
  const Scene mirror = scene_by(square("body", 0.5, 95, {0.1, 2.2, 0}, glass), -90, {0, 1.5, 0.4});
  CheckOptions options;
  options.method = Method(kParticles);
  options.blur = kBlur;
  for (const auto& [scene, name] : {std::pair(&window, "body.translate.y"),
                                    {&window, "body.rotate.x"},
                                    {&window, "glass.eta"},
                                    {&window, "lamp.translate.x"},
                                    {&window, "glow.radiance"},
                                    {&window, "sensor.fov"},
                                    {&mirror, "body.translate.x"},
                                    {&mirror, "body.vertex_positions.1.x"},
                                    {&mirror, "glass.eta"},
                                    {&mirror, "lamp.rotate.z"},
                                    {&mirror, "sensor.translate.x"},
                                    {&mirror, "chalk.reflectance"}}) {
    options.parameter = name;
    const CheckResult result = check(*scene, options, run_settings(512, 5));
    fmt::print("{:28} {} {:10.4g} +- {:8.2g}, differences {:10.4g} +- {:8.2g}, z {:5.2f}\n", name,
               verdict_name(result.verdict), result.total.gradient, result.total.gradient_error,
               result.total.difference, result.total.difference_error, result.total.z);
    EXPECT_NE(result.verdict, Verdict::kDisagree) << name;
    EXPECT_GT(std::erfc(std::fabs(result.total.z) / std::sqrt(2)), kLevel) << name;
    EXPECT_NE(result.total.gradient, 0) << name;
  }
}

// The place of a mirror whose light on the floor does not overlap its target.
TEST(BlurredCaustics, LeadFitsToTheirTargets) {
  constexpr double kFar = 0.5;
  const auto mirror_at = [](double x) {
    const std::string glass = R"(<bsdf type="dielectric"><float name="int_ior" value="3"/></bsdf>)";
    return scene_by(square("body", 0.1, 90, {x, 2.6, 0}, glass), -90, {0, 1.4, 0}, 0.05, 2000);
  };
  RenderOptions by_particles;
  by_particles.method = Method("light-traced");
  const Scene truth = mirror_at(-kFar / 2);
  const Moments m = render(truth, run_settings(1024, 1), by_particles).radiance;
  Image target(truth.film.crop_width, truth.film.crop_height, 3);
  for (size_t i = 0; i < m.size(); ++i) target.data[i] = static_cast<float>(m.mean(i));
  FitOptions options;
  options.parameters = {"body.translate.x"};
  options.blur = {0.1, 0, BlurWeights::kOrdered, true};
  options.blur_steps = 60;
  options.step = 12;
  options.step_half_life = 20;
  Fit fit({{mirror_at(kFar / 2), target, {}}}, options, run_settings(64, 2));
  std::vector<double> end;
  for (int i = 0; i < 60; ++i) end = fit.step()->values;
  fmt::print("{:.3f} of {:.3f}\n", end[0], -kFar);
  EXPECT_LT(std::fabs(end[0] + kFar), kFar / 4);
}

TEST(BlurredCaustics, HaveTheSameBitsOnAnyNumberOfThreads) {
  const Scene scene = scene_with(sheet());
  const auto one = gradient_of(scene, {"glass.eta"}, kParticles, 4, 11, 1);
  const auto three = gradient_of(scene, {"glass.eta"}, kParticles, 4, 11, 3);
  for (size_t i = 0; i < one.radiance.size(); ++i) {
    EXPECT_EQ(one.radiance.mean(i), three.radiance.mean(i));
    EXPECT_EQ(one.parameters[0].total.mean(i), three.parameters[0].total.mean(i));
  }
}

TEST(BlurredCaustics, RefuseFiltersThatJump) {
  const auto refusal = [&](const std::string& film) -> std::string {
    const Scene scene = scene_with(sheet(), 0.5, film);
    image_of(scene, kParticles, 1, 1);
    try {
      gradient_of(scene, {"glass.eta"}, kParticles, 1, 1);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  for (const char* film : {"", R"(<rfilter type="gaussian"/>)"}) {
    EXPECT_NE(refusal(film).find("any but box, with sample_border"), std::string::npos);
  }
  EXPECT_EQ(refusal(kTent), "");
}

}  // namespace
}  // namespace limn
