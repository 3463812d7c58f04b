// Where the samples of reverse mode go, and what its batches keep.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "integrators/estimates/peak_memory.h"
#include "limn/core/image.h"
#include "limn/core/rng.h"
#include "limn/integrators/backward.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

Scene scene_under(const TempFiles& files, const std::string& sky, int size = 16) {
  SceneParts parts;
  parts.width = parts.height = size;
  parts.max_depth = 3;
  parts.origin = {0, 2.5, 4};
  parts.target = {0, 0.4, 0};
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.2)) +
               obj_shape("body", write_mesh(files, "body.obj", torus_mesh(9, 5)), false, 0.6,
                         {0, 0.9, 0}, diffuse("clay", ".6, .5, .4")) +
               square("lamp", 0.8, 90, {0.5, 3.5, 1}, area_light("glow", "6, 6, 6")) + sky;
  return make_scene(files, parts);
}

// Black in half of the pixels, and over four orders of magnitude of either sign in the others.
Image steep_adjoint(const Scene& scene) {
  Image adjoint(scene.film.crop_width, scene.film.crop_height, 3);
  for (size_t i = 0; i < adjoint.data.size(); ++i) {
    Rng rng(5, i / 3, 0);
    const double magnitude = std::pow(10, -4 * rng.uniform());
    if (rng.uniform() < 0.5) continue;
    adjoint.data[i] = static_cast<float>(rng.uniform() < 0.5 ? magnitude : -magnitude);
  }
  return adjoint;
}

// Whatever the adjoint is, pixels by it and even ones have one mean, and the first less variance.
TEST(ReverseSamples, PixelsByASteepAdjointHaveTheMeanOfEvenOnes) {
  const TempFiles files;
  const Scene scene = scene_under(files, make_sky(files, "sky"));
  const Image adjoint = steep_adjoint(scene);
  BackwardOptions options;
  options.parameters = {"body.translate.x", "body.translate.y",   "body.translate.z",
                        "body.scale",       "clay.reflectance.r", "sensor.translate.y",
                        "glow.radiance.g"};
  options.batches = 64;
  RunSettings settings;
  settings.spp = 256;
  settings.threads = 2;
  const BackwardResult chosen = backward(scene, adjoint, options, settings);
  options.uniform_pixels = true;
  settings.seed = 1;
  const BackwardResult even = backward(scene, adjoint, options, settings);
  double gain = 1;
  for (const std::string& name : options.parameters) {
    const Moments &a = chosen.of(name).moments, &b = even.of(name).moments;
    const double z = (a.mean(0) - b.mean(0)) / std::sqrt(a.variance(0) + b.variance(0));
    fmt::print("{:20} {:9.3g} +- {:7.2g}  even {:9.3g} +- {:7.2g}  z {:.2f}\n", name, a.mean(0),
               std::sqrt(a.variance(0)), b.mean(0), std::sqrt(b.variance(0)), z);
    EXPECT_LT(std::fabs(z), 4.5) << name;
    gain *= std::pow(b.variance(0) / a.variance(0), 1.0 / options.parameters.size());
  }
  EXPECT_GT(gain, 1.2);
}

// Few points on the film are as right as many.
TEST(ReverseSamples, AnyNumberOfFilmPointsHasOneMean) {
  const TempFiles files;
  const Scene scene = scene_under(files, make_sky(files, "sky"));
  const Image adjoint = steep_adjoint(scene);
  BackwardOptions options;
  options.terms = {"camera"};
  options.parameters = {"body.translate.x", "body.translate.y", "sensor.translate.y", "sensor.fov"};
  options.batches = 64;
  RunSettings settings;
  settings.spp = 256;
  const auto run = [&](double camera_samples, uint64_t seed) {
    options.camera_samples = camera_samples;
    settings.seed = seed;
    return backward(scene, adjoint, options, settings);
  };
  const BackwardResult few = run(0.1, 0), many = run(2, 1);
  for (const std::string& name : options.parameters) {
    const Moments &a = few.of(name).moments, &b = many.of(name).moments;
    const double z = (a.mean(0) - b.mean(0)) / std::sqrt(a.variance(0) + b.variance(0));
    EXPECT_LT(std::fabs(z), 4.5) << name << ": " << a.mean(0) << ", " << b.mean(0);
  }
}

// Half a million texels in 64 batches: 200 MB if batches were kept.
TEST(ReverseSamples, ACheckKeepsNoBatchesOfTexels) {
  const TempFiles files;
  Image map(512, 256, 3);
  for (float& v : map.data) v = 0.5f;
  write_exr(files.path("sky.exr"), map, false, {});
  const Scene scene =
      scene_under(files,
                  R"(<emitter type="envmap" id="sky"><string name="filename" value=")" +
                      files.path("sky.exr") + R"("/></emitter>)",
                  4);
  BackwardOptions options;
  options.parameters = {"sky.data"};
  options.terms = {"interior"};
  RunSettings settings;
  settings.spp = 64;
  reset_peak_memory();
  const uint64_t before = peak_memory_bytes();
  const auto checks = check_reverse(scene, options, settings);
  const uint64_t after = peak_memory_bytes();
  if (after == 0) GTEST_SKIP() << "the system does not tell";
  ASSERT_EQ(checks.size(), 1u);
  EXPECT_LT(std::fabs(checks[0].z), 4.5);
  EXPECT_LT(after - before, 100u << 20);
}

}  // namespace
}  // namespace limn
