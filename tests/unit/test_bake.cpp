// Baked views: closed forms, the images of `lines` under other maps, the transpose against a dot
// product and against reverse mode, files, refusals.
#include "limn/integrators/bake.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <functional>

#include "limn/core/environment.h"
#include "limn/core/error.h"
#include "limn/core/rng.h"
#include "limn/integrators/backward.h"
#include "support/over_floor.h"
#include "support/running_mean.h"

namespace limn {
namespace {

constexpr int kLines = 16, kSpp = 3;

RunSettings settings_of(uint64_t seed = 7, int threads = 1) {
  RunSettings settings;
  settings.spp = kSpp;
  settings.seed = seed;
  settings.threads = threads;
  return settings;
}
BakedView bake(const Scene& scene, uint64_t seed = 7, int threads = 1) {
  BakedView::Made made = BakedView::make(scene, settings_of(seed, threads), kLines);
  EXPECT_TRUE(made.complete);
  EXPECT_EQ(made.non_finite.count, 0u);
  return std::move(made.view);
}

// Texels of all magnitudes below 1, and a sun of 100.
Image random_map(int width, int height, bool sun) {
  Rng rng(5, 2, width);
  Image map(width, height, 3);
  for (float& x : map.data) x = static_cast<float>(rng.uniform());
  if (sun) map.at(width / 3, height / 4, 0) = map.at(width / 3, height / 4, 1) = 100;
  return map;
}

// Bodies, of which one hides much of the other's sky, and what the camera sees of the sky itself.
Scene bodies(const TempFiles& files, const std::string& lights, bool smooth = false) {
  Scene scene = over_floor(
      files, {{torus_mesh(16, 8), 0.8, {0.2, 1.1, 0}}, {icosphere_mesh(2), 0.5, {-0.9, 0.6, 0.6}}},
      smooth, lights);
  scene.hide_emitters = false;
  return scene;
}

// With the same lines the two differ by what angles, normals and colours lose as floats: a line's
// end by 2^-24 pi, times the map there, over at most four ends of a line and 2 pi of azimuths, on
// surfaces that scatter less than 1 / pi; views into a map by that of direction over a texel. A map
// is rotated by whole steps between lines, or its lines were others.
TEST(Bake, EqualsLinesUnderAnyMap) {
  const TempFiles files;
  const std::string lamp = square("lamp", 0.6, 90, {0.4, 2.9, 0.3}, area_light("glow", "9, 8, 7"));
  for (const std::string& lights : {constant_light("sky", "0.3, 0.4, 0.5"), make_sky(files, "map"),
                                    lamp + make_sun(files, "s")}) {
    for (const bool smooth : {false, true}) {
      Scene scene = bodies(files, lights, smooth);
      const BakedView view = bake(scene);
      for (const bool sun : {false, true}) {
        for (const SkyMap& map :
             {SkyMap{random_map(64, 32, sun)}, SkyMap{random_map(9, 5, sun), 0.5, 112.5},
              SkyMap{random_map(4, 1, sun)}}) {
          scene.environment = make_map_environment(map.texels, map.scale, map.turn, "map");
          RenderOptions options;
          options.method = "lines:azimuths=uniform";
          options.lines = kLines;
          const RenderResult lines = render(scene, settings_of(), options);
          const Image relit = view.relight(map, 1);
          ASSERT_EQ(relit.data.size(), lines.radiance.size());
          const double most = sun ? 100 : 1;
          double largest = 0;
          for (size_t i = 0; i < relit.data.size(); ++i) {
            largest = std::fmax(largest, std::fabs(relit.data[i] - lines.radiance.mean(i)));
          }
          EXPECT_LT(largest, (8 * kPi + map.texels.width) * 0x1p-24 * most + 9 * 0x1p-24) << lights;
        }
      }
    }
  }
}

// Lambert's formula: the integral of w.y over a polygon seen from the origin, over pi.
double form_factor(const SharedVector<Vec3f>& corners) {
  double sum = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    const Vec3d a = normalize(cast<double>(corners[i]));
    const Vec3d b = normalize(cast<double>(corners[(i + 1) % corners.size()])), s = cross(a, b);
    sum += std::atan2(length(s), dot(a, b)) * s.y / length(s);
  }
  return std::fabs(sum) / (2 * kPi);
}

// One pixel, so small that it is a point, the origin, in the middle of the floor.
double one_pixel(Scene scene, const Image& map) {
  Film& film = scene.film;
  const Vec3d forward = normalize(-value(scene.camera.origin)), up{0, -forward.z, forward.y};
  scene.camera.forward = {forward.x, forward.y, forward.z};
  scene.camera.up = {up.x, up.y, up.z};
  scene.camera.fov = 0.001;
  film.crop_x = film.crop_y = 8, film.crop_width = film.crop_height = 1;
  RunSettings settings = settings_of();
  settings.spp = 16;
  return BakedView::make(scene, settings, 4096).view.relight({map}, 1).data[0];
}

TEST(Bake, ClosedForms) {
  const TempFiles files;
  const std::string sky = constant_light("sky", "1, 1, 1");
  const double albedo = 0.8;
  Image white(8, 4, 3);
  for (float& x : white.data) x = 1;
  // The sun side of two halves that meet over the pole.
  Image half = white;
  for (int y = 0; y < half.height; ++y) {
    for (int x = 0; x < 4; ++x) half.at(x, y, 0) = 0;
  }
  const Scene open = over_floor(files, {}, false, sky);
  // Floats: the image is one.
  EXPECT_NEAR(one_pixel(open, white), albedo, 1e-6);
  EXPECT_NEAR(one_pixel(open, half), albedo / 2, 1e-6);
  // A wall behind the point, and a triangle above, seen from below.
  const Mesh wall =
      make_mesh({{-9, 0, -0.5}, {9, 0, -0.5}, {9, 8, -0.5}, {-9, 8, -0.5}}, {{0, 1, 2}, {0, 2, 3}});
  const Mesh triangle = make_mesh({{-1, 1, -1}, {1.5, 1.25, -1}, {0.25, 0.75, 1}}, {{0, 1, 2}});
  for (const Mesh& mesh : {wall, triangle}) {
    EXPECT_NEAR(one_pixel(over_floor(files, {{mesh}}, false, sky), white),
                albedo * (1 - form_factor(mesh.positions)), 1e-5);
  }
}

TEST(Bake, ThreadsDoNotMatter) {
  const TempFiles files;
  const Scene scene = bodies(files, make_sky(files, "map"));
  const BakedView one = bake(scene);
  const std::string bytes = one.bytes();
  EXPECT_EQ(bake(scene, 7, 3).bytes(), bytes);
  const SkyMap map{random_map(16, 8, true)};
  const Image image = one.relight(map, 1);
  EXPECT_EQ(one.relight(map, 3).data, image.data);
  EXPECT_EQ(BakedView::of_bytes(bytes, "file").relight(map, 1).data, image.data);
}

double dot_of(const Image& a, const Image& b) {
  double sum = 0;
  for (size_t i = 0; i < a.data.size(); ++i) sum += double{a.data[i]} * b.data[i];
  return sum;
}
Image random_image(const Image& like, uint64_t seed) {
  Rng rng(seed, 1, 1);
  Image image = like;
  for (float& x : image.data) x = static_cast<float>(rng.uniform() - 0.5);
  return image;
}

// y . (A x) = (A^T y) . x, but for images and gradients being floats.
TEST(Bake, AdjointIsTheTranspose) {
  const TempFiles files;
  const BakedView view = bake(bodies(files, constant_light("sky", "1, 1, 1"), true));
  for (SkyMap map : {SkyMap{random_map(64, 32, false)}, SkyMap{random_map(9, 5, false), 0.5, 112.5},
                     SkyMap{random_map(4, 1, false)}}) {
    map.texels = random_image(map.texels, 3);
    const Image image = view.relight(map, 1), y = random_image(image, 4);
    const Image slopes = view.texel_adjoint(map, y);
    double magnitude = 0;
    for (size_t i = 0; i < y.data.size(); ++i) magnitude += std::fabs(y.data[i] * image.data[i]);
    for (size_t i = 0; i < slopes.data.size(); ++i) {
      magnitude += std::fabs(slopes.data[i] * map.texels.data[i]);
    }
    const double forward = dot_of(y, image);
    EXPECT_NEAR(dot_of(slopes, map.texels), forward, 0x1p-23 * magnitude);
    EXPECT_GT(std::fabs(forward), 1e-3 * magnitude);
  }
}

// Of reverse mode by paths, along two directions of the texels.
TEST(Bake, AdjointAgreesWithReverseMode) {
  const TempFiles files;
  Scene scene = bodies(files, constant_light("sky", "1, 1, 1"));
  const SkyMap map{random_map(16, 8, false), 2, 30};
  const Image y = random_map(16, 16, false), up = random_map(16, 8, false);
  RunningMean by_lines, by_paths;
  Scene lit = scene;
  lit.environment = make_map_environment(map.texels, map.scale, map.turn, "map");
  std::string name;
  for (const Parameter& parameter : list_parameters(lit)) {
    if (parameter.name.ends_with(".data")) name = parameter.name;
  }
  BackwardOptions options;
  options.parameters = {name};
  for (uint64_t seed = 0; seed < 16; ++seed) {
    by_lines.add(dot_of(bake(scene, seed).texel_adjoint(map, y), up));
    RunSettings settings = settings_of(seed);
    settings.spp = 64;
    const Moments& slopes = backward(lit, y, options, settings).parameters[0].moments;
    double sum = 0;
    for (size_t i = 0; i < up.data.size(); ++i) sum += slopes.mean(i) * up.data[i];
    by_paths.add(sum);
  }
  const double error = std::hypot(by_lines.standard_error(), by_paths.standard_error());
  fmt::print("{} +- {}, {} +- {}\n", by_lines.mean(), by_lines.standard_error(), by_paths.mean(),
             by_paths.standard_error());
  EXPECT_LT(std::fabs(by_lines.mean() - by_paths.mean()), 4 * error);
  EXPECT_LT(error, 0.02 * std::fabs(by_paths.mean()));
}

std::string refusal(const std::function<void()>& act) {
  try {
    act();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Bake, SaysWhatItDoesNotKnow) {
  const TempFiles files;
  const std::string sky = constant_light("sky", "1, 1, 1");
  const auto refused = [](const Scene& scene, int lines = kLines) {
    return refusal([&] { BakedView::make(scene, settings_of(), lines); });
  };
  EXPECT_NE(refused(over_floor(files, {})).find("no environment"), std::string::npos);
  Scene scene = over_floor(files, {}, false, sky);
  EXPECT_EQ(refused(scene), "");
  EXPECT_NE(refused(scene, 0).find("lines: "), std::string::npos);
  scene.max_depth = 3;
  EXPECT_NE(refused(scene).find("bake: direct light alone"), std::string::npos);
  scene =
      over_floor(files, {}, false, sky + square("mirror", 1, 0, {0, 1, 0}, conductor("m", 0.1)));
  EXPECT_NE(refused(scene).find("bake: shape \"mirror\": only untextured diffuse surfaces are "
                                "supported, this is roughconductor"),
            std::string::npos);
  EXPECT_NE(refused(scene).find(": make it diffuse, or render under each map"), std::string::npos);
  scene = over_floor(files, {}, false, sky + "<emitter type=\"point\" id=\"bulb\"/>");
  EXPECT_NE(refused(scene).find("bake: emitter \"bulb\": only area lights and the environment map "
                                "are supported: remove it"),
            std::string::npos);
  scene = over_floor(files, {}, false, sky);
  scene.camera.aperture_radius = 0.1;
  EXPECT_NE(refused(scene).find("needs a pinhole"), std::string::npos);

  const BakedView view = bake(over_floor(files, {{cube_mesh()}}, false, sky));
  const auto check = [&](const Scene& now) { return refusal([&] { view.check_scene(now); }); };
  EXPECT_EQ(check(over_floor(files, {{cube_mesh()}}, false, constant_light("other", "2, 3, 4"))),
            "");
  EXPECT_NE(check(over_floor(files, {{cube_mesh(), 1.01}}, false, sky)).find("bake it again"),
            std::string::npos);
  Image bad(2, 2, 3), small(2, 2, 3);
  bad.data[5] = std::numeric_limits<float>::infinity();
  EXPECT_NE(refusal([&] { view.relight({bad}, 1); }).find("the map"), std::string::npos);
  EXPECT_NE(refusal([&] { view.texel_adjoint({small}, small); }).find("16 x 16"),
            std::string::npos);
  Image none(16, 16, 3);
  none.data[7] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NE(refusal([&] { view.texel_adjoint({small}, none); }).find("the adjoint image"),
            std::string::npos);
}

TEST(Bake, FilesThatAreNone) {
  const TempFiles files;
  const std::string bytes =
      bake(over_floor(files, {}, false, constant_light("sky", "1, 1, 1"))).bytes();
  const auto refused = [](const std::string& text) {
    return refusal([&] { BakedView::of_bytes(text, "a.bake"); });
  };
  EXPECT_EQ(refused(bytes), "");
  EXPECT_EQ(refused("hello"), "a.bake: error: is no file of `limn bake`");
  EXPECT_EQ(refused("limn bake 2" + bytes.substr(11)),
            "a.bake: error: was written by another version of limn: bake the scene again");
  // Cut off anywhere, or with any bit turned.
  for (size_t size = 0; size < bytes.size(); size += 97) {
    EXPECT_NE(refused(bytes.substr(0, size)), "") << size;
  }
  for (size_t i = 0; i < bytes.size(); i += 89) {
    std::string turned = bytes;
    turned[i] = static_cast<char>(turned[i] ^ 1 << i % 8);
    EXPECT_NE(refused(turned), "") << i;
  }
}

}  // namespace
}  // namespace limn
