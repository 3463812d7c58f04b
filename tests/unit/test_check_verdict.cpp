// Verdicts of the check: right gradients, gradients with a planted defect, too few samples.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "integrators/compare/check_step.h"
#include "integrators/compare/edge_events.h"
#include "integrators/methods/hair_gaps.h"
#include "limn/core/error.h"
#include "limn/core/image.h"
#include "limn/core/rng.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/run.h"
#include "support/check_runs.h"
#include "support/meshes.h"
#include "support/planted.h"
#include "support/running_mean.h"

namespace limn {
namespace {

CheckResult run(const Planted& planted, uint64_t seed) {
  RunSettings settings;
  settings.spp = planted.spp;
  settings.seed = seed;
  const CheckResult r = check(planted.scene, planted.options, settings, planted.run);
  std::string power;
  for (const CheckPower& p : r.power) power += fmt::format(" {} {:.3g}", p.term, p.visible);
  for (const Suspicion& s : r.suspicions) power += fmt::format(" z {:.1f}", s.z);
  fmt::print("{}: verdict {}, p {:.2g}, second {:.2g}, suspect {}; visible:{}\n", planted.name,
             static_cast<int>(r.verdict), r.p, r.confirmation ? r.confirmation->p : 1, suspected(r),
             power);
  return r;
}

bool names(const Planted& planted, const CheckResult& result) {
  return std::ranges::any_of(result.suspects, [&](const std::string& term) {
    return std::ranges::find(planted.terms, term) != planted.terms.end();
  });
}

// The part of the defect's term that could have been seen.
double visible(const CheckResult& r, const std::string& term) {
  for (const CheckPower& power : r.power) {
    if (power.term == term) return power.visible;
  }
  return 0;
}

// Events of size 3 in one sample of `every` lie in one place of four: their size is what the
// variance says, however many samples a batch has.
TEST(EventSizes, DoNotGrowWithTheBatches) {
  for (const int every : {2, 500}) {
    const double rate = 1.0 / every, size = 3 * (1 - rate);
    Rng rng(7, every, 0);
    RunningMean means;
    for (int run = 0; run < 40; ++run) {
      std::vector<Moments::Batch> batches;
      for (int64_t done = 0; done < 16384;) {
        const int64_t samples = Schedule::batch_size(static_cast<int>(done), every == 2);
        double sum = 0;
        for (int64_t s = 0; s < samples; ++s) sum += rng.uniform() < rate ? 3 : 0;
        batches.push_back({{sum, 0, 0, 0}, samples});
        done += samples;
      }
      const EventSizes events = event_sizes(batches);
      means.add(events.mean);
      EXPECT_GE(events.large, 0.5 * size);
    }
    EXPECT_LT(std::fabs(means.z_score(size)), 4) << every;
  }
}

TEST(CheckVerdict, FewSamplesCannotTell) {
  const TempFiles files;
  const Planted planted = planted_term(files, "forest", "camera", 1, 8);
  const CheckResult r = run(planted, 3);
  EXPECT_EQ(r.verdict, Verdict::kCannotTell);
  EXPECT_GT(r.needed_spp, 8);
  EXPECT_GT(r.within, kCheckWanted);
  // Some windows have met no event yet.
  EXPECT_GT(r.widened.windows, 0);
  EXPECT_GT(r.widened.most, 1);
}

TEST(CheckVerdict, DefectsAreFoundAndNamed) {
  const TempFiles files;
  const std::pair<const char*, int> terms[] = {
      {"interior", 256}, {"camera", 1024}, {"boundary", 256}};
  for (const auto& [term, spp] : terms) {
    const Planted planted = planted_term(files, "forest", term, 0.3, spp);
    const CheckResult r = run(planted, 5);
    EXPECT_EQ(r.verdict, Verdict::kDisagree) << planted.name;
    EXPECT_EQ(suspected(r), term);
  }
}

// The step comes from the image: a floor a thousand times wider must not change it much.
TEST(CheckVerdict, StepDoesNotGrowWithTheFloor) {
  const TempFiles files;
  const auto step = [&](double half) {
    SceneParts parts;
    parts.body = square("floor", half, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.8, 0.8")) +
                 square("screen", 0.4, 50, {0, 0.7, 0}, diffuse("clay", "0.4, 0.4, 0.4")) +
                 square("lamp", 0.5, 90, {0, 2.5, 1}, area_light("glow", "5, 5, 5"));
    CheckOptions options;
    options.parameter = "sensor.translate.x";
    RunSettings settings;
    settings.spp = 32;
    settings.seed = 2;
    return check(make_scene(files, parts), options, settings).step;
  };
  EXPECT_LE(step(3000), 16 * step(3));
}

// A panel a hundred-millionth of a radian from being edge-on to the sun is dark on one side of
// that: its derivative is right, and no mean of both sides. A tenth of a radian away it is no bend.
TEST(CheckVerdict, ABendIsNoError) {
  const TempFiles files;
  for (const double tilt : {1e-8, 0.1}) {
    SceneParts parts;
    parts.body = square("panel", 1, 0, {0, 1, 0}, diffuse("chalk", "0.8, 0.8, 0.8")) +
                 square("floor", 1, -90, {0, -0.2, 1}, diffuse("clay", "0.4, 0.4, 0.4")) +
                 fmt::format(R"(<emitter type="directional" id="sun"><vector name="direction" x="0"
                     y="-1" z="{}"/><rgb name="irradiance" value="3, 3, 3"/></emitter>)",
                             -tilt) +
                 constant_light("sky", "0.3, 0.3, 0.3");
    CheckOptions options;
    options.parameter = "sun.rotate.x";
    RunSettings settings;
    settings.spp = 64;
    settings.seed = 4;
    const CheckResult r = check(make_scene(files, parts), options, settings);
    EXPECT_EQ(r.bends, tilt < 0.01);
    EXPECT_NE(r.verdict, Verdict::kDisagree);
  }
}

// A box on an equal one that is lifted or pressed: its derivative is that of pressing, far from the
// mean of both slopes, and is not accused.
TEST(CheckVerdict, ContactIsNoError) {
  const TempFiles files;
  const auto cube = [](const std::string& id, double height, double grey) {
    return fmt::format(R"(<shape type="cube" id="{}"><transform name="to_world"><scale value="0.4"/>
                          <translate y="{}"/></transform>)",
                       id, height) +
           diffuse(id + "_clay", fmt::format("{0}, {0}, {0}", grey)) + "</shape>";
  };
  SceneParts parts;
  parts.origin = {-1.2711, 2.0267, 3.4731};
  parts.target = {0, 0.7, 0};
  parts.fov = 35;
  parts.body = square("floor", 4, -90, {0, 0, 0}, diffuse("chalk", "0.4, 0.4, 0.7")) +
               cube("low", 0.4, 0.5) + cube("up", 1.2, 0.8) + constant_light("sky", "1, 1, 1");
  CheckOptions options;
  options.parameter = "up.translate.y";
  options.method = "forest";
  RunSettings settings;
  settings.spp = 192;
  settings.seed = 1;
  const CheckResult r = check(make_scene(files, parts), options, settings);
  EXPECT_LT(r.p, kCheckStageLevel);
  EXPECT_TRUE(r.bends);
  EXPECT_EQ(r.verdict, Verdict::kCannotTell);
}

// A wall between two others that slides along itself: a gap opens at one end as it goes there, at
// the other end as it comes back.
TEST(CheckVerdict, SheetsThatPartAreNoError) {
  const TempFiles files;
  const auto side = [](const std::string& id, double angle, double x, const std::string& grey) {
    return fmt::format(R"(<shape type="rectangle" id="{}"><transform name="to_world">
                          <scale x="1" y="0.5"/><rotate y="1" angle="{}"/>
                          <translate x="{}" y="0.5"/></transform>)",
                       id, angle, x) +
           diffuse(id + "_paint", grey) + "</shape>";
  };
  SceneParts parts;
  parts.origin = {0.6, 1.8, 3.4};
  parts.target = {0, 0.2, 0};
  parts.width = parts.height = 24;
  parts.body =
      square("floor", 2, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.8, 0.8")) +
      R"(<shape type="rectangle" id="back"><transform name="to_world"><scale x="1" y="0.5"/>
         <translate y="0.5" z="-1"/></transform><bsdf type="diffuse"/></shape>)" +
      side("left", 90, -1, "0.5, 0.3, 0.3") + side("right", -90, 1, "0.8, 0.8, 0.8") +
      constant_light("sky", "0.4, 0.5, 0.7");
  CheckOptions options;
  options.parameter = "back.translate.x";
  RunSettings settings;
  settings.spp = 256;
  const CheckResult r = check(make_scene(files, parts), options, settings);
  EXPECT_LT(r.p, kCheckStageLevel);
  EXPECT_EQ(r.verdict, Verdict::kCannotTell);
}

// A camera in the plane of a lamp, both at rest, forgives no defect elsewhere, not even one that
// the bends' noise would leave open at a kink.
TEST(CheckVerdict, FacesEdgeOnAtRestForgiveNothing) {
  const TempFiles files;
  for (const bool at_kink : {false, true}) {
    Planted planted = planted_term(files, "forest", "boundary", 0.6, 256);
    planted.scene.camera.origin.y = Dual(2.5);
    planted.run = [=, run = planted.run](const auto& scene, const auto& options,
                                         const auto& settings) {
      GradientResult result = run(scene, options, settings);
      EXPECT_FALSE(result.at_kink);
      EXPECT_FALSE(result.warnings.empty());
      result.at_kink = at_kink;
      return result;
    };
    const CheckResult r = run(planted, 5);
    EXPECT_EQ(r.bends, at_kink);
    EXPECT_EQ(r.verdict, at_kink ? Verdict::kCannotTell : Verdict::kDisagree);
  }
}

// The image of a wide floor does not change as it is scaled: what both modes have is rounding.
TEST(CheckReverse, RoundingIsNoError) {
  const TempFiles files;
  SceneParts parts;
  parts.width = parts.height = 4;
  parts.max_depth = 2;
  parts.origin = {0.3, 2, 3};
  parts.body = square("floor", 30, -90, {0, 0, 0}, diffuse("chalk", "0.5, 0.5, 0.5")) +
               R"(<emitter type="point" id="bulb"><point name="position" x="0.5" y="2" z="0.3"/>
                  <rgb name="intensity" value="9, 9, 9"/></emitter>)";
  BackwardOptions options;
  options.parameters = {"floor.scale"};
  RunSettings settings;
  settings.spp = 4096;
  for (settings.seed = 1; settings.seed < 4; ++settings.seed) {
    const auto checks = check_reverse(make_scene(files, parts), options, settings);
    ASSERT_EQ(checks.size(), 1u);
    EXPECT_LT(std::fabs(checks[0].forward), 1e-12);
    EXPECT_LT(std::fabs(checks[0].z), 4);
  }
}

// As many samples for the gradient and for its differences as give the least error in a time.
TEST(CheckSamples, AreOfLeastError) {
  const CheckCost gradient{100, 5, 0.4}, differences{20, 0.5, 3};
  for (const double seconds : {20.0, 60.0}) {
    const auto samples = more_samples(gradient, differences, 1e-6, seconds);
    ASSERT_TRUE(samples);
    const auto n = static_cast<double>(samples->gradient);
    const auto m = static_cast<double>(samples->differences);
    const auto error = [&](double x, double y) { return 0.4 * 100 / x + 3 * 20 / y; };
    EXPECT_NEAR(n * 0.05 + m * 0.025, seconds, 0.1);
    for (const double more : {-0.1 * n, 0.1 * n}) {
      EXPECT_LT(error(n, m), error(n + more, m - more * 0.05 / 0.025));
    }
  }
  // A run is as long as it must be, and not repeated in less time than it took.
  const auto enough = more_samples(gradient, differences, 0.5, 60);
  ASSERT_TRUE(enough);
  EXPECT_LT(static_cast<double>(enough->gradient), 1500);
  EXPECT_FALSE(more_samples(gradient, differences, 0.5, 5));
}

// Beyond 0 and 1 an opacity changes nothing, so that differences there hold half of the slope.
TEST(CheckVerdict, TexelsAtTheEndsOfTheirRangeAreCheckedInside) {
  const TempFiles files;
  Image holes(8, 8, 3);
  for (size_t i = 0; i < holes.data.size(); ++i) holes.data[i] = i / 3 % 8 < 4 ? 1 : 0;
  write_exr(files.path("holes.exr"), holes, false, {});
  SceneParts parts;
  parts.width = parts.height = 4;
  parts.max_depth = 2;
  parts.body =
      square("screen", 3, 0, {0, 0.5, 0},
             R"(<bsdf type="mask" id="holes"><texture type="bitmap" name="opacity"><string
                         name="filename" value=")" +
                 files.path("holes.exr") + R"("/></texture><bsdf type="diffuse"/></bsdf>)") +
      constant_light("sky", "1, 1, 1");
  Image ones(8, 8, 3);
  std::fill(ones.data.begin(), ones.data.end(), 1.0f);
  write_exr(files.path("ones.exr"), ones, false, {});
  CheckOptions options;
  options.parameter = "holes.opacity.data:" + files.path("ones.exr");
  options.step = 0.1;
  RunSettings settings;
  settings.spp = 4096;
  const Scene scene = make_scene(files, parts);
  const CheckResult r = check(scene, options, settings);
  EXPECT_EQ(r.verdict, Verdict::kAgree) << r.total.gradient << " " << r.total.difference;
  EXPECT_EQ(r.gradient.warnings.back(),
            options.parameter + ": texels at the ends of their range are checked inside it");
}

// What looks like no noise in a few samples is looked at for an eighth of the time.
TEST(CheckSamples, AreSomeWhereNoNoiseShows) {
  const auto samples = more_samples({16, 1, 0}, {16, 3, 1}, 1e-6, 60);
  ASSERT_TRUE(samples);
  EXPECT_NEAR(static_cast<double>(samples->gradient), 16 * 60 / 9.0, 1);
  EXPECT_NEAR(static_cast<double>(samples->differences), 16 * (60 - 60 / 9.0) / 3, 1);
}

// A second run takes twice as many.
TEST(CheckSamples, AreNotMoreThanTwiceInAnInt) {
  const TempFiles files;
  Planted planted = planted_term(files, "forest", "camera", 1, 2);
  RunSettings settings;
  settings.spp = (1 << 29) + 1;
  try {
    check(planted.scene, planted.options, settings, planted.run);
    FAIL();
  } catch (const FieldError& e) {
    EXPECT_EQ(e.field, "spp");
    EXPECT_EQ(e.message, "a check takes 536870912 at most: its second run takes twice as many");
  }
}

// Of what a check with a limit of time takes, the gradient's noise is no more than it must be.
TEST(CheckVerdict, ATimeIsEnough) {
  const TempFiles files;
  Planted planted = planted_term(files, "forest", "camera", 1, 2);
  RunSettings settings;
  settings.seconds = 600;
  const CheckResult r = check(planted.scene, planted.options, settings, planted.run);
  EXPECT_EQ(r.verdict, Verdict::kAgree);
  EXPECT_LE(r.within, kCheckWanted);
}

// Where nothing bends, neither do the magnitudes of many windows add up to much.
TEST(Bends, AreNotMadeOfNoise) {
  const TempFiles files;
  const Planted planted = planted_term(files, "forest", "camera", 1, 64);
  const Windows windows(planted.scene.film, 2, 1);
  RunSettings settings;
  settings.spp = planted.spp;
  settings.seed = 8;
  const auto bend = find_bend(planted.scene, planted.options.parameter, 0.01, windows,
                              std::vector<double>(windows.size(), 1), settings);
  ASSERT_TRUE(bend);
  fmt::print("{} windows: {} +- {}\n", windows.size(), bend->most, bend->most_error);
  EXPECT_LT(std::fabs(bend->most), 4 * bend->most_error);
}

// Two tiles that part in a corner of the picture are a kink, and forgive no defect elsewhere.
TEST(CheckVerdict, AKinkElsewhereForgivesNothing) {
  const TempFiles files;
  for (const char* term : {"interior", "boundary"}) {
    const Planted planted = planted_beside_kink(files, "forest", term, 0.6, 1024);
    const CheckResult r = run(planted, 5);
    EXPECT_TRUE(r.gradient.at_kink);
    EXPECT_FALSE(r.bends) << planted.name;
    EXPECT_EQ(r.verdict, Verdict::kDisagree) << planted.name;
    EXPECT_EQ(suspected(r), term);
  }
}

// Two boxes side by side: gaps that no sample would meet are told, wider ones and none are not.
TEST(HairGaps, AreWarnedOf) {
  const TempFiles files;
  const auto warnings = [&](double gap, double spp) {
    SceneParts parts;
    const auto box = [&](const std::string& id, double x) {
      return obj_shape(id, write_mesh(files, id + ".obj", cube_mesh()), true, 0.5, {x, 0, 0},
                       diffuse(id + "_chalk", "0.8, 0.8, 0.8"));
    };
    parts.body = box("left", -0.5) + box("right", 0.5 + gap);
    std::vector<std::string> lines;
    warn_of_hair_gaps(make_scene(files, parts), spp, 1, lines);
    return lines;
  };
  // A pixel is 0.27 wide at a distance of six: one of 64 samples meets a gap of 0.001.
  const auto found = warnings(1e-5, 64);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NE(found[0].find("\"left\" and \"right\" have a gap of 1e-05 between them"),
            std::string::npos)
      << found[0];
  EXPECT_TRUE(warnings(1e-5, 1e5).empty());
  EXPECT_TRUE(warnings(0.01, 64).empty());
  EXPECT_TRUE(warnings(0, 64).empty());
}

// The same as one mesh, with any number of threads; and a mesh without gaps, whose faces all touch.
TEST(HairGaps, AreWarnedOfWithinAShape) {
  const TempFiles files;
  Mesh both = cube_mesh();
  const auto count = static_cast<uint32_t>(both.positions.size());
  const Mesh cube = both;
  for (const Vec3f& x : cube.positions) both.positions.push_back({x.x + 2 + 1e-4f, x.y, x.z});
  for (const FaceIndices& f : cube.faces)
    both.faces.push_back({f[0] + count, f[1] + count, f[2] + count});
  const auto warnings = [&](const Mesh& mesh, int threads) {
    SceneParts parts;
    parts.body = obj_shape("pair", write_mesh(files, "pair.obj", mesh), true, 0.5, {},
                           diffuse("chalk", "0.8, 0.8, 0.8"));
    std::vector<std::string> lines;
    warn_of_hair_gaps(make_scene(files, parts), 64, threads, lines);
    return lines;
  };
  const auto found = warnings(both, 1);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NE(found[0].find("\"pair\" has a gap of 5e-05 between its own faces"), std::string::npos)
      << found[0];
  EXPECT_EQ(warnings(both, 3), found);
  EXPECT_TRUE(warnings(cube, 1).empty());
}

// The thickness of a plate is no gap, however its faces are cut; the slit between two of them is
// one, and what an open one leaves between its sheets.
TEST(HairGaps, AreNotInSolids) {
  const TempFiles files;
  const auto plate = [](float lower, float upper, uint32_t open) {
    // The upper face has a vertex in its middle, so that opposite faces share no side's ends.
    std::vector<Vec3f> x;
    for (const float y : {lower, upper})
      for (const auto& [s, t] : {std::pair{-1.f, -1.f}, {1.f, -1.f}, {1.f, 1.f}, {-1.f, 1.f}})
        x.push_back({s, y, t});
    x.push_back({0.3f, upper, 0.1f});
    std::vector<FaceIndices> faces{{0, 1, 2}, {0, 2, 3}};
    for (uint32_t k = 0; k < 4; ++k) {
      const uint32_t n = (k + 1) % 4;
      faces.push_back({k + 4, 8, n + 4});
      if (k < open) continue;
      faces.push_back({k, k + 4, n});
      faces.push_back({n, k + 4, n + 4});
    }
    return make_mesh(x, faces);
  };
  const auto warnings = [&](const Mesh& mesh) {
    SceneParts parts;
    parts.body = obj_shape("plate", write_mesh(files, "plate.obj", mesh), true, 0.5, {},
                           diffuse("chalk", "0.8, 0.8, 0.8"));
    std::vector<std::string> lines;
    warn_of_hair_gaps(make_scene(files, parts), 64, 2, lines);
    return lines;
  };
  const Mesh thin = plate(0, 1e-4f, 0);
  EXPECT_TRUE(warnings(thin).empty());
  EXPECT_EQ(warnings(plate(0, 1e-4f, 4)).size(), 1u);
  // One side alone is open.
  EXPECT_EQ(warnings(plate(0, 1e-4f, 1)).size(), 1u);
  const auto slit = warnings(joined(thin, plate(3e-4f, 4e-4f, 0)));
  ASSERT_EQ(slit.size(), 1u);
  EXPECT_NE(slit[0].find("\"plate\" has a gap of 0.0001 between its own faces"), std::string::npos)
      << slit[0];
}

// Faces that share a corner are neighbours also where it has a copy for each of them.
TEST(HairGaps, AreNotBetweenNeighbours) {
  const TempFiles files;
  // Two sheets that part by a hair from a corner on, with copies of it.
  const auto wedge = [](bool apart) {
    const float y = apart ? 1e-4f : 0;
    return make_mesh({{-1, 0, 0}, {1, 0, -1}, {1, 0, 1}, {-1, y, 0}, {1, 1e-4f, -1}, {1, 1e-4f, 1}},
                     {{0, 1, 2}, {3, 4, 5}});
  };
  const auto count = [&](const Mesh& mesh) {
    SceneParts parts;
    parts.body = obj_shape("sheets", write_mesh(files, "sheets.obj", mesh), true, 0.5, {},
                           diffuse("chalk", "0.8, 0.8, 0.8"));
    std::vector<std::string> lines;
    warn_of_hair_gaps(make_scene(files, parts), 64, 1, lines);
    return lines.size();
  };
  EXPECT_EQ(count(wedge(false)), 0u);
  EXPECT_EQ(count(wedge(true)), 1u);
}

// Faces of a fine surface that run side by side, a face or two apart.
TEST(HairGaps, AreNotInFineSurfaces) {
  const TempFiles files;
  SceneParts parts;
  parts.body = R"(<shape type="cylinder" id="tube"><transform name="to_world">
                    <scale x="0.18" y="0.18" z="0.9"/><rotate y="1" angle="70"/></transform>
                  </shape>)";
  std::vector<std::string> lines;
  warn_of_hair_gaps(make_scene(files, parts), 15, 2, lines);
  EXPECT_EQ(lines, std::vector<std::string>{});
}

// Light that a polished cube throws now and then where a floor ends: the gradient looks there often
// enough to meet it, differences do not, and say nothing of how large it would be.
TEST(CheckVerdict, RareLightWhereASideMovesIsNotNothing) {
  const TempFiles files;
  SceneParts parts;
  parts.origin = {4, 4, 2};
  parts.target = {0, 0.3, 0};
  parts.fov = 45;
  parts.width = parts.height = 24;
  parts.body = square("floor", 2, -90, {0, 0, 0}, diffuse("chalk", "0.5, 0.5, 0.5")) +
               R"(<shape type="cube"><transform name="to_world"><scale value="0.2"/>
                    <rotate x="1" z="-0.3" angle="40"/><translate y="0.5"/></transform>
                    <bsdf type="roughconductor"><float name="alpha" value="0.1"/></bsdf></shape>
                  <emitter type="spot"><rgb name="intensity" value="40"/>
                    <float name="cutoff_angle" value="6"/><transform name="to_world">
                    <lookat origin="0, 4, 1" target="0, 0.4, 0" up="0, 0, 1"/></transform>
                  </emitter>)";
  const Scene scene = make_scene(files, parts);
  CheckOptions options;
  options.parameter = "floor.rotate.y";
  options.samples = SampleCounts{1, 64, 1};
  RunningMean z;
  for (uint64_t seed = 0; seed < 8; ++seed) {
    RunSettings settings;
    settings.spp = 16;
    settings.seed = seed;
    const CheckResult r = check(scene, options, settings);
    z.add(r.total.z);
  }
  EXPECT_LT(std::fabs(z.mean()), 4 / std::sqrt(8.0));
}

// The fewest successes of n, where each has this probability, in 999 of 1000 cases.
int fewest(int n, double probability) {
  double below = 0, one = std::pow(1 - probability, n);
  int k = 0;
  for (; k < n && below + one < 1e-3; ++k) {
    below += one;
    one *= (n - k) / (k + 1.0) * probability / (1 - probability);
  }
  return k;
}

// Counts over many runs with a defect, of those whose stated power covers it.
class PlantedRuns {
 public:
  void add(const Planted& planted, uint64_t seed) {
    ++all_;
    const CheckResult r = run(planted, seed);
    // Where the size is not known, the defect is meant to be seen.
    if (planted.size > 0 && visible(r, planted.terms[0]) > planted.size) return;
    const bool disagrees = r.verdict == Verdict::kDisagree;
    ++seen_;
    found_ += disagrees;
    // Other defects are no part of a term's image: they need not look like one.
    if (planted.size == 0) return;
    ++scaled_;
    named_ += disagrees && names(planted, r);
    alone_ += disagrees && r.suspects.size() == 1;
  }
  void expect_found() const {
    fmt::print(
        "{} runs, {} within the stated power: {} found; {} of {} scaled terms named, {} alone\n",
        all_, seen_, found_, named_, scaled_, alone_);
    EXPECT_GE(found_, fewest(seen_, 0.95));
    // No power is stated of names.
    EXPECT_GE(named_, fewest(scaled_, 0.9));
    EXPECT_GE(alone_, fewest(scaled_, 0.7));
  }
  // Of all runs, those whose stated power covers the defect.
  double share_seen() const { return static_cast<double>(seen_) / all_; }

 private:
  int all_ = 0, seen_ = 0, found_ = 0, scaled_ = 0, named_ = 0, alone_ = 0;
};

// A tenth of a term, which a check of so many samples says it can see.
TEST(CheckVerdict, ATenthIsFoundAndNamed) {
  const Planted planted = planted_in_closed_form("lamp_over_plane", "lamp.translate.x", "forest",
                                                 "boundary", 0.9, 16384);
  const CheckResult r = run(planted, 1);
  EXPECT_LE(visible(r, "boundary"), 0.1);
  EXPECT_EQ(r.verdict, Verdict::kDisagree);
  EXPECT_EQ(suspected(r), "boundary");
}

// Many runs: LIMN_PLANTED_RUNS of each kind, from seed LIMN_PLANTED_FIRST on.
TEST(CheckVerdict, PlantedDefects) {
  const char* wanted = std::getenv("LIMN_PLANTED_RUNS");
  if (!wanted) GTEST_SKIP() << "LIMN_PLANTED_RUNS is not set";
  PlantedRuns runs;
  const TempFiles files;
  const char* first = std::getenv("LIMN_PLANTED_FIRST");
  const int begin = first ? std::atoi(first) : 0;
  for (int k = begin; k < begin + std::atoi(wanted); ++k) {
    const auto seed = static_cast<uint64_t>(100 + k);
    runs.add(planted_border(files, 1024), seed);
    runs.add(planted_normals(files, 256), seed);
  }
  runs.expect_found();
}

// The same of terms times 0.9. LIMN_SCALED_RUNS takes so many runs of each.
TEST(CheckVerdict, ScaledTermsAreFoundAndNamed) {
  const struct {
    const char *file, *parameter, *method, *term;
    int spp;
  } kinds[] = {
      {"lamp_over_plane", "lamp.translate.x", "forest", "boundary", 5120},
      {"lamp_over_plane", "lamp.translate.x", "adaptive", "direct", 1024},
      {"lamp_over_plane", "floor.rotate.x", "forest", "interior", 40960},
      {"lamp_in_beckmann", "sensor.translate.y", "forest", "boundary", 65536},
      {"half_hidden_lamp", "lamp.translate.x", "silhouettes", "direct", 49152},
      {"crossing_in_view", "sensor.fov", "adaptive", "camera", 36864},
      {"shadow_of_directional", "object.scale", "forest", "shadow", 73728},
  };
  const char* wanted = std::getenv("LIMN_SCALED_RUNS");
  const int count = wanted ? std::atoi(wanted) : 1;
  PlantedRuns runs;
  for (int k = 0; k < count; ++k)
    for (const auto& kind : kinds)
      runs.add(
          planted_in_closed_form(kind.file, kind.parameter, kind.method, kind.term, 0.9, kind.spp),
          static_cast<uint64_t>(200 + k));
  runs.expect_found();
  EXPECT_GE(runs.share_seen(), 0.75);
}

}  // namespace
}  // namespace limn
