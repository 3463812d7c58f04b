// Images by lines between silhouettes against rays and paths: methods, parts of films, refusals.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "integrators/contours/line_light.h"
#include "limn/core/error.h"
#include "limn/integrators/compare.h"
#include "support/over_floor.h"
#include "support/running_mean.h"

namespace limn {
namespace {

TEST(LineImages, AgreesWithRaysAndPaths) {
  const TempFiles files;
  const std::string lamps =
      square("lamp", 0.6, 90, {0.4, 2.9, 0.3}, area_light("glow", "9, 8, 7")) +
      square("side", 0.5, 0, {-0.6, 1.2, -2}, area_light("low", "3, 4, 5"));
  const std::string sky = constant_light("sky", "0.3, 0.4, 0.5");
  const std::vector<Body> bodies = {{torus_mesh(16, 8), 0.8, {0.2, 1.1, 0}},
                                    {cube_mesh(), 0.3, {-0.9, 0.3, 0.6}}};
  struct Case {
    std::string name, lights;
    bool smooth;
    int spp;
  };
  for (const Case& c : {Case{"lamps", lamps, false, 64}, Case{"sky", sky, false, 16},
                        Case{"map", make_sky(files, "map"), false, 16},
                        Case{"sun", make_sun(files, "sun"), false, 16},
                        Case{"lamps and sun", lamps + make_sun(files, "sun"), false, 8},
                        Case{"smooth, lamps and sky", lamps + sky, true, 4},
                        Case{"smooth, map", make_sky(files, "map"), true, 8}}) {
    const Scene scene = over_floor(files, bodies, c.smooth, c.lights);
    const RenderResult lines = run(scene, "lines", c.spp);
    expect_alike(lines, run(scene, "path", 512), c.name + ", path");
    expect_alike(lines, run(scene, "rays", 64), c.name + ", rays");
  }
  for (const RenderWhat what : {RenderWhat::kAmbientOcclusion, RenderWhat::kOpenness}) {
    for (const bool smooth : {false, true}) {
      const Scene scene = over_floor(files, bodies, smooth);
      RenderOptions options;
      options.what = what;
      expect_alike(run(scene, "lines", 16, options), run(scene, "rays", 128, options),
                   fmt::format("open sky {}{}", static_cast<int>(what), smooth ? ", smooth" : ""));
    }
  }
}

// Images of silhouettes are those of lines.
TEST(LineImages, ThreadsDoNotMatter) {
  const TempFiles files;
  const std::string lamp = square("lamp", 0.6, 90, {0.4, 2.9, 0.3}, area_light("glow", "9, 8, 7"));
  for (const std::string& lights : {make_sky(files, "map"), lamp + make_sun(files, "sun")}) {
    const Scene scene = over_floor(files, {{torus_mesh(16, 8), 0.8, {0.2, 1.1, 0}}}, true, lights);
    for (const std::string method : {"lines", "rays"}) {
      const RenderResult one = run(scene, method, 3), three = run(scene, method, 3, {}, 3);
      for (size_t i = 0; i < one.radiance.size(); ++i) {
        ASSERT_EQ(one.radiance.mean(i), three.radiance.mean(i)) << method;
      }
    }
    const RenderResult lines = run(scene, "lines", 3), own = run(scene, "silhouettes", 3);
    for (size_t i = 0; i < lines.radiance.size(); ++i) {
      ASSERT_EQ(own.radiance.mean(i), lines.radiance.mean(i));
    }
  }
}

// Crops, down to a single pixel.
TEST(LineImages, PartsOfAFilm) {
  const TempFiles files;
  Scene scene = over_floor(files, {{torus_mesh(16, 8), 0.8, {0.2, 1.1, 0}}}, false,
                           square("lamp", 0.6, 90, {0.4, 2.9, 0.3}, area_light("glow", "9, 8, 7")) +
                               make_sun(files, "sun"));
  Film& film = scene.film;
  film.crop_x = 5, film.crop_y = 3, film.crop_width = 10, film.crop_height = 12;
  expect_alike(run(scene, "lines", 64), run(scene, "rays", 256), "crop");
  film.crop_x = 9, film.crop_y = 11, film.crop_width = film.crop_height = 1;
  expect_alike(run(scene, "lines", 256), run(scene, "rays", 1024), "one pixel");
}

std::string refusal(const Scene& scene, const RenderOptions& options) {
  try {
    render(scene, {}, options);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

// Of silhouettes; lines must be told the same under their own name.
std::string refused(const Scene& scene, RenderOptions options) {
  const std::string text = refusal(scene, options), own = "\"silhouettes\"";
  if (options.method.name() != "silhouettes") return text;
  options.method = "lines";
  std::string expected = text;
  if (const size_t at = text.find(own); at != std::string::npos) {
    expected.replace(at, own.size(), "\"lines\"");
  }
  EXPECT_EQ(refusal(scene, options), expected);
  return text;
}

TEST(LineImages, SaysWhatItDoesNotKnow) {
  const TempFiles files;
  RenderOptions lines, rays;
  lines.method = "silhouettes";
  rays.method = "rays";
  Scene deep = over_floor(files, {});
  deep.max_depth = 3;
  EXPECT_NE(refused(deep, lines).find("what: direct"), std::string::npos);
  EXPECT_NE(refused(deep, rays).find("what: direct"), std::string::npos);
  const Scene point = over_floor(
      files, {}, false,
      R"(<emitter type="point" id="bulb"><point name="position" value="0, 3, 0"/></emitter>)");
  EXPECT_NE(refused(point, lines).find("\"bulb\""), std::string::npos);
  EXPECT_NE(refused(point, rays).find("\"bulb\""), std::string::npos);
  const Scene metal =
      over_floor(files, {}, false, square("mirror", 1, 0, {0, 1, 0}, conductor("m", 0.1)));
  EXPECT_NE(refused(metal, lines).find("\"mirror\""), std::string::npos);
  EXPECT_EQ(refused(metal, rays), "");
  const Scene ball = over_floor(files, {}, false,
                                obj_shape("ball", write_mesh(files, "b.obj", icosphere_mesh(2)),
                                          true, 1, {0, 3, 0}, area_light("glow", "1, 1, 1")));
  EXPECT_NE(refused(ball, lines).find("has 320 of these"), std::string::npos);
  Scene bent = over_floor(files, {{torus_mesh(16, 8), 0.8, {0.2, 1.1, 0}}}, true);
  bent.shading = ShadingModel::kMitsuba;
  EXPECT_NE(refused(bent, lines).find("\"body0\""), std::string::npos);
  EXPECT_NE(refused(bent, rays).find("\"body0\""), std::string::npos);
  const std::string glow = area_light("glow", "1, 1, 1");
  const auto lamps = [&](double angle, double x, double y) {
    return over_floor(files, {}, false,
                      square("lamp", 1, 90, {0, 2, 0}, glow) +
                          square("other", 1, angle, {x, y, 0}, area_light("light", "1, 2, 3")));
  };
  EXPECT_NE(refused(lamps(90, 0, 2), lines).find("in one place"), std::string::npos);
  EXPECT_NE(refused(lamps(90, 0.5, 2), lines).find("\"other\""), std::string::npos);
  for (const Scene& fine : {lamps(-90, 0, 2), lamps(90, 2, 2), lamps(90, 0.5, 2.5)}) {
    EXPECT_EQ(refused(fine, lines), "");
  }
  EXPECT_EQ(refused(lamps(90, 0.5, 2), rays), "");
  const Scene plain = over_floor(files, {});
  for (const int count : {0, -1, kMostLines + 1}) {
    RenderOptions wrong = lines;
    wrong.lines = count;
    EXPECT_NE(refused(plain, wrong).find("lines: "), std::string::npos) << count;
  }
  for (const double tolerance : {std::nan(""), -1.0, 2.0}) {
    RenderOptions wrong = lines;
    wrong.tolerance = tolerance;
    EXPECT_NE(refused(plain, wrong).find("tolerance: "), std::string::npos) << tolerance;
  }
  RenderOptions full = lines, none = rays;
  full.lines = kMostLines;
  EXPECT_EQ(refused(plain, full), "");
  full.tolerance = 0.1;
  EXPECT_NE(refused(plain, full).find("doubled"), std::string::npos);
  none.rays = 0;
  EXPECT_NE(refused(plain, none).find("rays: 0"), std::string::npos);
  RenderOptions ao;
  ao.what = RenderWhat::kAmbientOcclusion;
  EXPECT_NE(refused(deep, ao).find("say silhouettes, lines, rays"), std::string::npos);
}

// Runs of all methods and times, whatever the clock gives each of them.
TEST(CompareImages, Runs) {
  const TempFiles files;
  const Scene scene =
      over_floor(files, {{torus_mesh(16, 8), 0.8, {0.2, 1.1, 0}}}, false,
                 square("lamp", 0.6, 90, {0.4, 2.9, 0.3}, area_light("glow", "9, 8, 7")));
  RunSettings settings;
  settings.seed = 5;
  settings.spp = 1 << 30;
  settings.seconds = 0.01;
  std::string not_by_rays;
  const Reference reference = make_image_reference(scene, {}, 4, settings, not_by_rays);
  EXPECT_EQ(reference.method, "rays");
  EXPECT_EQ(not_by_rays, "");
  EXPECT_GE(reference.spp, 8);
  std::vector<std::unique_ptr<TimedMethod>> methods;
  for (const char* name : {"path", "rays", "silhouettes"}) {
    methods.push_back(make_image_method(scene, {}, Method(name), 4, settings));
  }
  const auto compared = compare({{0.001, 0.01}, 2}, reference, methods, settings);
  ASSERT_EQ(compared.size(), 3u);
  for (size_t m = 0; m < 3; ++m) {
    EXPECT_EQ(compared[m].name, methods[m]->name());
    EXPECT_EQ(compared[m].status, MethodStatus::kDone);
    EXPECT_EQ(compared[m].image.size(), reference.image.size());
    ASSERT_EQ(compared[m].summary.size(), 2u);
    for (const BudgetSummary& summary : compared[m].summary) {
      EXPECT_GE(summary.spp, 1);
      EXPECT_GT(summary.bias.count, 0);
    }
  }
  Scene shiny = over_floor(files, {}, false, constant_light("sky", "1, 1, 1"));
  shiny.max_depth = 3;
  EXPECT_EQ(make_image_reference(shiny, {}, 4, settings, not_by_rays).method, "path");
  EXPECT_NE(not_by_rays.find("max_depth"), std::string::npos);
  EXPECT_THROW(make_image_method(scene, {}, Method("forest"), 4, settings), InputError);
  EXPECT_THROW(make_image_method(shiny, {}, Method("rays"), 4, settings), InputError);
}

// What the reference says of its own error is what image_errors() takes out: methods of the same
// samples have the error that their variance makes, and blocks are unbiased.
TEST(CompareImages, ErrorsOfReferences) {
  const TempFiles files;
  const Scene scene =
      over_floor(files, {{torus_mesh(16, 8), 0.8, {0.2, 1.1, 0}}}, false,
                 square("lamp", 0.6, 90, {0.4, 2.9, 0.3}, area_light("glow", "9, 8, 7")));
  RunSettings settings;
  settings.spp = 2;  // of each of the eight runs, and of one run of the method
  RunningMean difference;
  for (int seed = 0; seed < 40; ++seed) {
    settings.seed = 2 * static_cast<uint64_t>(seed);
    std::string not_by_rays;
    const Reference reference = make_image_reference(scene, {}, 4, settings, not_by_rays);
    EXPECT_EQ(reference.spp, 16);
    ++settings.seed;
    const auto method = make_image_method(scene, {}, Method("rays"), 4, settings);
    const MethodRun run = method->run(settings);
    // The method's variance is eight times the reference's.
    const double mse = image_errors(run.image, reference.image, reference.variance).mse;
    difference.add(mse - 8 * mean_of(reference.variance));
  }
  EXPECT_LT(std::fabs(difference.z_score(0)), 4);
}

}  // namespace
}  // namespace limn
