// Regions of light: the terms "direct", "penumbra" and "boundary" of `silhouettes` together are
// what "boundary" of `forest` is, block by block, whatever the lamps and whatever moves.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "integrators/lights/light_regions.h"
#include "integrators/terms/penumbra_lines.h"
#include "integrators/terms/term.h"
#include "limn/core/image.h"
#include "limn/integrators/statistics.h"
#include "support/block_runs.h"
#include "support/check_runs.h"
#include "support/meshes.h"
#include "support/running_mean.h"
#include "support/scenes.h"

namespace limn {
namespace {

GradientResult run(const Scene& scene, const std::string& method,
                   const std::vector<std::string>& parameters, int spp, uint64_t seed,
                   int threads = 1) {
  GradientOptions options;
  options.parameters = parameters;
  options.method = method;
  options.terms = {"boundary"};
  if (method == "silhouettes") {
    options.terms.emplace_back("direct");
    options.terms.emplace_back("penumbra");
  }
  return run_blocks(scene, options, spp, seed, threads);
}

// A body above a floor, with whatever shines.
Scene lit_scene(const TempFiles& files, const std::string& lights,
                const std::string& floor = diffuse("chalk", "0.8, 0.7, 0.6"), double unit = 1) {
  SceneParts parts;
  parts.max_depth = 3;
  parts.unit = unit;
  parts.origin = {0.3, 3, 3.5};
  parts.target = {0, 0.3, 0};
  parts.body = square("floor", 2.5 * unit, -90, {0, 0, 0}, floor) +
               obj_shape("body", write_mesh(files, "body.obj", torus_mesh(10, 6)), true, 0.5 * unit,
                         Vec3d{0, 0.7, 0.1} * unit, diffuse("clay", "0.6, 0.5, 0.4")) +
               lights;
  return make_scene(files, parts);
}

std::string lamp(const TempFiles& files, const std::string& id, const Mesh& mesh, double scale,
                 const Vec3d& offset, const std::string& inner = "") {
  return obj_shape(id, write_mesh(files, id + ".obj", mesh), true, scale, offset,
                   inner + area_light(id + "_light", "9, 8, 6"));
}

Mesh hook_mesh() {
  return make_mesh({{0, 0, 0}, {0, 0, 2}, {1, 0, 2}, {1, 0, 1}, {2, 0, 1}, {2, 0, 0}},
                   {{0, 2, 1}, {0, 3, 2}, {0, 4, 3}, {0, 5, 4}});
}

std::string lights_of(const TempFiles& files, const std::string& name) {
  const std::string above =
      square("lamp", 0.5, 90, {0.4, 2.5, -0.3}, area_light("glow", "9, 8, 6"));
  const std::string twosided =
      R"(<bsdf type="twosided">)" + diffuse("white", "1, 1, 1") + "</bsdf>";
  if (name == "above") return above;
  // Turned upwards: from below it is black, and hides another.
  if (name == "away")
    return square("lamp", 0.3, -90, {0.4, 2.2, -0.3}, area_light("glow", "9, 8, 6")) +
           square("other", 0.5, 90, {0.4, 2.5, -0.3}, area_light("dim", "3, 4, 5"));
  // Upright, half of it below the floor: the horizon cuts it, and the body stands before it.
  // Penumbras are thin, and its sides are met together.
  if (name == "small")
    return square("lamp", 0.03, 70, {0.4, 2.5, -0.3}, area_light("glow", "2000, 900, 900"));
  if (name == "seed") return lamp(files, "lamp", icosphere_mesh(1), 0.04, {0.6, 1.8, 0.2});
  if (name == "cut") return square("lamp", 0.7, 0, {0, 0.2, -1.2}, area_light("glow", "9, 8, 6"));
  // Through the body, which crosses its plane.
  if (name == "crossed")
    return square("lamp", 0.4, 90, {0.3, 0.7, 0.1}, area_light("glow", "9, 8, 6"));
  // One hides a part of the other.
  if (name == "two")
    return above + square("near", 0.2, 90, {0.2, 1.6, 0}, area_light("dim", "3, 4, 5"));
  if (name == "hook") return lamp(files, "lamp", hook_mesh(), 0.4, {-0.3, 2, -0.2});
  if (name == "cube") return lamp(files, "lamp", cube_mesh(), 0.25, {0.6, 1.8, 0.2});
  if (name == "ball") return lamp(files, "lamp", icosphere_mesh(2), 0.3, {0.6, 1.8, 0.2});
  if (name == "ring") return lamp(files, "lamp", torus_mesh(12, 6), 0.4, {0.2, 1.9, 0.2});
  // It scatters, from both sides.
  if (name == "white")
    return square("lamp", 0.5, 90, {0.4, 2.5, -0.3}, twosided + area_light("glow", "9, 8, 6"));
  return above + make_sky(files, "sky");
}

struct Disc {
  Vec3d axis;
  double angle;  // [degrees]
  double radiance = 500;
};

// Discs in a dim sky; where they overlap, the last.
std::string sky_with(const TempFiles& files, const std::vector<Disc>& discs) {
  Image map(512, 256, 3);
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const double phi = 2 * kPi * (x + 0.5) / map.width, theta = kPi * y / (map.height - 1);
      const Vec3d w{std::sin(phi) * std::sin(theta), std::cos(theta),
                    -std::cos(phi) * std::sin(theta)};
      for (int c = 0; c < 3; ++c) map.at(x, y, c) = 0.2f + 0.1f * static_cast<float>(c);
      for (const auto& [axis, angle, radiance] : discs) {
        if (dot(w, normalize(axis)) < std::cos(angle * kPi / 180)) continue;
        for (int c = 0; c < 3; ++c) {
          map.at(x, y, c) = static_cast<float>(radiance * (1 - 0.1 * c));
        }
      }
    }
  }
  write_exr(files.path("suns.exr"), map, false, {});
  return R"(  <emitter type="envmap" id="sky"><string name="filename" value=")" +
         files.path("suns.exr") + "\"/></emitter>\n";
}

// A sun of 3 degrees, and a small one beside the zenith.
std::string two_suns(const TempFiles& files) {
  return sky_with(files, {{{0.5, 0.8, 0.4}, 3}, {{-0.2, 1, 0.1}, 1.5}});
}

// What glows around a sun is a region of its own, with a hole where the sun is.
TEST(Regions, AGlowIsOne) {
  const TempFiles files;
  const Vec3d axis{0.5, 0.8, 0.4};
  const Scene scene = lit_scene(files, sky_with(files, {{axis, 7, 300}, {axis, 2.5, 6000}}));
  ASSERT_EQ(LightRegions(scene).size(), 2u);
  const std::vector<std::string> parameters = {"body.translate.x", "floor.rotate.x",
                                               "body.rotate.z", "body.scale"};
  const GradientResult a = run(scene, "silhouettes", parameters, 256, 1);
  // `forest` meets the sun by rare draws that its own errors miss: they come from its seeds.
  constexpr int kSeeds = 32;
  constexpr double kLargest = 4.4;  // of Student's t with 31 degrees: |t| beyond with 1e-4
  std::vector<double> sums(parameters.size()), squares(parameters.size());
  for (int seed = 2; seed < 2 + kSeeds; ++seed) {
    const GradientResult b = run(scene, "forest", parameters, 64, seed);
    for (size_t k = 0; k < parameters.size(); ++k) {
      const double sum = b.parameters[k].image_sum.mean(0);
      sums[k] += sum;
      squares[k] += sum * sum;
    }
  }
  for (size_t k = 0; k < parameters.size(); ++k) {
    const Moments& image = a.parameters[k].image_sum;
    const double mean = sums[k] / kSeeds;
    const double variance = (squares[k] / kSeeds - mean * mean) / (kSeeds - 1);
    const double t = (image.mean(0) - mean) / std::sqrt(variance + image.variance(0));
    EXPECT_LT(std::fabs(t), kLargest) << fmt::format("{}: {} and {} +- {}", parameters[k],
                                                     image.mean(0), mean, std::sqrt(variance));
  }
}

// The object before the sun, and a lamp beside it.
TEST(Regions, TheSunIsOne) {
  const TempFiles files;
  for (const std::string& lamp : {std::string(), lights_of(files, "above")}) {
    const Scene scene = lit_scene(files, lamp + two_suns(files));
    EXPECT_EQ(LightRegions(scene).size(), lamp.empty() ? 2u : 3u);
    const std::vector<std::string> parameters = {"body.translate.x", "floor.rotate.x",
                                                 "body.rotate.z", "body.scale"};
    const GradientResult a = run(scene, "silhouettes", parameters, 256, 1);
    const GradientResult b = run(scene, "forest", parameters, 1024, 2);
    for (size_t k = 0; k < parameters.size(); ++k) expect_equal(a.parameters[k], b.parameters[k]);
  }
}

class Lamps : public testing::TestWithParam<std::string> {};

TEST_P(Lamps, AddUpToTheForest) {
  const TempFiles files;
  const Scene scene = lit_scene(files, lights_of(files, GetParam()));
  const std::vector<std::string> parameters = {"body.translate.x", "lamp.translate.y",
                                               "floor.rotate.x", "lamp.rotate.z"};
  const GradientResult a = run(scene, "silhouettes", parameters, 256, 1);
  const GradientResult b = run(scene, "forest", parameters, 1024, 2);
  for (size_t k = 0; k < parameters.size(); ++k) expect_equal(a.parameters[k], b.parameters[k]);
}

INSTANTIATE_TEST_SUITE_P(, Lamps,
                         testing::Values("above", "away", "cut", "crossed", "two", "hook", "cube",
                                         "ball", "ring", "white", "sky"),
                         [](const auto& test) { return test.param; });

TEST(Regions, OnGloss) {
  const TempFiles files;
  for (const double alpha : {0.05, 0.3}) {
    const Scene scene = lit_scene(files, lights_of(files, "sky"), conductor("gloss", alpha));
    const std::vector<std::string> parameters = {"body.translate.x", "lamp.translate.y"};
    const GradientResult a = run(scene, "silhouettes", parameters, 256, 1);
    const GradientResult b = run(scene, "forest", parameters, 1024, 2);
    for (size_t k = 0; k < parameters.size(); ++k) expect_equal(a.parameters[k], b.parameters[k]);
  }
}

// Close over the floor: shadows sharpen where they begin.
TEST(Regions, BesideContacts) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0.3, 3, 3.5};
  parts.target = {0, 0.3, 0};
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.7, 0.6")) +
               obj_shape("body", write_mesh(files, "body.obj", cube_mesh()), true, 0.4,
                         {0, 0.41, 0}, diffuse("clay", "0.6, 0.5, 0.4")) +
               lights_of(files, "above");
  const Scene scene = make_scene(files, parts);
  const std::vector<std::string> parameters = {"body.translate.x", "body.rotate.y"};
  const GradientResult a = run(scene, "silhouettes", parameters, 256, 1);
  const GradientResult b = run(scene, "forest", parameters, 4096, 2);
  for (size_t k = 0; k < parameters.size(); ++k) expect_equal(a.parameters[k], b.parameters[k]);
  EXPECT_GT(a.terms[a.term("penumbra")].cost.counted, 1000u);
}

// The body and its shadow, behind the camera, are seen in a wall alone: by the first vertices of
// paths.
TEST(Regions, SeenByVertices) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0, 0.8, 0.6};
  parts.target = {0, 0.8, -1};
  parts.fov = 50;
  parts.width = parts.height = 8;
  parts.body = square("wall", 2, 0, {0, 1, -1}, diffuse("paint", "0.9, 0.9, 0.9")) +
               square("floor", 2.5, -90, {0, 0, 1}, diffuse("chalk", "0.8, 0.7, 0.6")) +
               obj_shape("body", write_mesh(files, "body.obj", cube_mesh()), true, 0.35,
                         {0.1, 0.5, 1.6}, diffuse("clay", "0.1, 0.1, 0.1")) +
               square("lamp", 0.1, 90, {0.2, 2.2, 1.4}, area_light("glow", "300, 300, 300"));
  const Scene scene = make_scene(files, parts);
  const GradientResult a = run(scene, "silhouettes", {"body.translate.z"}, 2048, 1);
  const GradientResult b = run(scene, "forest", {"body.translate.z"}, 16384, 2);
  expect_equal(a.parameters[0], b.parameters[0]);
  // Nearly all of it is found from the lamp.
  const Moments& found = a.parameters[0].terms[a.term("penumbra")];
  double mean = 0;
  for (size_t i = 0; i < found.size(); ++i) mean += found.mean(i);
  EXPECT_GT(mean, 0.5 * a.parameters[0].image_sum.mean(0));
}

// Against finite differences, all terms. The penumbras of small lamps are too thin for `forest`.
TEST(Regions, AgreeWithDifferences) {
  const TempFiles files;
  const auto expect_right = [](const Scene& scene, const std::string& parameter, int spp) {
    const CheckResult result = run_check(scene, parameter, spp, {}, "silhouettes");
    EXPECT_NE(result.verdict, Verdict::kDisagree) << parameter;
  };
  const Scene two = lit_scene(files, lights_of(files, "two"));
  for (const char* name : {"body.translate.x", "lamp.translate.x", "near.rotate.x"}) {
    expect_right(two, name, 256);
  }
  const Scene small = lit_scene(files, lights_of(files, "small"));
  expect_right(small, "body.translate.x", 512);
  expect_right(small, "sensor.rotate.y", 512);
  expect_right(lit_scene(files, lights_of(files, "seed")), "body.translate.x", 512);
  const Scene gloss = lit_scene(files, lights_of(files, "small"), conductor("gloss", 0.3));
  expect_right(gloss, "body.translate.x", 512);
}

// Many emitters, of which a vertex chooses some: what moves before them, and one of them, and the
// camera. `forest` knows nothing of the choice, and seldom draws an edge of one small lamp.
TEST(Regions, ChosenAmongMany) {
  const TempFiles files;
  std::string lamps;
  for (int i = 0; i < 40; ++i) {
    lamps += square("lamp" + std::to_string(i), 0.12, 90,
                    {0.5 * (i % 8) - 2, 2.2 + 0.07 * (i % 5), 0.5 * (i / 8) - 1.2},
                    area_light("glow" + std::to_string(i), std::to_string(2 + i % 9) + ", 5, 3"));
  }
  const Scene scene = lit_scene(files, lamps);
  ASSERT_TRUE(LightRegions(scene).chooses());
  const std::vector<std::string> parameters = {"body.translate.x", "lamp3.translate.x",
                                               "sensor.rotate.y"};
  const GradientResult a = run(scene, "silhouettes", parameters, 128, 1);
  const GradientResult b = run(scene, "forest", parameters, 2048, 2);
  for (size_t k = 0; k < parameters.size(); ++k) expect_equal(a.parameters[k], b.parameters[k]);
}

// By brute force over the numbers that choose: each region is there as often as it is expected.
TEST(Regions, ChoicesHaveTheirExpectations) {
  const TempFiles files;
  for (const int count : {12, 40, 300}) {
    std::string lamps;
    for (int i = 0; i < count; ++i) {
      lamps += square("lamp" + std::to_string(i), 0.05, 90,
                      {0.3 * (i % 17) - 2, 2.2 + 0.07 * (i % 5), 0.3 * (i / 17) - 1.2},
                      area_light("glow" + std::to_string(i), "5, 5, 3"));
    }
    const Scene scene = lit_scene(files, lamps);
    const LightRegions regions(scene);
    EXPECT_EQ(regions.chooses(), count > 16);
    for (const Vec3d& p : {Vec3d{0.2, 0, 0.3}, Vec3d{1.5, 2.1, 1}}) {
      constexpr int kDraws = 8000;
      std::vector<double> sums(regions.size());
      std::vector<LightRegions::Choice> choices;
      for (int i = 0; i < kDraws; ++i) {
        regions.choose(p, (i + 0.5) / kDraws, choices);
        for (const auto& [region, expected, times] : choices) sums[region] += times / expected;
      }
      for (const double sum : sums) EXPECT_NEAR(sum / kDraws, 1, 0.05);
    }
  }
}

// Units of length drop out.
TEST(Regions, DoNotKnowTheUnit) {
  const std::vector<std::string> parameters = {"body.rotate.x"};
  const TempFiles one_files;
  const auto lights = [](double unit) {
    return square("lamp", 0.5 * unit, 90, Vec3d{0.4, 2.5, -0.3} * unit,
                  area_light("glow", "9, 8, 6"));
  };
  const std::string chalk = diffuse("chalk", "0.8, 0.7, 0.6");
  const GradientResult one =
      run(lit_scene(one_files, lights(1), chalk, 1), "silhouettes", parameters, 256, 1);
  for (const double unit : {1e-3, 1e3}) {
    const TempFiles files;
    const GradientResult other =
        run(lit_scene(files, lights(unit), chalk, unit), "silhouettes", parameters, 256, 2);
    expect_equal(one.parameters[0], other.parameters[0]);
  }
}

TEST(Regions, SameBitsOnAnyThreads) {
  const TempFiles files;
  const Scene scene = lit_scene(files, lights_of(files, "two"));
  const GradientResult a = run(scene, "silhouettes", {"body.translate.x"}, 8, 1, 1);
  const GradientResult b = run(scene, "silhouettes", {"body.translate.x"}, 8, 1, 3);
  for (size_t i = 0; i < a.parameters[0].total.size(); ++i)
    ASSERT_EQ(a.parameters[0].total.mean(i), b.parameters[0].total.mean(i));
}

// Without lamps there is no such term, and nothing changes.
TEST(Regions, NoneWithoutLamps) {
  const TempFiles files;
  const Scene scene = lit_scene(files, constant_light("sky", "1, 1, 1"));
  GradientOptions options;
  options.parameters = {"body.translate.x"};
  RunSettings settings;
  settings.spp = 4;
  options.method = "forest";
  const GradientResult a = gradient(scene, options, settings);
  options.method = "silhouettes";
  const GradientResult b = gradient(scene, options, settings);
  EXPECT_EQ(a.terms.size(), b.terms.size());
  for (size_t i = 0; i < a.parameters[0].total.size(); ++i)
    ASSERT_EQ(a.parameters[0].total.mean(i), b.parameters[0].total.mean(i));
}

// Lines of a small share go on by roulette: on average each counts by its share over its density.
TEST(Regions, SmallSharesStayWholeOnAverage) {
  const TempFiles files;
  Scene scene = lit_scene(files, lights_of(files, "above"));
  find_parameter(scene, "body.translate.x").seed(scene, 0);
  const auto tracer = make_embree_tracer(scene, 1);
  const Lights lights(scene);
  const PathContext context{scene, *tracer, lights};
  TermInput input(context, 1, {1, 1, 1, 1}, edge_sampler_type("silhouettes"), 1);
  const EmitterEdges* edges = input.emitter_edges();
  ASSERT_TRUE(edges);
  const PenumbraLines lines(context, input.edges(), *input.regions(), *edges);
  const PathStep step{value(scene.camera.origin), 0};
  Rng rng(41, 0, 0);
  RayCount rays;
  RunningMean ratios;  // of what a line counts to what it should
  int count = 0;
  for (int i = 0; i < 20000; ++i) {
    const auto drawn = lines.draw(rng.uniform(), rng, rays);
    if (!drawn) continue;
    const auto [density, share, scattered] = penumbra_share(lines.ways(), drawn->line, step, 0);
    if (!(share > 0.005 && share < 0.1)) continue;
    DrawnLine line = *drawn;
    const bool goes_on = lines.complete(line, step, 0, rng);
    const double counts = goes_on ? drawn->edge.probability / line.edge.probability : 0;
    ratios.add(counts / (share / density));
    ++count;
  }
  fmt::print("{} lines, {:.3g} times their share\n", count, ratios.mean());
  EXPECT_GT(count, 200);
  EXPECT_LT(std::fabs(ratios.z_score(1)), 4);
}

// A thin plate just above a floor: what the floor beside its edge loses is light of the plate's own
// lower side, from vertices so close to the edge that paths hardly meet them.
Scene plate_scene(const TempFiles& files) {
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0.3, 2, 3};
  parts.target = {0, 0, 0};
  parts.width = parts.height = 8;
  Mesh plate = cube_mesh();
  for (Vec3f& v : plate.positions) v = {v.x, 0.015f * v.y, 0.7f * v.z};
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.7, 0.6")) +
               obj_shape("plate", write_mesh(files, "plate.obj", plate), true, 0.6, {0, 0.0095, 0},
                         conductor("metal", 0.16)) +
               square("lamp", 0.14, 90, {-0.2, 2.7, -0.4}, area_light("glow", "60, 50, 40"));
  return make_scene(files, parts);
}

TEST(Regions, PlatesBesideFloorsHaveTrueErrors) {
  const TempFiles files;
  const Scene scene = plate_scene(files);
  constexpr int kRuns = 24;
  std::vector<double> sums, variances;
  RunningMean mean;
  for (int seed = 1; seed <= kRuns; ++seed) {
    const GradientResult result = run(scene, "silhouettes", {"plate.translate.z"}, 64, seed);
    const Moments& sum = result.parameters[0].image_sum;
    sums.push_back(sum.mean(0));
    variances.push_back(sum.variance(0));
    mean.add(sums.back());
  }
  double squares = 0;
  for (int i = 0; i < kRuns; ++i) squares += std::pow(sums[i] - mean.mean(), 2) / variances[i];
  fmt::print("mean {:.4g} +- {:.2g}: squares of {} z sum up to {:.3g}\n", mean.mean(),
             mean.standard_error(), kRuns, squares);
  EXPECT_GT(chi_square_p_value(squares, kRuns - 1), 1e-4);
}

// What lines are scattered to, each counted by one over its density on the film, adds up to the
// film's area.
TEST(Regions, ScatteredLinesFillTheFilm) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0, 6, 0.5};
  parts.target = {0, 0, 0};
  parts.fov = 14;
  parts.width = 4;
  parts.height = 3;
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.7, 0.6")) +
               square("wall", 0.3, 0, {0, 0.5, -1.2}, diffuse("clay", "0.5, 0.5, 0.5")) +
               square("lamp", 0.1, 90, {5.2, 4, 0.3}, area_light("glow", "300, 300, 300"));
  Scene scene = make_scene(files, parts);
  find_parameter(scene, "wall.translate.x").seed(scene, 0);
  const auto tracer = make_embree_tracer(scene, 1);
  const Lights lights(scene);
  const PathContext context{scene, *tracer, lights};
  TermInput input(context, 1, {1, 1, 1, 1}, edge_sampler_type("silhouettes"), 1);
  const EmitterEdges* edges = input.emitter_edges();
  ASSERT_TRUE(edges);
  const PenumbraLines lines(context, input.edges(), *input.regions(), *edges);
  const Vec3d p{0.1, 0.45, -1.2};
  Hit wall;
  ASSERT_TRUE(tracer->closest({p + Vec3d{0, 0, 1}, {0, 0, -1}}, wall));
  const DrawnLine drawn{{}, wall.face, {0, {}, {0, 1, 0}, p, {0, 0, 1}}};
  Rng rng(43, 0, 0);
  RayCount rays;
  RunningMean area;
  for (int i = 0; i < 1000000; ++i) {
    const double u_0 = rng.uniform(), u_1 = rng.uniform();
    const auto viewer = lines.scatter(drawn, u_0, u_1, {}, rays);
    double added = 0;
    if (viewer && viewer->seen.at.x >= 0 && viewer->seen.at.x < parts.width &&
        viewer->seen.at.y >= 0 && viewer->seen.at.y < parts.height) {
      const PathStep step{viewer->q, 1, viewer->face, value(scene.camera.origin)};
      added = 1 / scattered_density(scene, drawn.line, step);
    }
    area.add(added);
  }
  fmt::print("area {:.5g} +- {:.2g} pixels\n", area.mean(), area.standard_error());
  EXPECT_LT(area.standard_error(), 0.01 * area.mean());
  EXPECT_LT(std::fabs(area.z_score(parts.width * parts.height)), 4);
}

// What the sides of a lamp add cancels but for how far they are apart: met at the same places, they
// leave .1 of the mean, as a deviation of one sample; drawn apart they leave 1.8 times the mean.
// Four samples are stratified.
TEST(Direct, SidesOfALampAreMetAtTheSamePlaces) {
  const TempFiles files;
  files.write("lamp.xml", R"(<scene version="3.0.0">
      <integrator type="path"><integer name="max_depth" value="2"/></integrator>
      <sensor type="perspective"><float name="fov" value="0.01"/><transform name="to_world">
        <lookat origin="0.3,1,0.2" target="0.3,0,0.2" up="1,0,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="2"/><integer name="height" value="2"/>
        <rfilter type="box"/></film></sensor>
      <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/>
        <scale value="4"/></transform></shape>
      <shape type="rectangle" id="lamp"><transform name="to_world"><rotate x="1" angle="90"/>
        <scale value="0.5"/><translate y="2"/></transform>
        <emitter type="area"><rgb name="radiance" value="3"/></emitter></shape></scene>)");
  const Scene scene = read_scene(files.path("lamp.xml"), {}, nullptr);
  double deviation[2];
  for (const int samples : {1, 4}) {
    GradientOptions options;
    options.method = "silhouettes";
    options.parameters = {"lamp.translate.x"};
    options.terms = {"direct"};
    options.samples = SampleCounts({1, 1, 1, static_cast<double>(samples), 1});
    RunSettings settings;
    settings.spp = 64;
    settings.threads = 1;
    const Moments m = gradient(scene, options, settings).parameters[0].total;
    deviation[samples > 1] = std::sqrt(m.variance(0) * settings.spp) / std::fabs(m.mean(0));
  }
  fmt::print("deviation {:.3g} and {:.3g} of the mean\n", deviation[0], deviation[1]);
  EXPECT_LT(deviation[0], 0.4);
  EXPECT_LT(deviation[1], 0.4 * deviation[0]);
}

}  // namespace
}  // namespace limn
