// What fits keep and go back to: states of texels and vertices, bounds that hold numbers, steps
// that end before their time.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>

#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/core/rng.h"
#include "limn/integrators/fit.h"
#include "limn/integrators/parts.h"
#include "limn/integrators/render.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

Scene sky_scene(const TempFiles& files, const Image& map) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 3, 0.5};
  parts.target = {0, 0, 0};
  parts.width = parts.height = 4;
  write_exr(files.path("map.exr"), map, false, {});
  parts.body = square("floor", 50, -90, {0, 0, 0}, diffuse("grey", ".5, .25, 1")) +
               R"(<emitter type="envmap" id="sky"><string name="filename" value=")" +
               files.path("map.exr") + R"("/></emitter>)";
  return make_scene(files, parts);
}

Image random_map(uint64_t seed) {
  Image map(6, 5, 3);
  for (size_t i = 0; i < map.data.size(); ++i) {
    map.data[i] = static_cast<float>(0.2 + Rng(seed, i, 0).uniform());
  }
  return map;
}

// However many texels there are; and a map of one row takes fields of one.
TEST(Fit, OneTexelTellsSkiesApart) {
  const TempFiles files;
  Image map(256, 128, 3);
  for (float& x : map.data) x = 1;
  const std::string before = fingerprint(sky_scene(files, map));
  EXPECT_EQ(fingerprint(sky_scene(files, map)), before);
  for (const size_t texel : {64u * 256 + 7, 3u * 256 + 128, 100u * 256 + 200}) {
    Image other = map;
    other.data[3 * texel] = 1.5f;
    EXPECT_NE(fingerprint(sky_scene(files, other)), before) << texel;
  }
  Image row(6, 1, 3);
  for (size_t i = 0; i < row.data.size(); ++i) row.data[i] = 0.1f * static_cast<float>(i + 1);
  write_exr(files.path("row.exr"), row, false, {});
  Scene scene = sky_scene(files, row);
  find_parameter(scene, "sky.data:" + files.path("row.exr")).move(scene, 1);
  const std::vector<float> moved = scene.environment->texels().data;
  ASSERT_EQ(moved.size(), 2 * row.data.size());
  for (size_t i = 0; i < moved.size(); ++i) {
    EXPECT_FLOAT_EQ(moved[i], 2 * row.data[i % row.data.size()]);
  }
}

void expect_refused(const std::vector<FitView>& views, const FitOptions& options,
                    const std::string& what) {
  try {
    const Fit fit(views, options, {});
    ADD_FAILURE() << what << " was taken";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find(what), std::string::npos) << error.what();
  }
}

// A field and one texel have no values: the sky itself is what is kept.
TEST(Fit, StatesKeepTheSky) {
  const TempFiles files;
  const std::string field = files.path("field.exr");
  write_exr(field, random_map(2), false, {});
  const FitView view{sky_scene(files, random_map(1)), Image(4, 4, 3), {}};
  FitOptions options;
  options.parameters = {"sky.data:" + field, "sky.data.1.2.g"};
  options.step = 3;
  RunSettings settings;
  settings.spp = 4;
  settings.threads = 2;
  Fit fit({view}, options, settings), other({view}, options, settings);
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(fit.step());
  const auto sky = [](const Fit& f) { return f.views()[0].scene.environment->texels().data; };
  const FitState state = fit.state();
  FitState wrong = state;
  wrong.views[0].texels.pop_back();
  const std::vector<float> first = sky(other);
  EXPECT_THROW(other.restore(wrong), InputError);
  EXPECT_EQ(sky(other), first);
  other.restore(state);
  EXPECT_EQ(sky(other), sky(fit));
  EXPECT_NE(sky(other), first);
  const auto record = fit.step(), again = other.step();
  EXPECT_EQ(record->loss, again->loss);
  EXPECT_EQ(record->values, again->values);
  EXPECT_EQ(sky(other), sky(fit));

  options.parameters = {"sky.data", "sky.data:" + field};
  expect_refused({view}, options, "move the same texels");
  options.parameters = {"sky.data.1.2.g", "sky.data"};
  expect_refused({view}, options, "move the same texels");
  Scene scene = deep_copy(view.scene);
  EXPECT_THROW(find_parameter(scene, "sky.data.1.2.g").move(scene, 1e39), InputError);
  EXPECT_EQ(scene.environment->texels().data, first);
}

// A body out of view, a lamp, and the shadow on the floor.
Scene shadow_scene(const TempFiles& files, double x, double z = 0.2, bool many = false) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 2.5, 4};
  parts.target = {0, 0, 0.3};
  parts.film = R"(<rfilter type="box"/>)";
  const std::string mesh = write_mesh(files, "body.obj", torus_mesh(9, 5));
  const std::string grid = write_mesh(files, "lamp.obj", grid_mesh(8));
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("grey", ".5, .6, .7")) +
               obj_shape("body", mesh, false, 0.5, {x, 3.2, z}, diffuse("clay", ".6, .5, .4"));
  const std::string light = area_light("glow", "16, 15, 14");
  parts.body += many ? obj_shape("lamp", grid, false, 0.4, {0.1, 5, 0}, light)
                     : square("lamp", 0.4, 90, {0.1, 5, 0}, light);
  return make_scene(files, parts);
}

Image target_of(const Scene& scene) {
  RunSettings settings;
  settings.spp = 2;
  settings.seed = 9;
  return to_image(means(render(scene, settings, {.method = "analytic"}).radiance), scene.film);
}

FitOptions exact_options(const std::vector<std::string>& parameters) {
  FitOptions options;
  options.parameters = parameters;
  options.optimiser = OptimiserKind::kLbfgs;
  options.backward.method = "analytic";
  options.step = 5;
  return options;
}

RunSettings quick() {
  RunSettings settings;
  settings.spp = 1;
  settings.threads = 2;
  return settings;
}

SharedVector<Vec3f> body_of(const Fit& fit, size_t view = 0) {
  for (const Shape& shape : fit.views()[view].scene.shapes) {
    if (shape.id == "body") return shape.mesh.positions;
  }
  return {};
}

// Held by its bound a number is as if it were not fitted: the others end where they do without it,
// and come near that with no more evaluations than it takes. Evaluations at the end itself are not
// counted: there the last bit of a loss decides how long a search goes on.
TEST(Fit, QuasiNewtonStopsAtBounds) {
  const TempFiles files;
  const Image target = target_of(shadow_scene(files, 0.3));
  FitOptions options = exact_options({"body.translate.x", "body.translate.z", "glow.radiance"});
  // The truth is at x 0.25; red begins at a bound, and is pulled past it.
  options.bounds = {{"body.translate.x", -1, 0.1}, {"glow.radiance", 0, 16}};
  Fit bounded({{shadow_scene(files, 0.05), target, {}}}, options, quick());
  options = exact_options({"body.translate.z", "glow.radiance"});
  options.bounds = {{"glow.radiance", 0, 16}};
  Fit without({{shadow_scene(files, 0.15), target, {}}}, options, quick());
  struct Descent {
    std::vector<double> losses;
    std::vector<int> evaluations;  // up to each loss
    int until(double loss) const {
      size_t i = 0;
      while (losses[i] > loss && i + 1 < losses.size()) ++i;
      return evaluations[i];
    }
  };
  const auto run = [](Fit& fit) {
    Descent descent;
    for (int i = 0, made = 0; i < 8; ++i) {
      const auto record = fit.step();
      EXPECT_LE(record->loss, i > 0 ? descent.losses.back() : INFINITY);
      descent.losses.push_back(record->loss);
      descent.evaluations.push_back(made += record->evaluations);
      if (record->at_rest) break;
    }
    return descent;
  };
  const Descent a = run(bounded), b = run(without);
  const double end = std::min(a.losses.back(), b.losses.back());
  const std::vector<FitScalar> found = bounded.scalars(), truth = without.scalars();
  EXPECT_EQ(found[0].value, 0.1);
  for (size_t i = 0; i < truth.size(); ++i) {
    fmt::print("{} {:.8g} {:.8g}\n", truth[i].name, found[i + 1].value, truth[i].value);
  }
  // Far below what the search has gained, and what the bound costs.
  constexpr double kNear = 1e-4;
  EXPECT_NEAR(a.losses.back(), b.losses.back(), kNear * end);
  const int with_bound = a.until((1 + kNear) * end), alone = b.until((1 + kNear) * end);
  fmt::print("evaluations {} and {}\n", with_bound, alone);
  EXPECT_LE(with_bound, 2 * alone);
}

// Vertices seen by their shadow from two sides: down at every step, to the same bits from a state,
// before and after new triangles.
TEST(Fit, QuasiNewtonMovesVertices) {
  const TempFiles files;
  FitOptions options = exact_options({"body.vertex_positions", "glow.radiance"});
  options.remesh = {3};
  options.step = 1;
  std::vector<FitView> views;
  for (int i = 0; i < 2; ++i) {
    const Image target = target_of(shadow_scene(files, 0.3, 0.2));
    views.push_back({shadow_scene(files, 0.1, 0.1), target, {}});
    for (FitView& view : views) view.scene.camera.origin.x.v += 0.1 * i;
  }
  Fit fit(views, options, quick());
  RunSettings settings = quick();
  settings.threads = 1;
  std::optional<Fit> other;
  double last = INFINITY;
  for (int i = 0; i < 6; ++i) {
    // Each time from a state, of the same mesh or another.
    other.emplace(views, options, settings);
    other->restore(fit.state());
    const auto record = fit.step(), again = other->step();
    ASSERT_TRUE(record && again);
    EXPECT_EQ(record->loss, again->loss);
    EXPECT_EQ(record->values, again->values);
    EXPECT_EQ(body_of(fit, 1), body_of(*other, 1));
    EXPECT_EQ(body_of(fit, 0), body_of(fit, 1));
    EXPECT_EQ(record->remeshed, i == 2);
    EXPECT_LT(record->loss, last) << i;
    last = record->remeshed ? INFINITY : record->loss;
  }
}

// Vertices stay on the normals that they had at the start, losses fall, and a state goes on with
// the same bits.
TEST(Fit, QuasiNewtonDisplacesVertices) {
  const TempFiles files;
  FitOptions options = exact_options({"body.displacement", "glow.radiance"});
  options.step = 1;
  const FitView view{shadow_scene(files, 0.1, 0.1), target_of(shadow_scene(files, 0.3, 0.2)), {}};
  const std::vector<Vec3d> along =
      find_parameter_or_array(view.scene, "body.displacement").directions(view.scene);
  Fit fit({view}, options, quick());
  const SharedVector<Vec3f> start = body_of(fit);
  std::optional<Fit> other;
  double last = INFINITY, moved = 0;
  for (int i = 0; i < 5; ++i) {
    other.emplace(std::vector<FitView>{view}, options, quick());
    other->restore(fit.state());
    const auto record = fit.step(), again = other->step();
    ASSERT_TRUE(record && again);
    EXPECT_EQ(record->loss, again->loss);
    EXPECT_EQ(body_of(fit), body_of(*other));
    EXPECT_LT(record->loss, last) << i;
    last = record->loss;
  }
  const SharedVector<Vec3f> now = body_of(fit);
  for (size_t v = 0; v < now.size(); ++v) {
    const Vec3d d = cast<double>(now[v]) - cast<double>(start[v]);
    // Coordinates below 4, each rounded to a float.
    EXPECT_LT(length(cross(d, along[v])), 0x1p-21) << v;
    moved = std::max(moved, length(d));
  }
  EXPECT_GT(moved, 0.01);

  options.remesh = {2};
  expect_refused({view}, options, "fit its vertex_positions");
  options.remesh.clear();
  options.parameters = {"body.displacement", "body.rotate.y"};
  expect_refused({view}, options, "move the same vertices");
}

// A fit turns a shape about one point, however its bounds change: the gradient of every step is
// about it, too, so that what was turned by so much is where one turn takes it.
TEST(Fit, TurnsAddUp) {
  const TempFiles files;
  const FitOptions options = exact_options({"body.rotate.z"});
  const Scene scene = shadow_scene(files, 0.1);
  const Parameter turn = find_parameter(scene, "body.rotate.z");
  Fit fit({{scene, target_of(turn.moved(scene, 0.7)), {}}}, options, quick());
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(fit.step());
  const double angle = fit.scalars()[0].value;
  EXPECT_GT(angle, 0.2);
  const Scene once = turn.moved(scene, angle);
  for (const Shape& shape : once.shapes) {
    if (shape.id != "body") continue;
    for (size_t v = 0; v < shape.mesh.positions.size(); ++v) {
      const Vec3d d = cast<double>(shape.mesh.positions[v]) - cast<double>(body_of(fit)[v]);
      // Coordinates below 8, rounded to floats at every step.
      EXPECT_LT(length(d), 0x1p-18) << v;
    }
  }
}

// Where an earlier fit left a shape smaller, less is left until it is a point.
TEST(Fit, ShapesAreNotScaledThroughAPointInStages) {
  const TempFiles files;
  Scene scene = shadow_scene(files, 0.1);
  for (const double size : {1.0, 0.5}) {
    const Parameter scale = find_parameter(scene, "body.scale");
    EXPECT_NEAR(scale.least, 0.01 - size, 1e-12);
    EXPECT_NEAR(scale.natural_step, 0.01 * size, 1e-12);
    if (size == 1) scale.move_checked(scene, -0.5);
    EXPECT_THROW(find_parameter(scene, "body.scale").move_checked(scene, -1.2), InputError);
  }
}

// Translated, turned and scaled in turns, a shape is where the sums of all steps take it at once;
// a state goes on with the same bits. A state of another mesh is none of this fit.
TEST(Fit, SumsOfStepsAreThePose) {
  const TempFiles files;
  const std::vector<std::string> names{"body.translate.x", "body.rotate.z", "body.scale"};
  const std::vector<double> truth{0.3, 0.4, 0.3};
  const Scene scene = shadow_scene(files, 0.1);
  Scene there = deep_copy(scene);
  for (const size_t i : {1, 2, 0}) find_parameter(scene, names[i]).move(there, truth[i]);
  const FitView view{scene, target_of(there), {}};
  for (const OptimiserKind optimiser : {OptimiserKind::kLbfgs, OptimiserKind::kAdam}) {
    FitOptions options = exact_options(names);
    options.optimiser = optimiser;
    Fit fit({view}, options, quick());
    std::optional<Fit> other;
    for (int i = 0; i < 6; ++i) {
      other.emplace(std::vector<FitView>{view}, options, quick());
      other->restore(fit.state());
      ASSERT_TRUE(fit.step() && other->step());
      EXPECT_EQ(body_of(fit), body_of(*other));
    }
    const std::vector<FitScalar> sums = fit.scalars();
    // The swing of a shape that is turned about where it was: beyond rounding.
    EXPECT_GT(std::fabs(sums[0].value * sums[1].value), 1e-3);
    EXPECT_GT(std::fabs(sums[2].value), 0.01);
    fmt::print("x {:.4f}, turned by {:.4f}, scaled by {:.4f}\n", sums[0].value, sums[1].value,
               sums[2].value);
    Scene once = deep_copy(scene);
    for (const size_t i : {1, 2, 0}) find_parameter(scene, names[i]).move(once, sums[i].value);
    const Fit expected({{once, view.target, {}}}, options, quick());
    const SharedVector<Vec3f> a = body_of(expected), b = body_of(fit);
    for (size_t v = 0; v < a.size(); ++v) {
      // Coordinates below 8, rounded to floats three times a step.
      EXPECT_LT(length(cast<double>(a[v]) - cast<double>(b[v])), 0x1p-17) << v;
    }
  }
}

// What is not fitted keeps its triangles, and displacements are of those of the start: a state with
// others is refused, and nothing is changed.
TEST(Fit, StatesOfOtherMeshesAreRefused) {
  const TempFiles files;
  const FitView view{shadow_scene(files, 0.1), target_of(shadow_scene(files, 0.3)), {}};
  for (const char* name : {"body.displacement", "body.rotate.y", "body.vertex_positions"}) {
    FitOptions options = exact_options({name});
    options.step = 1;
    Fit fit({view}, options, quick());
    const SharedVector<Vec3f> before = body_of(fit);
    FitState state = fit.state();
    ASSERT_EQ(state.views[0].shapes.size(), 1u);
    state.views[0].shapes[0].faces.pop_back();
    if (std::string_view(name) == "body.vertex_positions") {
      EXPECT_NO_THROW(fit.restore(state));
      continue;
    }
    EXPECT_THROW(fit.restore(state), InputError) << name;
    EXPECT_EQ(body_of(fit), before);
    EXPECT_TRUE(fit.step());
  }
}

// Of an interrupted search nothing is left, nor of one that fails: here a flat lamp would be bent
// into more planes than are known in closed form.
TEST(Fit, QuasiNewtonGoesBack) {
  const TempFiles files;
  const Image target = target_of(shadow_scene(files, 0.3));
  const FitOptions options = exact_options({"body.vertex_positions"});
  const FitView view{shadow_scene(files, 0.05), target, {}};
  Fit fit({view}, options, quick()), other({view}, options, quick());
  ASSERT_TRUE(fit.step() && other.step());
  const SharedVector<Vec3f> before = body_of(fit);
  // The next place is known: the first evaluation is of the search.
  std::atomic<bool> interrupted = false;
  int calls = 0;
  bool moved = false;
  fit.listen(
      [&](double) {
        ++calls;
        moved = moved || body_of(fit) != before;
        interrupted = true;
      },
      &interrupted);
  EXPECT_FALSE(fit.step());
  EXPECT_GT(calls, 0);
  EXPECT_TRUE(moved);
  EXPECT_TRUE(body_of(fit) == before);
  EXPECT_EQ(fit.steps(), 1);
  fit.listen(nullptr, nullptr);
  const auto record = fit.step(), again = other.step();
  EXPECT_EQ(record->loss, again->loss);
  EXPECT_EQ(body_of(fit), body_of(other));

  FitOptions bent = exact_options({"body.translate.x", "lamp.vertex_positions"});
  Fit failing({{shadow_scene(files, 0.05, 0.2, true), target, {}}}, bent, quick());
  const auto lamp = [&] { return failing.views()[0].scene.shapes.back().mesh.positions; };
  const SharedVector<Vec3f> flat = lamp();
  EXPECT_THROW(failing.step(), InputError);
  EXPECT_EQ(failing.steps(), 0);
  EXPECT_TRUE(lamp() == flat);
  EXPECT_EQ(failing.scalars()[0].value, 0);
}

// What the image does not know of rests at once, but for the new triangles that were asked for.
TEST(Fit, QuasiNewtonRemeshesBeforeItRests) {
  const TempFiles files;
  const Scene scene = shadow_scene(files, 40);
  FitOptions options = exact_options({"body.vertex_positions"});
  options.remesh = {4, 1};
  Fit fit({{scene, target_of(scene), {}}}, options, quick());
  for (const int64_t steps : {1, 4, 5}) {
    const auto record = fit.step();
    EXPECT_EQ(fit.steps(), steps);
    EXPECT_EQ(record->remeshed, steps < 5);
    EXPECT_EQ(record->at_rest, steps == 5);
  }
}

// Importances of the sky are kept from step to step, but not where a fit changes it.
TEST(Fit, AFitThatMovesTheSkyDrawsByTheNewOne) {
  const TempFiles files;
  SceneParts parts;
  parts.width = parts.height = 12;
  parts.origin = {0, 2, 4};
  Image map(8, 4, 3);
  for (size_t i = 0; i < map.data.size(); ++i) map.data[i] = 0.1f * static_cast<float>(i % 11);
  write_exr(files.path("map.exr"), map, false, {});
  const std::string mesh = write_mesh(files, "body.obj", icosphere_mesh(1));
  parts.body = obj_shape("body", mesh, false, 0.6, {0, 0.9, 0}, diffuse("clay", ".6, .5, .4")) +
               square("floor", 2.5, -90, {0, 0, 0}, diffuse("grey", ".5, .5, .5")) +
               R"(<emitter type="envmap" id="sky"><string name="filename" value=")" +
               files.path("map.exr") + R"("/></emitter>)";
  Image target(12, 12, 3);
  for (size_t i = 0; i < target.data.size(); ++i) target.data[i] = 0.1f * (i % 7);
  const std::vector<FitView> views{{make_scene(files, parts), target, {}}};
  RunSettings settings;
  settings.spp = 2;
  for (const char* sky : {"sky.data", "sky.scale"}) {
    FitOptions options;
    options.parameters = {"body.vertex_positions", sky};
    options.step = 20;
    Fit whole(views, options, settings), other(views, options, settings);
    ASSERT_TRUE(whole.step());
    other.restore(whole.state());
    ASSERT_TRUE(whole.step() && other.step());
    EXPECT_EQ(whole.state().views[0].shapes[0].positions,
              other.state().views[0].shapes[0].positions)
        << sky;
  }
}

}  // namespace
}  // namespace limn
