// Fits whose first steps see faces blurred: their gradients, their schedule, what they reach from a
// bad start, and what they refuse.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/integrators/fit.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/render.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr double kFar = 0.9;  // from the start of a box to its truth

// A box at x, out of view, and the floor that gets its shadow.
Scene shadow_scene(const TempFiles& files, double x, int pixels, bool flat = false) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 1.2, 3};
  parts.target = {0, 0, 0};
  parts.width = parts.height = pixels;
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("grey", ".7, .5, .3")) +
               obj_shape("box", write_mesh(files, "box.obj", cube_mesh()), flat, 0.25, {x, 1.6, 0},
                         diffuse("white", ".7")) +
               square("lamp", 0.3, 90, {0, 4, 0}, area_light("glow", "30"));
  return make_scene(files, parts);
}

Image target_of(const Scene& scene) {
  RunSettings settings;
  settings.spp = 512;
  settings.seed = 99;
  const Moments m = render(scene, settings, {}).radiance;
  Image image(scene.film.crop_width, scene.film.crop_height, 3);
  for (size_t i = 0; i < m.size(); ++i) image.data[i] = static_cast<float>(m.mean(i));
  return image;
}

FitOptions options_of(const std::vector<std::string>& names, double sigma, int steps) {
  FitOptions options;
  options.parameters = names;
  options.blur = {sigma, 0};
  options.blur_steps = steps;
  return options;
}

RunSettings settings_of(int spp, uint64_t seed, int threads = 1) {
  RunSettings settings;
  settings.spp = spp;
  settings.seed = seed;
  settings.threads = threads;
  return settings;
}

// The mean step of gradient descent is the product of the sharp image's adjoint and the blurred
// derivative image, for a motion and for a colour, channel by channel.
TEST(BlurredFit, StepsAreSharpAdjointsTimesBlurredDerivatives) {
  const TempFiles files;
  const Scene scene = shadow_scene(files, 0.3, 4, true);
  // Another place of the shadow, and less light: neither derivative cancels.
  Image target = target_of(shadow_scene(files, 0, 4));
  for (float& x : target.data) x *= 0.7f;
  const Blur blur{0.03, 0};
  const std::vector<std::string> names{"box.translate.x", "grey.reflectance"};

  const Moments image =
      render(scene, settings_of(1 << 14, 5), {.generator = "independent"}).radiance;
  GradientOptions derived;
  derived.method = Method("blurred");
  derived.blur = blur;
  derived.parameters = names;
  const GradientResult gradient = limn::gradient(scene, derived, settings_of(1 << 14, 6));
  std::vector<double> exact(4), variance(4), bound(4);
  for (size_t i = 0; i < image.size(); ++i) {
    const double scale = 2 / static_cast<double>(image.size());
    for (size_t k = 0; k < 2; ++k) {
      const Moments& d = gradient.parameters[k].total;
      const double a = scale * (image.mean(i) - target.data[i]);
      const size_t to = k == 0 ? 0 : 1 + i % 3;
      exact[to] += a * d.mean(i);
      // At most: errors of a pixel's channels do not cancel.
      bound[to] += std::hypot(a * std::sqrt(d.variance(i)),
                              scale * d.mean(i) * std::sqrt(image.variance(i)));
    }
    for (size_t k = 0; i % 3 == 2 && k < 4; ++k) {
      variance[k] += bound[k] * bound[k];
      bound[k] = 0;
    }
  }

  FitOptions options = options_of(names, blur.sigma, 1);
  options.optimiser = OptimiserKind::kGradientDescent;
  options.step = 1e-3;
  const double unmoved[] = {0, 0.7, 0.5, 0.3};
  const double natural[] = {find_parameter(scene, names[0]).natural_step,
                            find_parameter(scene, names[1]).natural_step};
  Moments found(4);
  for (uint64_t seed = 0; seed < 256; ++seed) {
    Fit fit({{scene, target, {}}}, options, settings_of(32, seed));
    const FitRecord record = fit.step().value();
    EXPECT_EQ(record.sigma, blur.sigma);
    std::vector<double> slopes;
    for (size_t k = 0; k < 4; ++k) {
      const double unit = natural[k == 0 ? 0 : 1];
      slopes.push_back((unmoved[k] - record.values[k]) / (options.step * unit * unit));
    }
    found.add_batch(slopes, 1);
  }
  for (size_t k = 0; k < 4; ++k) {
    const double error = std::sqrt(found.variance(k) + variance[k]);
    const double z = (found.mean(k) - exact[k]) / error;
    fmt::print("{}: {:.4g}, z {:.2f}, error {:.1f} %\n", k, exact[k], z,
               100 * error / std::fabs(exact[k]));
    EXPECT_LT(std::fabs(z), 4.5) << k;
    EXPECT_LT(error, 0.1 * std::fabs(exact[k])) << k;
  }
}

// Where a channel of a colour acts on all channels of the image, its step is that of the channel as
// a parameter of its own.
TEST(BlurredFit, ChannelsOfColoursMayMix) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 2;
  parts.width = parts.height = 4;
  parts.body =
      square("floor", 3, -90, {0, 0, 0},
             R"(<bsdf type="principled" id="paint"><rgb name="base_color" value=".7, .2, .1"/>
                         <float name="spec_tint" value="1"/></bsdf>)") +
      square("lamp", 0.3, 90, {0, 4, 0}, area_light("glow", "30"));
  const Scene scene = make_scene(files, parts);
  const Image target(4, 4, 3);
  const std::string name = "paint.base_color";
  const auto first_step = [&](const std::vector<std::string>& names) {
    FitOptions options = options_of(names, 0.01, 1);
    options.optimiser = OptimiserKind::kGradientDescent;
    options.step = 0.1;
    Fit fit({{scene, target, {}}}, options, settings_of(16, 3));
    fit.step();
    return find_parameter(scene, name).value(fit.views()[0].scene);
  };
  const std::vector<double> whole = first_step({name});
  const std::vector<double> parted = first_step({name + ".r", name + ".g", name + ".b"});
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NE(whole[c], find_parameter(scene, name).value(scene)[c]);
    EXPECT_NEAR(whole[c], parted[c], 1e-12);
  }
}

// On any number of threads, and after a break in the blurred steps.
TEST(BlurredFit, HasTheSameBits) {
  const TempFiles files;
  const Scene scene = shadow_scene(files, 0.3, 8);
  const Image target = target_of(shadow_scene(files, 0, 8));
  const FitOptions options = options_of({"box.translate.x", "grey.reflectance"}, 0.04, 3);
  const auto fit_on = [&](int threads) {
    return Fit({{scene, target, {}}}, options, settings_of(2, 7, threads));
  };
  Fit one = fit_on(1);
  std::vector<double> sigmas, last;
  FitState after_two;
  for (int i = 0; i < 5; ++i) {
    if (i == 2) after_two = one.state();
    const FitRecord record = one.step().value();
    sigmas.push_back(record.sigma);
    last = record.values;
  }
  EXPECT_EQ(sigmas[0], 0.04);
  EXPECT_DOUBLE_EQ(sigmas[1], 0.004);
  EXPECT_DOUBLE_EQ(sigmas[2], 0.0004);
  EXPECT_EQ(sigmas[3], 0);
  Fit other = fit_on(3);
  other.restore(after_two);
  for (int i = 2; i < 4; ++i) other.step();
  EXPECT_EQ(other.step()->values, last);
}

// The shadow of a box that is far from its truth: exact gradients move it away.
TEST(BlurredFit, ReachesWhatExactGradientsMiss) {
  const TempFiles files;
  const Scene scene = shadow_scene(files, kFar, 16);
  const Image target = target_of(shadow_scene(files, 0, 16));
  for (const bool blurred : {true, false}) {
    FitOptions options = options_of({"box.translate.x"}, blurred ? 0.15 : 0, blurred ? 40 : 0);
    options.step = 4;
    options.step_half_life = 40;
    Fit fit({{scene, target, {}}}, options, settings_of(4, 1));
    std::vector<double> end;
    for (int i = 0; i < 90; ++i) end = fit.step()->values;
    fmt::print("{}: {:.3f} of {:.3f}\n", blurred ? "blurred" : "exact", end[0], -kFar);
    if (blurred) {
      EXPECT_LT(std::fabs(end[0] + kFar), 0.05);
    } else {
      EXPECT_GT(end[0], 0);
    }
  }
}

TEST(BlurredFit, RefusesWhatItCannotTake) {
  const TempFiles files;
  const Scene scene = shadow_scene(files, 0, 4);
  const auto message = [&](const FitOptions& options) -> std::string {
    try {
      Fit({{scene, Image(4, 4, 3), {}}}, options, settings_of(1, 0));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  const auto tells = [&](const FitOptions& options, const std::string& text) {
    EXPECT_NE(message(options).find(text), std::string::npos) << message(options);
  };
  const std::vector<std::string> x{"box.translate.x"};
  tells(options_of(x, 0.1, 0), "needs both `sigma`, of the first step, and `blur_steps`");
  tells(options_of(x, 0, 3), "needs both `sigma`");
  tells(options_of({"box.vertex_positions"}, 0.1, 3), "\"box.vertex_positions\" is an array");
  FitOptions options = options_of(x, 0, 0);
  options.sigma_end = 0.1;
  tells(options, "give sigma, too");
  options = options_of(x, 0.1, 3);
  options.optimiser = OptimiserKind::kLbfgs;
  options.backward.method = Method("analytic");
  tells(options, "another optimiser than lbfgs");
  options = options_of(x, 0.1, 3);
  options.sigma_end = 0.2;
  tells(options, "sigma_end must be at most sigma");
  options = options_of(x, 0.1, 3);
  options.backward.terms = {"camera"};
  tells(options, "leave out `terms`");
}

}  // namespace
}  // namespace limn
