// Fits whose first steps see faces blurred: their gradients, their schedule, what they reach from a
// bad start, and what they refuse.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>

#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/core/rng.h"
#include "limn/integrators/fit.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/render.h"
#include "support/meshes.h"
#include "support/motion_scenes.h"
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
  for (uint64_t seed = 0; seed < 512; ++seed) {
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
    EXPECT_DOUBLE_EQ(whole[c], parted[c]);
  }
}

// More numbers than one pass has derivatives of, two views with films, masks and parameters of
// their own: what loss and derivative images of the same samples give.
TEST(BlurredFit, AddsPassesAndViews) {
  const TempFiles files;
  const auto view_of = [&](double height, const std::string& film, const std::string& colour,
                           float weight) {
    SceneParts parts;
    parts.max_depth = 2;
    parts.origin = {0, height, 3};
    parts.target = {0, 0, 0};
    parts.width = 6;
    parts.height = 5;
    parts.film = R"(<rfilter type="box"/>)" + film;
    parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("grey", ".7, .5, .3")) +
                 obj_shape("box", write_mesh(files, "box.obj", cube_mesh()), true, 0.25,
                           {0.3, 1, 0}, diffuse(colour, ".7")) +
                 square("lamp", 0.3, 90, {0, 4, 0}, area_light("glow", "30"));
    FitView view{make_scene(files, parts), {}, {}};
    const Film& f = view.scene.film;
    view.target = Image(f.crop_width, f.crop_height, 3);
    view.mask = Image(f.crop_width, f.crop_height, 1);
    for (size_t i = 0; i < view.mask.data.size(); ++i) {
      view.mask.data[i] = weight * static_cast<float>(i % 3);
    }
    return view;
  };
  const std::vector<FitView> views{
      view_of(1.2, "", "white", 1),
      view_of(2.4,
              R"(<integer name="crop_offset_x" value="1"/><integer name="crop_width" value="4"/>
                      <integer name="crop_offset_y" value="2"/><integer name="crop_height" value="3"/>)",
              "other", 0.5f)};
  FitOptions options = options_of({"box.translate.x", "box.translate.y", "grey.reflectance",
                                   "white.reflectance", "glow.radiance"},
                                  0.03, 1);
  options.optimiser = OptimiserKind::kGradientDescent;
  options.step = 1e-3;
  const RunSettings settings = settings_of(4, 3);

  // By the name of each number; both add up less than 4 x 90 numbers, in another order.
  std::map<std::string, double> slopes, rounding;
  for (size_t v = 0; v < views.size(); ++v) {
    RunSettings own = settings;
    own.seed = mix_bits(mix_bits(mix_bits(settings.seed)) + v);
    const LossResult loss = image_loss(views[v].scene, views[v].target, {}, own, views[v].mask);
    GradientOptions derived;
    derived.method = Method("blurred");
    derived.blur = options.blur;
    derived.parameters = {"box.translate.x", "box.translate.y"};
    for (const char* colour : {"grey.reflectance", "white.reflectance", "glow.radiance"}) {
      if (v == 1 && colour[0] == 'w') continue;
      for (const char* channel : {".r", ".g", ".b"}) {
        derived.parameters.push_back(std::string(colour) + channel);
      }
    }
    const GradientResult found = limn::gradient(views[v].scene, derived, own);
    for (const ParameterGradient& g : found.parameters) {
      double sum = 0;
      for (size_t i = 0; i < g.total.size(); ++i) {
        const double part = g.total.mean(i) * static_cast<double>(0.5f * loss.adjoint.data[i]);
        sum += part;
        rounding[g.name] += 360 * std::numeric_limits<double>::epsilon() * std::fabs(part);
      }
      EXPECT_NE(sum, 0) << g.name;
      slopes[g.name] += sum;
    }
  }

  Fit fit(views, options, settings);
  const std::vector<FitScalar> before = fit.scalars();
  const FitRecord record = fit.step().value();
  ASSERT_EQ(before.size(), 11u);
  ASSERT_EQ(slopes.size(), 11u);
  for (size_t k = 0; k < before.size(); ++k) {
    const double unit = find_parameter(views[0].scene, before[k].parameter).natural_step;
    const double scale = options.step * unit * unit;
    const double expected = before[k].value - scale * slopes.at(before[k].name);
    EXPECT_NE(record.values[k], before[k].value) << before[k].name;
    EXPECT_NEAR(record.values[k], expected,
                scale * rounding.at(before[k].name) +
                    2 * std::numeric_limits<double>::epsilon() * std::fabs(before[k].value))
        << before[k].name;
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

// Each number of an array has a derivative image of its own, at the times of a shutter.
TEST(BlurredFit, TakesVerticesAndVelocities) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 1;
  parts.width = parts.height = 6;
  parts.body = animated(obj_shape("box", write_mesh(files, "box.obj", cube_mesh()), true, 0.6,
                                  {0.3, 0.5, 0}, area_light("glow", "1")),
                        {0, 0, 0});
  const Scene scene = scene_of_text(with_shutter(parts, 0, 1));
  Image target(6, 6, 3);
  for (float& x : target.data) x = 0.5f;
  FitOptions options = options_of({"box.velocity.x", "box.vertex_positions"}, 0.02, 1);
  options.optimiser = OptimiserKind::kGradientDescent;
  options.step = 10;
  options.smoothing = 0;
  const RunSettings settings = settings_of(4, 3);
  RunSettings own = settings;
  own.seed = mix_bits(mix_bits(mix_bits(settings.seed)));
  const Image adjoint = image_loss(scene, target, {}, own, {}).adjoint;
  // The same passes: which surfaces pairs take depends on all parameters of one.
  GradientOptions derived;
  derived.method = Method("blurred");
  derived.blur = options.blur;
  derived.parameters = {"box.velocity.x"};
  const std::vector<Vec3f> before(scene.shapes[0].mesh.positions);
  ASSERT_EQ(before.size(), 8u);
  for (size_t k = 0; k < 3 * before.size(); ++k) {
    derived.parameters.push_back(fmt::format("box.vertex_positions.{}.{}", k / 3, "xyz"[k % 3]));
  }
  std::vector<double> steps;
  for (const ParameterGradient& g : limn::gradient(scene, derived, own).parameters) {
    const auto& name = steps.empty() ? g.name : options.parameters[1];
    const double unit = find_parameter_or_array(scene, name).natural_step;
    double slope = 0;
    for (size_t i = 0; i < adjoint.data.size(); ++i) {
      slope += g.total.mean(i) * static_cast<double>(adjoint.data[i]);
    }
    steps.push_back(-options.step * unit * unit * slope);
  }
  Fit fit({{scene, target, {}}}, options, settings);
  const FitRecord record = fit.step().value();
  const Mesh& after = fit.views()[0].scene.shapes[0].mesh;
  EXPECT_NE(steps[0], 0);
  EXPECT_NEAR(record.values[0], steps[0], 1e-9 * std::fabs(steps[0]));
  int moved = 0;
  for (size_t k = 0; k < 3 * before.size(); ++k) {
    const int axis = static_cast<int>(k % 3);
    const double now = static_cast<double>(after.positions[k / 3][axis]);
    const double then = static_cast<double>(before[k / 3][axis]);
    // Positions are floats.
    EXPECT_NEAR(now - then, steps[k + 1], 2e-7) << k;
    moved += now != then;
  }
  EXPECT_GT(moved, 12);
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

  SceneParts parts;
  parts.width = parts.height = 4;
  const auto refusal = [&](const std::string& bsdf, const std::string& parameter) -> std::string {
    parts.body = square("floor", 3, -90, {0, 0, 0}, bsdf) +
                 square("lamp", 0.3, 90, {0, 4, 0}, area_light("glow", "30"));
    const Scene of_text = scene_of_text(with_shutter(parts, 0, 1));
    try {
      Fit({{of_text, Image(4, 4, 3), {}}}, options_of({parameter}, 0.1, 3), settings_of(1, 0));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  const std::string checks =
      refusal(R"(<bsdf type="diffuse"><texture type="checkerboard" name="reflectance"/></bsdf>)",
              "glow.radiance");
  EXPECT_NE(checks.find("blurred faces do not support textures"), std::string::npos) << checks;
  parts.body = obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(3)), true, 1,
                         {0, 0, 0}, area_light("glow", "30"));
  try {
    Fit({{make_scene(files, parts), Image(4, 4, 3), {}}},
        options_of({"ball.vertex_positions"}, 0.1, 3), settings_of(1, 0));
    FAIL();
  } catch (const InputError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("is an array of 1926 numbers: a fit that begins blurred takes at most"),
              std::string::npos)
        << text;
  }
}

}  // namespace
}  // namespace limn
