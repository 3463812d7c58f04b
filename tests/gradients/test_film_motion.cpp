// Positions on the film that move: whatever they do, the mean stays; and where detail slides, they
// take out most of the variance.
#include <gtest/gtest.h>

#include "integrators/estimates/batches.h"
#include "integrators/pilot/film_fit.h"
#include "integrators/pilot/film_flow.h"
#include "integrators/pilot/pilot.h"
#include "integrators/pilot/term_estimator.h"
#include "limn/edgetree/edge_sampler_types.h"
#include "support/meshes.h"
#include "support/running_mean.h"
#include "support/same_mean.h"
#include "support/scenes.h"

namespace limn {
namespace {

const char* const kFilters[] = {R"(<rfilter type="box"/>)",
                                R"(<rfilter type="tent"/>)",
                                R"(<rfilter type="gaussian"/>)",
                                R"(<rfilter type="gaussian"/><boolean name="sample_border"
                                   value="true"/>)",
                                R"(<rfilter type="mitchell"/>)",
                                R"(<rfilter type="catmullrom"/><boolean name="sample_border"
                                   value="true"/>)"};

// Edges on the film, of sharp and of soft shadows, in gloss; more at rest than move.
std::string ball_and_screens(const TempFiles& files) {
  return square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.3)) +
         square("wall", 2, 0, {0, 1, -1.5}, diffuse("plaster", "0.7, 0.7, 0.7")) +
         square("screen", 0.3, 20, {-0.8, 0.9, -0.3}, diffuse("soot", "0.1, 0.1, 0.1")) +
         obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), true, 0.4,
                   {0.4, 0.8, 0.2}, diffuse("clay", "0.7, 0.5, 0.3")) +
         square("lamp", 0.2, 90, {0.3, 2.4, 0.5}, area_light("glow", "30, 25, 20")) +
         R"(<emitter type="point" id="bulb"><point name="position" value="-1.5,3.2,1.6"/>
            <rgb name="intensity" value="5,5,5"/></emitter>)" +
         make_sky(files, "sky");
}

// Edges seen in a mirror, by the camera and by the floor, and through a mask.
std::string before_a_mirror(const TempFiles& files) {
  const std::string half = R"(<bsdf type="mask"><float name="opacity" value="0.5"/>)" +
                           diffuse("soot", "0.1, 0.1, 0.1") + "</bsdf>";
  return square("floor", 2.5, -90, {0, 0, 0}, diffuse("stone", "0.7, 0.7, 0.7")) +
         square("mirror", 2, 0, {0, 1, -1.5}, R"(<bsdf type="conductor"/>)") +
         square("screen", 0.3, 20, {-0.8, 0.9, -0.3}, half) +
         obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), true, 0.4,
                   {0.4, 0.8, 0.2}, diffuse("clay", "0.7, 0.5, 0.3")) +
         square("lamp", 0.2, 90, {0.3, 2.4, 0.5}, area_light("glow", "30, 25, 20")) +
         make_sky(files, "sky");
}

Scene scene_with(const TempFiles& files, const std::string& film, int size, bool mirror = false) {
  SceneParts parts;
  parts.film = film;
  parts.width = parts.height = size;
  parts.body = mirror ? before_a_mirror(files) : ball_and_screens(files);
  return make_scene(files, parts);
}

// Nothing moves but positions on the film, by the same everywhere: what all terms add, `filter`
// against the others, has mean zero. Also where the film ends and cuts filters.
TEST(FilmMotion, TakesBackWhatItAdds) {
  const TempFiles files;
  for (const auto& [filter, mirror] : {std::pair{kFilters[0], false},
                                       {kFilters[1], false},
                                       {kFilters[2], false},
                                       {kFilters[3], false},
                                       {kFilters[4], false},
                                       {kFilters[5], false},
                                       {kFilters[1], true}}) {
    const Scene scene = scene_with(files, filter, 8, mirror);
    const EdgeSamplerType& sampler = edge_sampler_type("silhouettes");
    const auto terms = terms_of(scene, sampler, false, true);
    const Parameter parameter = find_parameter(scene, "ball.translate.y");
    TermEstimator estimator(scene, {&parameter, 1}, terms, std::vector<bool>(terms.size(), true),
                            sampler, 2, {.moved_film = true});
    SamplePlan plan;
    plan.grid = PlanGrid(scene.film, film_size(scene.film));
    FilmMotion motion;
    motion.x[1] = 1, motion.y[2] = 1;
    plan.film.assign(plan.grid.size(), motion);
    estimator.set_plan(plan);
    constexpr int kBatches = 100, kSamples = 16;
    const size_t size = film_size(scene.film);
    std::vector<Moments> sums, rims;
    for (int lane = 0; lane < 2; ++lane) sums.emplace_back(size), rims.emplace_back(size);
    std::vector<std::unique_ptr<SampleEstimator>> one;
    one.push_back(std::make_unique<FilmProbe>(estimator, plan.grid, kBatches * kSamples));
    const Stopwatch watch;
    RunSettings settings;
    ProgressCounter progress(settings, watch, kBatches);
    for (int b = 0; b < kBatches; ++b) {
      const auto found = run_batch(one, {11, kSamples * b, kSamples * (b + 1)}, 2, progress);
      ASSERT_EQ(found.size(), 1u);
      EXPECT_EQ(found[0].non_finite.count, 0u);
      for (int lane = 0; lane < 2; ++lane) {
        std::vector<double> sum(size);
        for (size_t slot = 0; slot < terms.size(); ++slot) {
          const auto& image = found[0].images[slot * 3 + 1 + lane];
          for (size_t i = 0; i < size; ++i) sum[i] += image[i];
          if (terms[slot]->name == std::string("filter")) rims[lane].add_batch(image, kSamples);
        }
        sums[lane].add_batch(sum, kSamples);
      }
    }
    for (int lane = 0; lane < 2; ++lane) {
      std::vector<double> z, of_rims;
      for (size_t i = 0; i < size; i += 3) {
        if ((i / 3 % 8 + i / 3 / 8) % 2 != 0) continue;  // not looked at
        z.push_back(sums[lane].mean(i) / std::sqrt(sums[lane].variance(i)));
        of_rims.push_back(rims[lane].mean(i) / std::sqrt(rims[lane].variance(i)));
      }
      const ZSummary summary = summarize(z);
      EXPECT_GE(summary.p_largest, 1e-5) << filter << lane << ": " << summary.largest;
      EXPECT_LE(std::fabs(summary.mean) * std::sqrt(static_cast<double>(summary.count)), 5)
          << filter << lane;
      // There is something to take back.
      EXPECT_LT(summarize(of_rims).p_largest, 1e-9) << filter << lane;
    }
  }
}

// z-scores of single pixels: errors that neighbours take back are seen.
void expect_same_pixels(const Scene& scene, const std::vector<std::string>& parameters,
                        const std::string& method, const std::string& other, int spp) {
  const GradientResult first = run_method(scene, parameters, method, spp, 1);
  const GradientResult second = run_method(scene, parameters, other, spp, 2);
  for (size_t k = 0; k < parameters.size(); ++k) {
    const Moments &a = first.parameters[k].total, &b = second.parameters[k].total;
    std::vector<double> z;
    double largest = 0;
    for (size_t i = 0; i < a.size(); ++i) largest = std::max(largest, a.variance(i));
    for (size_t i = 0; i < a.size(); i += 3) {
      const double error = std::sqrt(a.variance(i) + b.variance(i));
      // Far out in a filter few samples tell.
      if (error > 0.02 * std::sqrt(largest))
        z.push_back(normal_from_student((a.mean(i) - b.mean(i)) / error, a.degrees()));
    }
    const ZSummary summary = summarize(z);
    EXPECT_GE(summary.count, 6) << parameters[k];
    EXPECT_GE(summary.p_largest, 1e-6)
        << method << " " << other << " " << parameters[k] << ": " << summary.largest;
  }
}

TEST(FilmMotion, KeepsTheMean) {
  const TempFiles files;
  for (const char* filter : kFilters) {
    const Scene scene = scene_with(files, filter, 8);
    expect_same_mean(scene, {"ball.translate.x", "sensor.rotate.y"},
                     {"silhouettes:directions=random:film=moving"}, 128);
  }
}

// What vertices see by way of mirrors moves with no direction.
TEST(FilmMotion, HoldsDirectionsThatSeeMirrors) {
  const Scene scene =
      read_scene(LIMN_SOURCE_DIR "/scenes/closed_form/lamp_in_corner.xml", {}, nullptr);
  const std::string name = "floor.rotate.x";
  const GradientResult held = run_method(scene, {name}, "forest", 1 << 14, 1);
  const GradientResult asked =
      run_method(scene, {name}, "silhouettes:directions=random", 1 << 14, 2);
  const Moments &a = held.parameters[0].total, &b = asked.parameters[0].total;
  EXPECT_LT(std::fabs(a.mean(0) - b.mean(0)), 5 * std::sqrt(a.variance(0) + b.variance(0)));
}

// Where the camera sees edges by way of a mirror, positions move.
TEST(FilmMotion, KeepsTheMeanBeforeAMirror) {
  const TempFiles files;
  const Scene scene = scene_with(files, kFilters[1], 8, true);
  const std::string method = "silhouettes:directions=random:film=moving";
  expect_same_mean(scene, {"ball.translate.x", "sensor.rotate.y", "mirror.translate.z"}, {method},
                   1024);
  const auto moves = [&](const Scene& of) {
    double share = 0;
    for (const MethodSetting& setting :
         run_method(of, {"ball.translate.x"}, method, 4, 1).settings) {
      if (setting.name.starts_with("share of pixels")) share = std::get<double>(setting.value);
    }
    return share > 0;
  };
  EXPECT_TRUE(moves(scene));
  // A curved mirror shows edges that are not known.
  SceneParts parts;
  parts.body = before_a_mirror(files) +
               R"(<shape type="sphere"><float name="radius" value="0.4"/><bsdf type="conductor"/>
                  </shape>)";
  EXPECT_FALSE(moves(make_scene(files, parts)));
}

// Edges at rest right on pixels' borders, and on the film's, where filters end at once: rays see
// either side of them by rounding.
TEST(FilmMotion, RestsWhereFiltersEnd) {
  const TempFiles files;
  const double half_film = 6 * std::tan(20 * kPi / 180);
  struct Case {
    const char* filter;
    double half, x;
  };
  for (const Case& of : {Case{kFilters[0], 0.8, -0.8}, Case{kFilters[0], 0.8, 0.8},
                         Case{kFilters[0], half_film, 0}, Case{kFilters[2], half_film, 0}}) {
    SceneParts parts;
    parts.film = of.filter;
    parts.width = parts.height = 8;
    parts.origin = {0, 0, 6};
    parts.target = {0, 0, 0};
    parts.body = square("panel", of.half, 0, {of.x, 0, 0}, area_light("glow", "1, 1, 1")) +
                 square("bar", 0.4, 0, {0.7, -0.3, 1}, area_light("lit", "3, 2, 1")) +
                 constant_light("sky", "0.2, 0.3, 0.4");
    expect_same_pixels(make_scene(files, parts), {"bar.translate.x"},
                       "silhouettes:directions=random:film=moving", "forest", 2048);
  }
}

// Of a gaussian, in the corner of its support: edges on the film are met there again and again, so
// `filter` must meet them, too, or what they add looks certain.
TEST(FilmMotion, MeetsWhatIsFarOutInAFilter) {
  const TempFiles files;
  const double pixel = 12 * std::tan(20 * kPi / 180);  // where the panel is
  SceneParts parts;
  parts.film = kFilters[3];
  parts.width = parts.height = 1;
  parts.origin = {0, 0, 6};
  parts.target = {0, 0, 0};
  parts.body = square("panel", 0.15 * pixel, 0, {1.9 * pixel, 1.9 * pixel, 0},
                      area_light("glow", "1, 1, 1")) +
               square("unseen", 0.4, 0, {0, 0, 12}, diffuse("clay", "0.5, 0.5, 0.5"));
  const GradientResult result = run_method(make_scene(files, parts), {"unseen.translate.x"},
                                           "silhouettes:directions=random:film=moving", 1 << 15, 1);
  const Moments& total = result.parameters[0].total;
  ASSERT_GT(total.variance(0), 0);
  EXPECT_LT(
      std::fabs(normal_from_student(total.mean(0) / std::sqrt(total.variance(0)), total.degrees())),
      4);
}

// A fence of bars thinner than pixels, that slides before a floor.
std::string fence() {
  std::string body = square("floor", 4, -90, {0, 0, 0}, diffuse("stone", "0.7, 0.7, 0.7")) +
                     square("lamp", 0.6, 90, {0.5, 4, 1}, area_light("glow", "20, 18, 15"));
  return body;
}
Mesh bars(int count) {
  std::vector<Vec3f> positions;
  std::vector<FaceIndices> faces;
  for (int i = 0; i < count; ++i) {
    const float x = -2 + 4.0f * static_cast<float>(i) / static_cast<float>(count);
    const float w = 1.5f / static_cast<float>(count);
    for (const float y : {0.1f, 1.2f}) {
      positions.push_back({x, y, 0});
      positions.push_back({x + w, y, 0});
    }
    const auto first = static_cast<uint32_t>(4 * i);
    faces.push_back({first, first + 1, first + 3});
    faces.push_back({first, first + 3, first + 2});
  }
  return make_mesh(positions, faces);
}

Scene fence_scene(const TempFiles& files, int size) {
  SceneParts parts;
  parts.width = parts.height = size;
  parts.body = fence() + obj_shape("bars", write_mesh(files, "bars.obj", bars(60)), true, 1,
                                   {0, 0, 0.5}, diffuse("wood", "0.3, 0.2, 0.1"));
  return make_scene(files, parts);
}

double share_that_moves(const GradientResult& result) {
  double share = 0;
  for (const MethodSetting& setting : result.settings) {
    if (setting.name == "share of pixels with reparameterised film samples")
      share = std::get<double>(setting.value);
  }
  return share;
}

// Of four samples or eight, alike; longer where the camera or much detail moves.
TEST(FilmMotion, IsLookedForWhereThereIsTime) {
  for (const int spp : {4, 8}) {
    const double limit = 2.8, each = limit / 112 / 1.01;  // a 28th for four samples
    EXPECT_TRUE(is_time_for_film({spp, spp * each, limit}, false, 0)) << spp;
    EXPECT_FALSE(is_time_for_film({spp, spp * each * 1.03, limit}, false, 0)) << spp;
  }
  EXPECT_TRUE(is_time_for_film({4, 0.46, 2.8}, true, 0));
  EXPECT_FALSE(is_time_for_film({4, 0.47, 2.8}, true, 0));
  EXPECT_FALSE(is_time_for_film({4, 0.46, 2.8}, false, 1));
  EXPECT_TRUE(is_time_for_film({4, 0.46, 2.8}, false, 3));
  // What pays does not depend on the limit's unit.
  EXPECT_TRUE(is_time_for_film({4, 46, 280}, true, 0));
}

TEST(FilmMotion, TakesOutDetailThatSlides) {
  const TempFiles files;
  const Scene scene = fence_scene(files, 24);
  const auto variance_times_rays = [&](const std::string& method) {
    const GradientResult result = run_method(scene, {"bars.translate.x"}, method, 64, 3);
    EXPECT_EQ(share_that_moves(result) > 0.5, method == "adaptive:generator=independent");
    uint64_t rays = 0;
    for (const auto& term : result.terms) rays += term.cost.rays;
    const Moments& total = result.parameters[0].total;
    double sum = 0;
    for (size_t i = 0; i < total.size(); ++i) sum += total.variance(i);
    return sum * static_cast<double>(rays);
  };
  EXPECT_LT(2 * variance_times_rays("adaptive:generator=independent"),
            variance_times_rays("adaptive:film=fixed:generator=independent"));
}

// Detail at rest, before which a plain square slides: the pilots look, and leave nothing behind.
TEST(FilmMotion, IsHeldWhereItDoesNotPay) {
  const TempFiles files;
  SceneParts parts;
  parts.width = parts.height = 12;
  parts.body = fence() +
               obj_shape("bars", write_mesh(files, "bars.obj", bars(60)), true, 1, {0, 0, 0.5},
                         diffuse("wood", "0.3, 0.2, 0.1")) +
               square("plate", 0.4, 0, {0, 0.8, 0.8}, diffuse("tin", "0.5, 0.5, 0.5"));
  const Scene scene = make_scene(files, parts);
  const GradientResult chosen =
      run_method(scene, {"plate.translate.x"}, "adaptive:generator=independent", 64, 3);
  const GradientResult held =
      run_method(scene, {"plate.translate.x"}, "adaptive:film=fixed:generator=independent", 64, 3);
  EXPECT_EQ(share_that_moves(chosen), 0);
  expect_same_bits(chosen, held);
}

// A card that half the light passes, beside a floor, and the sky behind them.
Scene card_scene(const TempFiles& files, int size) {
  SceneParts parts;
  parts.width = parts.height = size;
  parts.origin = {0, 0, 6};
  parts.target = {0, 0, 0};
  const std::string checks = R"(<bsdf type="diffuse"><texture type="checkerboard"
      name="reflectance"><float name="color0" value="0.1"/><float name="color1" value="0.9"/>
      <transform name="to_uv"><scale x="40" y="40"/></transform></texture></bsdf>)";
  parts.body = square("card", 1, 0, {0.6, 0, 0}, R"(<bsdf type="mask">)" + checks + "</bsdf>") +
               square("board", 3, 0, {0, 0, -2}, checks) + constant_light("sky", "0.2, 0.3, 0.4");
  return make_scene(files, parts);
}

std::unique_ptr<TermEstimator> estimator_of(const Scene& scene, const std::string& name) {
  const EdgeSamplerType& sampler = edge_sampler_type("silhouettes");
  const auto terms = terms_of(scene, sampler, false, true);
  const Parameter parameter = find_parameter(scene, name);
  return std::make_unique<TermEstimator>(scene, std::span(&parameter, 1), terms,
                                         std::vector<bool>(terms.size(), true), sampler, 1,
                                         TermExtras{.moved_film = true});
}

// Surfaces that face the camera move alike everywhere on the film; the mean is that of what is seen
// behind a card that is half transparent, too.
TEST(FilmFlow, IsTheMotionOfWhatIsSeen) {
  const TempFiles files;
  const Scene scene = card_scene(files, 8);
  const PlanGrid grid(scene.film, film_size(scene.film));
  const double size = 8 / (2 * std::tan(20 * kPi / 180));  // at distance 1 [pixels]
  const bool to_right = scene.camera.project(Vec3d{1, 0, 0}).x > 4;
  const double pixels = to_right ? size : -size;
  const auto expect = [&](const std::string& parameter, double card, double board) {
    const FilmFlows flows = film_flows(*estimator_of(scene, parameter), grid, 2);
    const auto at = [&](double x) {  // of the axis at this place of the card
      const auto p = scene.camera.project(Vec3d{x, 0.05, 0});
      return grid.index(static_cast<int>(p.x), static_cast<int>(p.y));
    };
    EXPECT_NEAR(flows[0][at(0.6)].x[0], 0.5 * (card + board), 1e-5) << parameter;
    EXPECT_NEAR(flows[1][at(0.6)].x[0], card, 1e-5) << parameter;
    for (const auto& flow : flows) {
      EXPECT_NEAR(flow[at(-1.5)].x[0], board, 1e-5) << parameter;
      EXPECT_NEAR(flow[at(0.6)].y[0], 0, 1e-6) << parameter;
    }
  };
  expect("card.translate.x", pixels / 6, 0);
  expect("board.translate.x", 0, pixels / 8);
  expect("sensor.translate.x", -pixels / 6, -pixels / 8);
}

// Where light passes a card at the far plane, rounding may put the rest of a ray beyond its end.
TEST(FilmFlow, PassesWhatLiesAtTheFarPlane) {
  const TempFiles files;
  Scene scene = card_scene(files, 24);
  for (const double depth : {6.0, std::nextafter(6.0, 0.0)}) {
    scene.camera.far_clip = depth;
    const PlanGrid grid(scene.film, film_size(scene.film));
    EXPECT_NO_THROW(film_flows(*estimator_of(scene, "card.translate.x"), grid, 1)) << depth;
  }
}

TEST(FilmFlow, TellsWhereTexturesMove) {
  const TempFiles files;
  const Scene scene = card_scene(files, 8);
  EXPECT_TRUE(moves_textures(estimator_of(scene, "board.translate.x")->scene()));
  EXPECT_FALSE(moves_textures(estimator_of(scene, "sensor.translate.x")->scene()));
  SceneParts parts;
  parts.body =
      square("lamp", 1, 0, {0, 0, 0},
             R"(<emitter type="area"><texture type="checkerboard" name="radiance"/></emitter>)");
  EXPECT_TRUE(moves_textures(estimator_of(make_scene(files, parts), "lamp.translate.x")->scene()));
  const Scene plain = scene_with(files, kFilters[0], 8);
  EXPECT_FALSE(moves_textures(estimator_of(plain, "ball.translate.x")->scene()));
}

// A finer grid leaves every pixel what it had; one whose cells are no parts of the others takes the
// plan of a cell's first pixel.
TEST(FilmFlow, RefinesPlans) {
  const TempFiles files;
  const Scene scene = card_scene(files, 24);
  const auto grid_of = [&](int cell) {
    PlanGrid grid;
    grid.x0 = scene.film.crop_x;
    grid.y0 = scene.film.crop_y;
    grid.cell = cell;
    grid.columns = grid.rows = (24 + cell - 1) / cell;
    return grid;
  };
  for (const int cell : {2, 3}) {
    SamplePlan plan;
    plan.grid = grid_of(4);
    plan.counts.resize(plan.grid.size());
    for (size_t c = 0; c < plan.grid.size(); ++c) {
      plan.counts[c][1] = static_cast<float>(c + 1);
    }
    SamplePlan finer = plan;
    refine(finer, grid_of(cell));
    EXPECT_TRUE(finer.fields.empty());
    ASSERT_EQ(finer.counts.size(), grid_of(cell).size());
    for (int y = 0; y < 24; ++y) {
      for (int x = 0; x < 24; ++x) {
        const int first_x = x - x % cell, first_y = y - y % cell;
        const auto& grid = finer.grid;
        EXPECT_EQ(finer.counts[grid.index(x + grid.x0, y + grid.y0)],
                  plan.counts[plan.grid.index(first_x + grid.x0, first_y + grid.y0)])
            << cell << ", " << x << ", " << y;
      }
    }
  }
}

// Texture finer than a pixel slides: samples of few pixels find which motion follows it, and each
// pixel has its own.
TEST(FilmFlow, IsChosenWhereItFits) {
  const TempFiles files;
  const Scene scene = card_scene(files, 24);
  const auto estimator = estimator_of(scene, "board.translate.x");
  const Stopwatch watch;
  RunSettings settings;
  settings.spp = 64;
  SamplePlan plan;
  const FilmFit fit = fit_film(*estimator, plan, {8, 1e9, 1, 144}, settings, watch);
  ASSERT_FALSE(fit.motion.empty());
  EXPECT_EQ(fit.grid.size(), film_size(scene.film) / 3);
  const FilmFlows flows = film_flows(*estimator, fit.grid, 1);
  int follows = 0;
  for (size_t cell = 0; cell < fit.grid.size(); ++cell) {
    for (const auto& flow : flows) {
      if (flow[cell].x[0] != 0 && fit.motion[cell].x[0] == flow[cell].x[0]) {
        ++follows;
        break;
      }
    }
  }
  EXPECT_GT(follows, static_cast<int>(fit.grid.size()) / 2);
}

// Edges at rest are listed while positions move, and then forgotten.
TEST(FilmMotion, LeavesNothingBehind) {
  const TempFiles files;
  const Scene scene = scene_with(files, kFilters[1], 6);
  const EdgeSamplerType& sampler = edge_sampler_type("silhouettes");
  const auto terms = terms_of(scene, sampler, false, true);
  const Parameter parameter = find_parameter(scene, "ball.translate.y");
  SamplePlan held;
  held.grid = PlanGrid(scene.film, film_size(scene.film));
  SamplePlan moving = held;
  FilmMotion motion;
  motion.x[0] = 1;
  moving.film.assign(moving.grid.size(), motion);
  const auto images = [&](const std::vector<SamplePlan>& plans) {
    auto estimator = std::make_unique<TermEstimator>(scene, std::span(&parameter, 1), terms,
                                                     std::vector<bool>(terms.size(), true), sampler,
                                                     1, TermExtras{.moved_film = true});
    for (const SamplePlan& plan : plans) estimator->set_plan(plan);
    std::vector<std::unique_ptr<SampleEstimator>> one;
    one.push_back(std::move(estimator));
    const Stopwatch watch;
    RunSettings settings;
    ProgressCounter progress(settings, watch, 1);
    return run_batch(one, {11, 0, 4}, 1, progress).at(0).images;
  };
  EXPECT_EQ(images({held, moving, held}), images({held}));
  EXPECT_NE(images({moving}), images({held}));
}

// A pilot that goes on: as many degrees of freedom as samples of a half, less one, in either part.
TEST(Pilot, MergesFiguresOfMoreSamples) {
  const TempFiles files;
  const Scene scene = scene_with(files, kFilters[1], 6);
  const EdgeSamplerType& sampler = edge_sampler_type("silhouettes");
  const auto terms = terms_of(scene, sampler);
  const Parameter parameter = find_parameter(scene, "ball.translate.y");
  const TermEstimator estimator(scene, {&parameter, 1}, terms,
                                std::vector<bool>(terms.size(), true), sampler, 2);
  const Stopwatch watch;
  const RunSettings settings;
  const auto run = [&](int first, int last) {
    return run_pilot(estimator, false, {first, last}, settings, watch);
  };
  const PilotFigures few = run(0, 8), more = run(8, 24), all = run(0, 24);
  PilotFigures merged = few;
  merged.merge(more);
  EXPECT_EQ(merged.spp, 24);
  for (size_t slot = 0; slot < terms.size(); ++slot) {
    // On the film samples are spread batch by batch.
    if (!few.film_variance[slot][0]) {
      EXPECT_NEAR(merged.work[slot], all.work[slot], 1e-9 * all.work[slot]) << slot;
    }
    if (!merged.in_cells(slot)) {
      const double a = few.film_variance[slot][0], b = more.film_variance[slot][0];
      EXPECT_NEAR(merged.film_variance[slot][0], (8 * a + 16 * b) / 24, 1e-9 * (a + b));
      continue;
    }
    const auto a = few.variances(slot, 0), b = more.variances(slot, 0);
    const auto sum = merged.variances(slot, 0);
    for (size_t cell = 0; cell < sum.size(); ++cell)
      EXPECT_NEAR(sum[cell], (3 * a[cell] + 7 * b[cell]) / 10, 1e-5 * (a[cell] + b[cell]));
  }
}

// On the film a batch of many samples is stratified, and leaves less than as many of one.
TEST(Pilot, FindsTheVarianceOfSingleSamplesOnTheFilm) {
  const TempFiles files;
  SceneParts parts;
  parts.width = parts.height = 8;
  parts.body = square("screen", 0.6, 20, {0.1, 0.9, 0}, diffuse("soot", "0.1, 0.1, 0.1")) +
               make_sky(files, "sky");
  const Scene scene = make_scene(files, parts);
  const EdgeSamplerType& sampler = edge_sampler_type("silhouettes");
  const auto terms = terms_of(scene, sampler);
  const Parameter parameter = find_parameter(scene, "screen.translate.x");
  std::vector<std::unique_ptr<SampleEstimator>> one;
  one.push_back(std::make_unique<TermEstimator>(scene, std::span(&parameter, 1), terms,
                                                std::vector<bool>(terms.size(), true), sampler, 1));
  const auto& estimator = static_cast<const TermEstimator&>(*one[0]);
  size_t camera = 0;
  while (std::string(terms.at(camera)->name) != "camera") ++camera;
  const Stopwatch watch;
  RunSettings settings;
  constexpr int kSamples = 16;
  RunningMean found, single;
  for (uint64_t seed = 1; seed <= 40; ++seed) {
    settings.seed = seed;
    const PilotFigures pilot = run_pilot(estimator, false, {0, kSamples}, settings, watch);
    found.add(pilot.film_variance[camera][0]);
    ProgressCounter progress(settings, watch, 1);
    Moments image(film_size(scene.film));
    for (int i = 0; i < kSamples; ++i)
      image.add_batch(run_batch(one, {100 + seed, i, i + 1}, 1, progress).at(0).images[camera], 1);
    double sum = 0;
    for (size_t i = 0; i < image.size(); ++i) sum += image.variance(i) * kSamples;
    single.add(sum * 3 / static_cast<double>(image.size()));
  }
  EXPECT_GT(single.mean(), 0);
  EXPECT_LT(std::fabs(found.mean() - single.mean()),
            4.5 * std::hypot(found.standard_error(), single.standard_error()));
}

// Three parameters are looked at two by two.
TEST(FilmMotion, HasTheMeanOfHeldPositions) {
  const TempFiles files;
  const Scene scene = fence_scene(files, 10);
  expect_same_pixels(scene, {"bars.translate.x"}, "adaptive",
                     "adaptive:film=fixed:generator=independent", 512);
  expect_same_pixels(scene, {"floor.translate.x", "bars.translate.y", "bars.translate.x"},
                     "adaptive", "adaptive:film=fixed:generator=independent", 512);
}

TEST(FilmMotion, HasTheSameBitsOnAnyNumberOfThreads) {
  const TempFiles files;
  const Scene scene = fence_scene(files, 16);
  for (const std::vector<std::string>& parameters :
       {std::vector<std::string>{"bars.translate.x"},
        std::vector<std::string>{"floor.translate.x", "bars.translate.y", "bars.translate.x"}}) {
    const int spp = parameters.size() == 1 ? 32 : 256;
    const GradientResult one = run_method(scene, parameters, "adaptive", spp, 5, 1);
    EXPECT_GT(share_that_moves(one), 0.3);
    expect_same_bits(one, run_method(scene, parameters, "adaptive", spp, 5, 3));
  }
}

}  // namespace
}  // namespace limn
