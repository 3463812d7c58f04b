// The exact film: faces at points of the film against rays in double precision, images and the
// term "camera" against those by rays.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <nlohmann/json.hpp>

#include "integrators/film/film_regions.h"
#include "integrators/paths/camera_path.h"
#include "limn/core/duplicate_faces.h"
#include "limn/core/ray_tracer.h"
#include "limn/integrators/check.h"
#include "limn/integrators/compare.h"
#include "limn/integrators/compare_images.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/render.h"
#include "support/brute_force_tracer.h"
#include "support/compare_moments.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr double kLevel = 1e-4;

std::string glowing(const std::string& id, const std::string& radiance) {
  return diffuse(id + "_bsdf", "0.2, 0.2, 0.2") + area_light(id + "_light", radiance);
}

// Bodies that pass through each other and through the floor, one that is there twice, needles, a
// lamp, and faces that reach behind the camera.
SceneParts crowded(const TempFiles& files) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0.3, 1.4, 3};
  parts.target = {0, 0.4, 0};
  const Mesh needles = make_mesh(
      {{-2, 0.3f, 1}, {2, 0.3f, 0.9f}, {2, 0.3002f, 0.9f}, {-2, 0.9f, 1}}, {{0, 1, 2}, {0, 2, 3}});
  const std::string torus = write_mesh(files, "torus.obj", torus_mesh(12, 7));
  parts.body =
      square("floor", 1.5, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.7, 0.6")) +
      obj_shape("body", torus, true, 0.5, {0, 0.5, 0.1}, diffuse("clay", "0.6, 0.5, 0.4")) +
      obj_shape("twin", torus, true, 0.5, {0, 0.5, 0.1}, glowing("twin", "0.2, 0.9, 0.4")) +
      obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), false, 0.5,
                {0.4, 0.45, 0.2}, diffuse("snow", "0.9, 0.9, 0.9")) +
      obj_shape("needles", write_mesh(files, "needles.obj", needles), true, 1, {0, 0, 0},
                glowing("needles", "1, 2, 3")) +
      square("lamp", 0.3, 60, {-0.5, 1, -0.5}, area_light("glow", "9, 8, 6"));
  return parts;
}

size_t wrong_faces(const Scene& scene, const FilmRegions& regions, int points) {
  const auto tracer = make_brute_force_tracer(scene);
  const DuplicateFaces copies(scene);
  const Film& film = scene.film;
  size_t wrong = 0;
  Rng rng(7, 0, 0);
  for (int i = 0; i < points; ++i) {
    const double x = film.crop_x + film.crop_width * rng.uniform();
    const double y = film.crop_y + film.crop_height * rng.uniform();
    Hit hit;
    const Ray ray = camera_ray(scene, scene.camera.ray<double>(x, y));
    if (tracer->closest(ray, hit))
      hit.face = *copies.met(hit.face, ray.direction, ray.skip_emitters);
    wrong += hit.face != regions.face_at(static_cast<int>(x), static_cast<int>(y), x, y);
  }
  return wrong;
}

TEST(ExactFilm, FacesAreThoseOfRays) {
  const TempFiles files;
  for (const bool hide_emitters : {false, true}) {
    for (const double far : {1e4, 3.2}) {
      SceneParts parts = crowded(files);
      parts.hide_emitters = hide_emitters;
      Scene scene = make_scene(files, parts);
      scene.camera.near_clip = 2.1;  // through bodies
      scene.camera.far_clip = far;
      const FilmRegions regions(scene, 2);
      EXPECT_GT(regions.size(), 256u);
      EXPECT_GT(regions.crossings(), 0u);
      EXPECT_EQ(wrong_faces(scene, regions, 20000), 0u);
    }
  }
}

// At scales and places far from 1 and 0, to what floats hold of them.
TEST(ExactFilm, FacesAreThoseOfRaysAtAllScales) {
  for (const double scale : {1e-3, 1.0, 1e3}) {
    const TempFiles files;
    SceneParts parts;
    parts.unit = scale;
    parts.hide_emitters = true;
    parts.body =
        obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(3)), true, scale,
                  Vec3d{0, 0.5, 0} * scale, diffuse("snow", "0.9, 0.9, 0.9")) +
        square("lamp", 0.3 * scale, -30, Vec3d{0.2, 1, 3} * scale, area_light("glow", "9, 8, 6"));
    const Scene scene = make_scene(files, parts);
    EXPECT_EQ(wrong_faces(scene, FilmRegions(scene, 1), 20000), 0u) << scale;
  }
}

// Of faces in one plane, to the rounding of positions, the one that rays meet: a lamp before what
// does not shine, else the file's first.
TEST(ExactFilm, FacesInOnePlaneAreThoseOfRays) {
  constexpr double kTilt = -53, kShift = 0.13;
  const double up = std::cos(kTilt * kPi / 180), along = std::sin(kTilt * kPi / 180);
  const std::string sheet = square("sheet", 1, kTilt, {0, 0, 0}, diffuse("chalk", "0.8, 0.7, 0.6"));
  const Vec3d inside{0.1, kShift * up, kShift * along};
  const std::string others[] = {
      square("lamp", 0.5, kTilt, inside, area_light("glow", "9, 8, 6")),
      square("patch", 0.5, kTilt, inside, diffuse("slate", "0.1, 0.2, 0.3"))};
  const TempFiles files;
  for (const std::string& other : others) {
    for (const std::string& body : {sheet + other, other + sheet}) {
      SceneParts parts;
      parts.origin = {0.3, 2.4, 3};
      parts.target = {0, 0, 0};
      parts.body = body;
      const Scene scene = make_scene(files, parts);
      const FilmRegions regions(scene, 1);
      const auto tracer = make_embree_tracer(scene, 1);
      Rng rng(9, 0, 0);
      std::array<int, 2> seen{};
      for (int i = 0; i < 4000; ++i) {
        const double x = 16 * rng.uniform(), y = 16 * rng.uniform();
        Hit hit;
        tracer->closest(camera_ray(scene, scene.camera.ray<double>(x, y)), hit);
        EXPECT_EQ(hit.face, regions.face_at(static_cast<int>(x), static_cast<int>(y), x, y));
        if (hit.face.shape.valid()) ++seen[hit.face.shape.index()];
      }
      // Behind the sheet in the file, what does not shine is hidden by it.
      const bool hidden = body.starts_with(sheet) && &other != &others[0];
      EXPECT_GT(seen[0], 100);
      EXPECT_EQ(seen[1] > 0, !hidden);
    }
  }
}

// Without a gap: from inside of a closed body no pixel sees nothing.
TEST(ExactFilm, ClosedRoomsHaveNoGaps) {
  const TempFiles files;
  SceneParts parts;
  parts.origin = {0.1, 0.2, 0.3};
  parts.target = {1, 0.7, -0.4};
  parts.fov = 100;
  parts.body = obj_shape("room", write_mesh(files, "room.obj", icosphere_mesh(4)), true, 2,
                         {0, 0, 0}, diffuse("snow", "0.9, 0.9, 0.9"));
  const Scene scene = make_scene(files, parts);
  const FilmRegions regions(scene, 2);
  Rng rng(8, 0, 0);
  for (int i = 0; i < 100000; ++i) {
    const double x = 16 * rng.uniform(), y = 16 * rng.uniform();
    ASSERT_TRUE(regions.face_at(static_cast<int>(x), static_cast<int>(y), x, y).shape.valid());
  }
}

TEST(ExactFilm, ImageIsThatOfRays) {
  const TempFiles files;
  const Scene scene = make_scene(files, crowded(files));
  RunSettings settings;
  settings.spp = 256;
  settings.threads = 2;
  const RenderResult rays = render(scene, settings);
  const RenderResult exact = render(scene, settings, {.exact_film = true});
  EXPECT_EQ(exact.non_finite.count, 0u);
  EXPECT_LT(exact.rays, rays.rays);
  // The very paths of rays: of 65536 samples, 0.4 are expected to pass an edge nearer than single
  // precision can tell; six or more come once in a million times.
  size_t others = 0;
  for (size_t i = 0; i < exact.radiance.size(); i += 3) {
    others += exact.radiance.mean(i) != rays.radiance.mean(i);
  }
  EXPECT_LT(others, 6u);
  settings.threads = 1;
  EXPECT_EQ(means(render(scene, settings, {.exact_film = true}).radiance), means(exact.radiance));
}

GradientResult camera_term(const Scene& scene, const std::vector<std::string>& parameters,
                           bool exact, int spp, int threads = 2) {
  GradientOptions options;
  options.parameters = parameters;
  options.method = "forest";
  options.terms = {"camera"};
  options.block = 4;
  options.exact_film = exact;
  RunSettings settings;
  settings.spp = spp;
  settings.seed = exact ? 11 : 12;
  settings.threads = threads;
  GradientResult result = gradient(scene, options, settings);
  EXPECT_EQ(result.non_finite.count, 0u) << result.non_finite.message();
  return result;
}

uint64_t edges_on_film(const GradientResult& result) {
  for (const auto& [name, count] : result.stats.edges) {
    if (name == "moving on the film") return count;
  }
  return 0;
}

TEST(ExactFilm, CameraTermIsThatOfRays) {
  const TempFiles files;
  Scene scene = make_scene(files, crowded(files));
  scene.camera.near_clip = 2.1;
  const std::vector<std::string> parameters = {
      "body.translate.x", "ball.translate.y",   "needles.rotate.z", "lamp.translate.z",
      "floor.rotate.x",   "sensor.translate.y", "sensor.rotate.z",  "sensor.fov"};
  const GradientResult rays = camera_term(scene, parameters, false, 128);
  const GradientResult exact = camera_term(scene, parameters, true, 64);
  for (size_t k = 0; k < parameters.size(); ++k) {
    const ParameterGradient &a = exact.parameters[k], &b = rays.parameters[k];
    const ZSummary blocks = compare_moments(a.total_blocks, b.total_blocks);
    const double mse_a = mean_square(variances(a.total)), mse_b = mean_square(variances(b.total));
    fmt::print("{:20} {} blocks: z has mean {:5.2f}, deviation {:4.2f}, largest {:4.2f}; {} {}\n",
               a.name, blocks.count, blocks.mean, blocks.deviation, blocks.largest, mse_a, mse_b);
    EXPECT_GT(blocks.count, 3);
    EXPECT_TRUE(blocks.plausible(kLevel)) << a.name;
  }
  // What is hidden is not drawn.
  const auto occluded = [](const GradientResult& r) {
    const TermCost& cost = r.terms[r.term("camera")].cost;
    return static_cast<double>(cost.occluded) / static_cast<double>(cost.samples);
  };
  EXPECT_LT(occluded(exact), 0.01);
  EXPECT_GT(occluded(rays), 0.1);
  EXPECT_GT(edges_on_film(exact), 0u);
  const GradientResult again = camera_term(scene, parameters, true, 64, 1);
  for (size_t k = 0; k < parameters.size(); ++k) {
    EXPECT_EQ(means(again.parameters[k].total), means(exact.parameters[k].total));
  }
}

// The term in closed form, wherever it is known and not zero.
TEST(ExactFilm, CameraTermIsExact) {
  const std::string folder = std::string(LIMN_SOURCE_DIR) + "/scenes/closed_form/";
  std::ifstream file(folder + "references.json");
  const auto references = nlohmann::json::parse(file)["scenes"];
  std::vector<double> z;
  for (const auto& reference : references) {
    const Scene scene = read_scene(folder + reference["file"].get<std::string>(), {}, nullptr);
    if (scene.film.filter.kind != Filter::Kind::kBox) continue;
    if (scene.camera.has_lens() || scene.camera.is_orthographic()) continue;  // refused
    std::vector<std::string> names;
    std::vector<std::vector<double>> exact;
    for (const auto& p : reference["parameters"]) {
      if (!p.contains("camera") || p["camera"].is_null()) continue;
      const auto values = p["camera"].get<std::vector<double>>();
      if (std::all_of(values.begin(), values.end(), [](double v) { return v == 0; })) continue;
      names.push_back(p["name"]);
      exact.push_back(values);
    }
    if (names.empty()) continue;
    const GradientResult result = camera_term(scene, names, true, 1024);
    for (size_t k = 0; k < names.size(); ++k) {
      const Moments& total = result.parameters[k].total;
      ASSERT_EQ(total.size(), exact[k].size());
      for (size_t i = 0; i < total.size(); ++i) {
        const double residual = total.mean(i) - exact[k][i], error = std::sqrt(total.variance(i));
        const double floor =
            reference["accuracy"].get<double>() * std::max(1.0, std::fabs(exact[k][i]));
        if (error <= floor) {
          EXPECT_LE(std::fabs(residual), 8 * floor) << names[k] << " of " << reference["file"];
        } else {
          z.push_back(normal_from_student(residual / error, total.degrees()));
        }
      }
    }
  }
  const ZSummary summary = summarize(z);
  fmt::print("{} values, mean z {:.2f}, deviation {:.2f}, largest {:.2f}\n", summary.count,
             summary.mean, summary.deviation, summary.largest);
  EXPECT_GT(summary.count, 1000);
  EXPECT_GE(summary.p_largest, 1e-6);
}

// A check looks at the very gradient that is asked for: only the exact film hides no sample.
TEST(ExactFilm, IsChecked) {
  const TempFiles files;
  const Scene scene = make_scene(files, crowded(files));
  RunSettings settings;
  settings.spp = 16;
  CheckOptions options;
  options.parameter = "ball.translate.y";
  options.method = "forest";
  options.terms = {"camera"};
  options.step = 0.01;
  const auto occluded = [&](bool exact) {
    options.exact_film = exact;
    bool was = !exact;
    const auto run = [&](const Scene& s, const GradientOptions& o, const RunSettings& r) {
      was = o.exact_film;
      return gradient(s, o, r);
    };
    const CheckResult result = check(scene, options, settings, run);
    EXPECT_EQ(was, exact);
    const TermCost& cost = result.gradient.terms[result.gradient.term("camera")].cost;
    return static_cast<double>(cost.occluded) / static_cast<double>(cost.samples);
  };
  EXPECT_LT(occluded(true), 0.01);
  EXPECT_GT(occluded(false), 0.1);
}

// Of the methods of one table those that draw edges on the film take it; differences do not, nor
// does a reference.
TEST(ExactFilm, IsCompared) {
  const TempFiles files;
  const Scene scene = make_scene(files, crowded(files));
  MethodInput input{scene, "ball.translate.y"};
  RunSettings settings;
  settings.spp = 4;
  for (const bool exact : {false, true}) {
    input.exact_film = exact;
    for (const std::string name : {"forest", "fd"}) {
      const bool takes = exact && name == "forest";
      EXPECT_EQ(input.options(Method(name)).exact_film, takes);
      const auto method = make_method(input, name);
      EXPECT_GT(method->run(settings).spp, 0);
      bool told = false;
      for (const MethodSetting& setting : method->settings()) told = told || setting.name == "film";
      EXPECT_EQ(told, takes) << name;
    }
  }
  settings.seed = 4;
  const Reference with = make_reference(input, settings);
  input.exact_film = false;
  EXPECT_EQ(with.image, make_reference(input, settings).image);
  RenderOptions images;
  images.exact_film = true;
  Scene direct = scene;
  direct.max_depth = 2;
  for (const std::string name : {"path", "rays"}) {
    const auto method = make_image_method(direct, images, name, 4, settings);
    EXPECT_GT(method->run(settings).spp, 0);
    EXPECT_EQ(method->settings().back().name, name == "path" ? "film" : "rays");
  }
}

TEST(ExactFilm, SaysWhatItNeeds) {
  const TempFiles files;
  SceneParts parts = crowded(files);
  parts.film = "<rfilter type=\"tent\"/>";
  const Scene scene = make_scene(files, parts);
  const auto message = [](const auto& run) {
    try {
      run();
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const std::string filter = message([&] { render(scene, {}, {.exact_film = true}); });
  EXPECT_NE(filter.find("exact film needs a box filter"), filter.npos) << filter;
  EXPECT_NE(filter.find(".xml:"), filter.npos) << filter;
  GradientOptions options;
  options.parameters = {"body.translate.x"};
  options.method = "fd";
  options.exact_film = true;
  const std::string method = message([&] { gradient(scene, options, {}); });
  EXPECT_NE(method.find("the method \"fd\" does not"), method.npos) << method;
  CheckOptions checked;
  checked.parameter = "body.translate.x";
  checked.exact_film = true;
  EXPECT_EQ(message([&] { check(scene, checked, {}); }), filter);
  checked.method = "fd";
  EXPECT_EQ(message([&] { check(scene, checked, {}); }), method);
}

}  // namespace
}  // namespace limn
