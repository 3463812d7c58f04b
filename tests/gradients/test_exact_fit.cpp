// Fits of functions without noise: BFGS and its line search on functions with known minima, reverse
// mode of light in closed form against differences of the loss, and what is refused.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "integrators/fit/quasi_newton.h"
#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/integrators/fit.h"
#include "limn/integrators/render.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

struct Function {
  double value;
  std::vector<double> gradient;
};

// Rosenbrock's valley in six dimensions; its minimum 0 is at (1, ..., 1).
Function rosenbrock(const std::vector<double>& x) {
  Function f{0, std::vector<double>(x.size())};
  for (size_t i = 0; i + 1 < x.size(); ++i) {
    const double a = x[i + 1] - x[i] * x[i], b = 1 - x[i];
    f.value += 100 * a * a + b * b;
    f.gradient[i] += -400 * a * x[i] - 2 * b;
    f.gradient[i + 1] += 200 * a;
  }
  return f;
}

std::vector<double> moved(std::vector<double> x, double t, const std::vector<double>& d) {
  for (size_t i = 0; i < x.size(); ++i) x[i] += t * d[i];
  return x;
}

TEST(QuasiNewton, FollowsAValleyToItsEnd) {
  std::vector<double> x{-1.2, 1, -1.2, 1, -1.2, 1};
  QuasiNewton newton;
  Function here = rosenbrock(x);
  int evaluations = 0, steps = 0;
  for (; here.value > 1e-20 && steps < 200; ++steps) {
    const std::vector<double> d = newton.direction(here.gradient);
    const LinePoint start{0, here.value, inner_product(here.gradient, d)};
    ASSERT_LT(start.slope, 0);
    const auto at = [&](double t) -> std::optional<LinePoint> {
      ++evaluations;
      const Function f = rosenbrock(moved(x, t, d));
      return LinePoint{t, f.value, inner_product(f.gradient, d)};
    };
    const double first = newton.empty() ? 1e-3 : 1;
    const auto found = wolfe_search(at, start, first);
    ASSERT_TRUE(found);
    // What the search promises.
    EXPECT_LE(found->value, start.value + 1e-4 * found->at * start.slope);
    EXPECT_LE(std::fabs(found->slope), 0.9 * std::fabs(start.slope));
    const std::vector<double> next = moved(x, found->at, d);
    const Function there = rosenbrock(next);
    std::vector<double> change = there.gradient;
    for (size_t i = 0; i < change.size(); ++i) change[i] -= here.gradient[i];
    newton.add(moved(next, -1, x), change);
    EXPECT_LE(newton.steps.size(), QuasiNewton::kMemory);
    x = next;
    here = there;
  }
  fmt::print("{} steps, {} evaluations, {:.2g}\n", steps, evaluations, here.value);
  EXPECT_LE(here.value, 1e-20);
  // Steepest descent takes thousands.
  EXPECT_LT(steps, 100);
  EXPECT_LT(evaluations, 2 * steps + 10);
  for (const double v : x) EXPECT_NEAR(v, 1, 1e-9);
}

// With as many pairs as dimensions a quadratic's inverse Hessian is known: the step ends in its
// minimum.
TEST(QuasiNewton, KnowsAQuadratic) {
  const std::vector<double> curvature{1, 10, 100};
  QuasiNewton newton;
  for (int i = 0; i < 3; ++i) {
    std::vector<double> step(3), change(3);
    step[i] = 0.3;
    change[i] = 0.3 * curvature[i];
    newton.add(step, change);
  }
  newton.add({1, 0, 0}, {-1, 0, 0});  // not convex: left out
  EXPECT_EQ(newton.steps.size(), 3u);
  const std::vector<double> d = newton.direction({1, 10, 100});
  for (const double x : d) EXPECT_NEAR(x, -1, 1e-12);
}

// Where nothing is beyond a wall, and where nothing is lower.
TEST(QuasiNewton, SearchesStopAtWalls) {
  const auto wall = [](double t) -> std::optional<LinePoint> {
    if (t > 0.1) return LinePoint{t, INFINITY, 0};
    return LinePoint{t, -t, -1};
  };
  const auto found = wolfe_search(wall, {0, 0, -1}, 1);
  ASSERT_TRUE(found);
  EXPECT_GT(found->at, 0.05);
  EXPECT_LE(found->at, 0.1);
  const auto rising = [](double t) -> std::optional<LinePoint> { return LinePoint{t, t, 1}; };
  EXPECT_FALSE(wolfe_search(rising, {0, 0, -1}, 1));
}

// A body out of view, a lamp, and the shadow on the floor; smooth: with interpolated normals in
// view, too.
Scene shadow_scene(const TempFiles& files, bool smooth, double shift = 0) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 2.5, 4};
  parts.target = {0, 0, 0.3};
  parts.film = R"(<rfilter type="box"/>)";
  const std::string mesh = write_mesh(files, "body.obj", torus_mesh(9, 5));
  const std::string hill = write_mesh(files, "hill.obj", icosphere_mesh(1));
  parts.body =
      square("floor", 3, -90, {0, 0, 0}, diffuse("grey", ".5, .6, .7")) +
      obj_shape("body", mesh, true, 0.5, {0.3 + shift, 3.2, 0.2}, diffuse("clay", ".6, .5, .4")) +
      (smooth ? obj_shape("hill", hill, false, 0.5, {0.1, 0, 0}, diffuse("red", ".8, .2, .1"))
              : std::string()) +
      square("lamp", 0.4, 90, {0.1, 5, 0}, area_light("glow", "16, 15, 14"));
  return make_scene(files, parts);
}

struct Loss {
  LossResult loss;
  BackwardResult gradient;
};

Loss loss_and_gradient(const Scene& scene, const Image& target,
                       const std::vector<std::string>& names) {
  RunSettings settings;
  settings.spp = 2;
  settings.seed = 4;
  settings.threads = 2;
  Loss result{
      image_loss(
          scene, target,
          {.kind = LossKind::kRelativeL2, .levels = 3, .method = "analytic", .same_samples = true},
          settings),
      {}};
  BackwardOptions options;
  options.parameters = names;
  options.terms = {"interior"};
  options.method = "analytic";
  options.uniform_pixels = true;
  options.batches = 1;
  result.gradient = backward(scene, result.loss.adjoint, options, settings);
  return result;
}

Image target_of(const Scene& scene) {
  RunSettings settings;
  settings.spp = 2;
  settings.seed = 9;
  return to_image(means(render(scene, settings, {.method = "analytic"}).radiance), scene.film);
}

// Central differences of the loss at two steps, extrapolated, against what reverse mode tells of
// every number. The body is seen by its shadow alone, and positions of film samples are held, so
// that the loss is a smooth function of where it is.
TEST(Analytic, ReverseModeIsTheDerivativeOfTheLoss) {
  const TempFiles files;
  const Image target = target_of(shadow_scene(files, true, 0.1));
  const Scene scene = shadow_scene(files, true);
  const std::vector<std::string> names = {
      "body.vertex_positions", "lamp.vertex_positions", "body.translate.x",
      "body.rotate.y",         "lamp.translate.y",      "glow.radiance",
      "grey.reflectance",      "body.displacement",     "body.displacement.2"};
  const Loss at = loss_and_gradient(scene, target, names);
  const auto value_at = [&](const Parameter& p, double h) {
    Scene other = deep_copy(scene);
    p.move(other, h);
    return loss_and_gradient(other, target, {"grey.reflectance"}).loss.value;
  };
  const auto magnitude_of = [&](const std::string& name) {
    const Moments& m = at.gradient.of(name).moments;
    double sum = 0;
    for (size_t i = 0; i < m.size(); ++i) sum += std::fabs(m.mean(i));
    return sum;
  };
  // Coordinates below 8 are rounded to floats by 2^-22 at most.
  const double rounding = 0x1p-22 * (magnitude_of(names[0]) + magnitude_of(names[1]));
  for (const std::string& name : names) {
    if (name == names[0] || name == names[1] || name == "body.displacement") continue;
    const Parameter p = find_parameter(scene, name);
    const auto difference = [&](double h) { return (value_at(p, h) - value_at(p, -h)) / (2 * h); };
    const double h = 0x1p-4 * p.natural_step;
    const double expected = (4 * difference(h) - difference(2 * h)) / 3;
    const Moments& m = at.gradient.of(name).moments;
    double found = 0;
    for (size_t i = 0; i < m.size(); ++i) found += m.mean(i);
    const bool moves = name.starts_with("body.") || name.starts_with("lamp.");
    const double error = moves ? rounding / h : 1e-8 * std::fabs(expected);
    fmt::print("{:20} {:12.8g} {:12.8g} +- {:.2g}\n", name, found, expected, error);
    EXPECT_NEAR(found, expected, error) << name;
  }
  // All displacements at once, each by its own amount.
  const Parameter array = find_parameter_or_array(scene, "body.displacement");
  const Moments& displaced = at.gradient.of(array.name).moments;
  const auto amount = [](size_t v) { return std::sin(1 + 3 * static_cast<double>(v)); };
  const auto displaced_by = [&](double h) {
    Scene other = deep_copy(scene);
    for (size_t v = 0; v < array.size; ++v) array.move(other, h * amount(v), v);
    return loss_and_gradient(other, target, {"grey.reflectance"}).loss.value;
  };
  const auto difference = [&](double h) { return (displaced_by(h) - displaced_by(-h)) / (2 * h); };
  const double h = 0x1p-4 * array.natural_step;
  double found = 0;
  ASSERT_EQ(displaced.size(), array.size);
  for (size_t v = 0; v < array.size; ++v) found += displaced.mean(v) * amount(v);
  EXPECT_NEAR(found, (4 * difference(h) - difference(2 * h)) / 3, rounding / h);
  // One velocity of the vertices: a translation.
  const Moments& v = at.gradient.of(names[0]).moments;
  double along = 0;
  for (size_t i = 0; i < v.size(); i += 3) along += v.mean(i);
  EXPECT_NEAR(along, at.gradient.of("body.translate.x").moments.mean(0),
              1e-12 * magnitude_of(names[0]));
}

// A body in view over its shadow.
Scene seen_scene(const TempFiles& files, double shift = 0) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 2.5, 4};
  parts.target = {0, 0.5, 0.3};
  parts.film = R"(<rfilter type="box"/>)";
  const std::string mesh = write_mesh(files, "seen.obj", torus_mesh(9, 5));
  parts.body =
      square("floor", 3, -90, {0, 0, 0}, diffuse("grey", ".5, .6, .7")) +
      obj_shape("body", mesh, true, 0.5, {0.3 + shift, 1.2, 0.2}, diffuse("clay", ".6, .5, .4")) +
      square("lamp", 0.4, 90, {0.1, 5, 0}, area_light("glow", "16, 15, 14"));
  return make_scene(files, parts);
}

Image faces_image(const Scene& scene) {
  return to_image(
      means(render(scene, {}, {.method = "analytic", .points = FilmPoints::kFaces}).radiance),
      scene.film);
}

// Over faces the loss is a function of what moves silhouettes in view, too. The camera's numbers
// are doubles, so that differences are clean; the adjoint is written as floats.
TEST(Analytic, OverFacesSilhouettesInViewAreInTheLoss) {
  const TempFiles files;
  const Image target = faces_image(seen_scene(files, 0.1));
  const Scene scene = seen_scene(files);
  const LossOptions images{.method = "analytic", .points = FilmPoints::kFaces};
  const LossResult at = image_loss(scene, target, images, {});
  EXPECT_EQ(at.error, 0);
  BackwardOptions options;
  options.method = "analytic";
  options.points = FilmPoints::kFaces;
  const BackwardResult d = backward(scene, at.adjoint, options, {});
  for (const char* name : {"sensor.translate.x", "sensor.translate.y", "sensor.rotate.z",
                           "sensor.fov", "clay.reflectance", "glow.radiance"}) {
    const Parameter p = find_parameter(scene, name);
    const auto loss_at = [&](double h) {
      return image_loss(p.moved(scene, h), target, images, {}).value;
    };
    const double h = 0x1p-14;
    const double expected = (loss_at(h) - loss_at(-h)) / (2 * h);
    const Moments& m = d.of(name).moments;
    double found = 0;
    for (size_t i = 0; i < m.size(); ++i) found += m.mean(i);
    fmt::print("{:20} {:14.9g} {:14.9g}\n", name, found, expected);
    EXPECT_NEAR(found, expected, 2e-6 * std::fabs(expected)) << name;
  }
}

// Nothing is to be warned of, and the truth, whose loss is 0, is found to the rounding of
// positions.
TEST(Fit, QuasiNewtonOverFacesFindsWhatIsInView) {
  const TempFiles files;
  FitOptions options;
  options.parameters = {"body.translate.x", "body.translate.z", "glow.radiance"};
  options.optimiser = OptimiserKind::kLbfgs;
  options.backward.method = "analytic";
  options.backward.points = FilmPoints::kFaces;
  options.step = 2;
  RunSettings settings;
  settings.threads = 2;
  Fit fit({{seen_scene(files, -0.15), faces_image(seen_scene(files)), {}}}, options, settings);
  EXPECT_TRUE(fit.warnings().empty());
  double first = 0, last = 0;
  for (int i = 0; i < 30; ++i) {
    const auto record = fit.step();
    ASSERT_TRUE(record);
    EXPECT_EQ(record->error, 0);
    if (i == 0) first = record->loss;
    if (i > 0) {
      EXPECT_LE(record->loss, last);
    }
    last = record->loss;
    if (record->at_rest) break;
  }
  const std::vector<FitScalar> found = fit.scalars();
  fmt::print("loss {:.3g} to {:.3g}, x {:.6f}, z {:.6f}, radiance {:.5f}\n", first, last,
             found[0].value, found[1].value, found[2].value);
  EXPECT_LT(last, 1e-8 * first);
  EXPECT_NEAR(found[0].value, 0.15, 1e-4);
  EXPECT_NEAR(found[1].value, 0, 1e-4);
  EXPECT_NEAR(found[2].value, 16, 1e-2);
  options.backward.points = FilmPoints::kRandom;
  const Fit noisy({{seen_scene(files), faces_image(seen_scene(files)), {}}}, options, settings);
  EXPECT_FALSE(noisy.warnings().empty());
}

// A square whose sides lie on borders of pixels goes either way.
TEST(Fit, QuasiNewtonOverFacesLeavesBordersOfPixels) {
  const TempFiles files;
  const auto lamp_at = [&](double x, double y) {
    SceneParts parts;
    parts.max_depth = 1;
    parts.origin = {0, 0, 8};
    parts.target = {0, 0, 0};
    parts.fov = 2 * std::atan(0.25) * 180 / kPi;
    parts.width = parts.height = 8;
    parts.film = R"(<rfilter type="box"/>)";
    parts.body = square("lamp", 1, 0, {x, y, 0}, area_light("glow", "3, 2, 1"));
    return make_scene(files, parts);
  };
  FitOptions options;
  options.parameters = {"lamp.translate.x", "lamp.translate.y"};
  options.optimiser = OptimiserKind::kLbfgs;
  options.backward.method = "analytic";
  options.backward.points = FilmPoints::kFaces;
  for (const double x : {0.3, -0.3}) {
    const double y = -0.7 * x;
    Fit fit({{lamp_at(0, 0), faces_image(lamp_at(x, y)), {}}}, options, {});
    for (int i = 0; i < 30; ++i) {
      const auto record = fit.step();
      ASSERT_TRUE(record);
      EXPECT_TRUE(i > 0 || !record->at_rest);
      if (record->at_rest) break;
    }
    EXPECT_NEAR(fit.scalars()[0].value, x, 1e-4);
    EXPECT_NEAR(fit.scalars()[1].value, y, 1e-4);
  }
}

FitView shadow_view(const TempFiles& files, double shift = -0.25) {
  const Scene truth = shadow_scene(files, false);
  return {shadow_scene(files, false, shift), target_of(truth), {}};
}

FitOptions exact_options() {
  FitOptions options;
  options.parameters = {"body.translate.x", "body.translate.z", "glow.radiance"};
  options.optimiser = OptimiserKind::kLbfgs;
  options.backward.method = "analytic";
  options.step = 5;
  return options;
}

// Every step goes down, and the end is below the truth's own loss, which is not zero: the target is
// of other samples. A state goes on with the same bits, on any number of threads.
TEST(Fit, QuasiNewtonStepsGoDown) {
  const TempFiles files;
  RunSettings settings;
  settings.spp = 1;
  settings.threads = 2;
  Fit fit({shadow_view(files)}, exact_options(), settings);
  settings.threads = 1;
  Fit other({shadow_view(files)}, exact_options(), settings);
  double first = 0, last = 0;
  int resumed = 0;
  for (int i = 0; i < 12; ++i) {
    if (i == 6) other.restore(fit.state());
    const auto record = fit.step();
    ASSERT_TRUE(record);
    if (i >= 6) {
      const auto again = other.step();
      ASSERT_TRUE(again);
      ++resumed;
      EXPECT_EQ(again->loss, record->loss);
      EXPECT_EQ(again->values, record->values);
    }
    if (i == 0) {
      first = record->loss;
    } else {
      EXPECT_LE(record->loss, last);
    }
    last = record->loss;
    if (record->at_rest) break;
  }
  EXPECT_GT(resumed, 0);
  const std::vector<FitScalar> found = fit.scalars();
  fmt::print("loss {:.3g} to {:.3g}, x {:.4f}, z {:.4f}, radiance {:.3f} {:.3f} {:.3f}\n", first,
             last, found[0].value, found[1].value, found[2].value, found[3].value, found[4].value);
  Fit truth({shadow_view(files, 0)}, exact_options(), settings);
  EXPECT_LT(last, truth.step()->loss);
  EXPECT_LT(last, first);
  // Of the distance at the start.
  EXPECT_NEAR(found[0].value, 0.25, 0.05 * 0.25);
}

TEST(Fit, QuasiNewtonRefusesNoise) {
  const TempFiles files;
  const FitView view = shadow_view(files);
  const auto refuses = [&](const FitOptions& options, const std::string& what) {
    try {
      const Fit fit({view}, options, RunSettings{});
      ADD_FAILURE() << what << " was taken";
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(what), std::string::npos) << error.what();
    }
  };
  FitOptions options = exact_options();
  options.backward.method = "forest";
  refuses(options, "method forest");
  options.backward.method = "adaptive";
  refuses(options, "take the method analytic");
  options = exact_options();
  for (const LossKind loss : {LossKind::kL1, LossKind::kL1Srgb, LossKind::kSmape}) {
    options.loss = loss;
    refuses(options, "smooth loss");
  }
  options = exact_options();
  options.spp_doubling = 4;
  refuses(options, "doubling");
  options = exact_options();
  options.step_half_life = 4;
  refuses(options, "half-life");
  options = exact_options();
  options.loss_spp = 4;
  refuses(options, "samples of the loss");
}

}  // namespace
}  // namespace limn
