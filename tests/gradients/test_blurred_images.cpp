// Images of blurred faces and their derivatives: closed forms, and differences of such images.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/blur_tracer.h"
#include "limn/core/error.h"
#include "limn/integrators/check.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/render.h"
#include "limn/integrators/statistics.h"
#include "support/meshes.h"
#include "support/motion_scenes.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr double kLevel = 1e-4;

RunSettings run_settings(int spp, uint64_t seed, int threads = 1) {
  RunSettings settings;
  settings.spp = spp;
  settings.seed = seed;
  settings.threads = threads;
  return settings;
}

// All channels are alike: the first is compared, in pixels where `image`, between 0 and `most`, is
// no rare event.
void expect_equal(const std::string& name, const Moments& moments, const std::vector<double>& exact,
                  const std::vector<double>& image, double most) {
  std::vector<double> z;
  for (size_t i = 0; i < exact.size(); i += 3) {
    if (std::fabs(image[i] / most - 0.5) > 0.47) continue;
    const double residual = moments.mean(i) - exact[i];
    z.push_back(normal_from_student(residual / std::sqrt(moments.variance(i)), moments.degrees()));
  }
  const ZSummary summary = summarize(z);
  fmt::print("{:16} {:3} values, mean z {:5.2f}, largest |z| {:5.2f}\n", name, summary.count,
             summary.mean, summary.largest);
  EXPECT_GT(summary.count, 0) << name;
  EXPECT_TRUE(summary.plausible(kLevel)) << name;
}

Moments image_of(const Scene& scene, const Blur& blur, int spp, uint64_t seed,
                 const std::string& method = "blurred") {
  RenderOptions options;
  options.method = Method(method);
  options.blur = blur;
  return render(scene, run_settings(spp, seed), options).radiance;
}
GradientResult gradient_of(const Scene& scene, const std::vector<std::string>& names,
                           const Blur& blur, int spp, uint64_t seed, int threads = 1) {
  GradientOptions options;
  options.parameters = names;
  options.method = Method("blurred");
  options.blur = blur;
  return gradient(scene, options, run_settings(spp, seed, threads));
}

// The image of a function on the plane z = 0, and that of its slope along x: seen along -z from a
// distance of 4, 12 pixels from x = -1 to 1.
constexpr double kDistance = 4;
constexpr int kWidth = 12, kHeight = 2;
SceneParts view_of(const std::string& body) {
  SceneParts parts;
  parts.origin = {0, 0, kDistance};
  parts.target = {0, 0, 0};
  parts.width = kWidth;
  parts.height = kHeight;
  parts.fov = 2 * std::atan(1 / kDistance) * 180 / kPi;
  parts.body = body;
  return parts;
}
template <class F>
std::vector<double> pixels_of(const F& f) {
  std::vector<double> pixels;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    constexpr int kSteps = 2000;
    double sum = 0;
    for (int n = 0; n < kSteps; ++n) {
      sum += f(-1 + 2.0 / kWidth * (i % kWidth + (n + 0.5) / kSteps)) / kSteps;
    }
    for (int c = 0; c < 3; ++c) pixels.push_back(sum);
  }
  return pixels;
}
double slope(double d, double sigma) { return blur_opacity(Dual(d, {1, 0, 0, 0}), sigma).d[0]; }

// A half-plane that ends at x = 0.2: a lamp, and a black board before a sky.
TEST(BlurredImages, OfAHalfPlaneAreThoseOfItsOpacity) {
  const TempFiles files;
  const double end = 0.2, sigma = 0.2, radiance = 3;
  const Blur blur{sigma};
  const Scene lamp = make_scene(
      files, view_of(square("board", 8, 0, {8 + end, 0, 0}, area_light("glow", "3, 3, 3"))));
  const Scene board =
      make_scene(files, view_of(square("board", 8, 0, {8 + end, 0, 0}, diffuse("soot", "0, 0, 0")) +
                                constant_light("sky", "3, 3, 3")));
  for (const bool glows : {true, false}) {
    const Scene& scene = glows ? lamp : board;
    const double sign = glows ? 1 : -1;
    const auto image = pixels_of([&](double x) {
      const double a = blur_opacity(x - end, sigma);
      return radiance * (glows ? a : 1 - a);
    });
    const auto along_x =
        pixels_of([&](double x) { return -sign * radiance * slope(x - end, sigma); });
    const auto along_z = pixels_of(
        [&](double x) { return -sign * radiance * x / kDistance * slope(x - end, sigma); });
    std::vector<double> of_camera = along_x;
    for (double& v : of_camera) v = -v;
    expect_equal("image", image_of(scene, blur, 1024, 1), image, image, radiance);
    const auto result = gradient_of(
        scene, {"board.translate.x", "board.translate.z", "sensor.translate.x"}, blur, 4096, 2);
    expect_equal("its own image", result.radiance, image, image, radiance);
    expect_equal("along x", result.parameters[0].total, along_x, image, radiance);
    expect_equal("along z", result.parameters[1].total, along_z, image, radiance);
    expect_equal("of the camera", result.parameters[2].total, of_camera, image, radiance);
    // Above one parameter a second pass begins: its samples are the same.
    const auto five = gradient_of(scene,
                                  {"board.translate.y", "board.translate.y", "board.translate.y",
                                   "board.translate.y", "board.translate.x"},
                                  blur, 4096, 3);
    expect_equal("in a second pass", five.parameters[4].total, along_x, image, radiance);
  }
}

// The diagonal of a square, in view, is no seam.
TEST(BlurredImages, OfCoplanarFacesHaveNoSeams) {
  const TempFiles files;
  const double sigma = 0.0025, half = 0.5;
  const Scene scene = make_scene(
      files, view_of(square("board", half, 0, {0, 0, 0}, area_light("glow", "3, 3, 3"))));
  const auto image =
      pixels_of([&](double x) { return 3 * blur_opacity(half - std::fabs(x), sigma); });
  expect_equal("image", image_of(scene, {sigma}, 1024, 4), image, image, 3);
  const auto along_x =
      pixels_of([&](double x) { return 3 * slope(half - std::fabs(x), sigma) * (x > 0 ? 1 : -1); });
  const auto result = gradient_of(scene, {"board.translate.x"}, {sigma}, 4096, 5);
  expect_equal("along x", result.parameters[0].total, along_x, image, 3);
}

// Mean over each pixel of a function of where its rays meet the floor y = 0.
template <class F>
std::vector<double> floor_pixels(const Scene& scene, const F& f) {
  std::vector<double> pixels;
  for (int y = 0; y < scene.film.crop_height; ++y) {
    for (int x = 0; x < scene.film.crop_width; ++x) {
      constexpr int kSteps = 40;
      double sum = 0;
      for (int n = 0; n < kSteps * kSteps; ++n) {
        const auto ray = scene.camera.ray<double>(x + (n % kSteps + 0.5) / kSteps,
                                                  y + (n / kSteps + 0.5) / kSteps);
        sum += f(ray.origin - ray.direction * (ray.origin.y / ray.direction.y));
      }
      for (int c = 0; c < 3; ++c) pixels.push_back(sum / (kSteps * kSteps));
    }
  }
  return pixels;
}

SceneParts under_screen(const std::string& light) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {1.2, 0.5, 0};
  parts.target = {0, 0, 0};
  parts.fov = 20;
  parts.width = parts.height = 6;
  parts.body = square("floor", 8, -90, {0, 0, 0}, diffuse("chalk", "0.5, 0.5, 0.5")) +
               square("screen", 4, -90, {-4, 1, 0}, diffuse("card", "0.5, 0.5, 0.5")) + light;
  return parts;
}

// A screen over x < 0 in the light from straight above.
TEST(BlurredImages, HaveShadowsOfDirectionalLights) {
  const TempFiles files;
  const double sigma = 0.01, irradiance = 2, scattered = 0.5 / kPi;
  const Scene scene = make_scene(
      files, under_screen(R"(<emitter type="directional"><vector name="direction" value="0,-1,0"/>
                      <rgb name="irradiance" value="2,2,2"/></emitter>)"));
  const auto image = floor_pixels(scene, [&](const Vec3d& p) {
    return scattered * irradiance * (1 - blur_opacity(-p.x, sigma));
  });
  const auto along_x = floor_pixels(
      scene, [&](const Vec3d& p) { return -scattered * irradiance * slope(-p.x, sigma); });
  expect_equal("image", image_of(scene, {sigma}, 256, 6), image, image, scattered * irradiance);
  const auto result = gradient_of(scene, {"screen.translate.x"}, {sigma}, 256, 7);
  expect_equal("along x", result.parameters[0].total, along_x, image, scattered * irradiance);
  const auto all = image_of(scene, {sigma, 0.01}, 256, 8);
  expect_equal("with gamma", all, image, image, scattered * irradiance);
}

// The weights of a square of two faces at a point of its plane.
double square_opacity(const Scene& scene, ShapeId shape, const Vec3d& offset, const Vec3d& x,
                      double sigma) {
  double sum = 0;
  for (uint32_t f = 0; f < 2; ++f) {
    auto c = face_corners<double>(scene.shape(shape).mesh, FaceId(f));
    for (Vec3d& y : c) y = y + offset;
    sum += blur_opacity(distance_to_sides(c, x), sigma);
  }
  return std::min(sum, 1.0);
}

// A lamp above a screen over x < 0, by quadrature over all that the lamp has been blurred to.
TEST(BlurredImages, HaveShadowsOfBlurredLamps) {
  const TempFiles files;
  const double sigma = 0.01, height = 2, half = 0.4, radiance = 5;
  SceneParts parts =
      under_screen(square("lamp", half, 90, {0.1, height, 0}, area_light("glow", "5, 5, 5")));
  parts.target = {0.2, 0, 0};
  parts.fov = 0.01;
  parts.width = parts.height = 2;
  const Scene scene = make_scene(files, parts);
  const Vec3d p{0.2, 0, 0};
  const double reach = Blur{sigma}.reach();
  const auto radiance_of = [&](double screen, double lamp) {
    constexpr int kSteps = 500;
    const double size = 2 * (half + reach), area = size * size / (kSteps * kSteps);
    double sum = 0;
    for (int n = 0; n < kSteps * kSteps; ++n) {
      const Vec3d y{0.1 + lamp + size * ((n % kSteps + 0.5) / kSteps - 0.5), height,
                    size * ((n / kSteps + 0.5) / kSteps - 0.5)};
      const double r2 = length_squared(y - p), cosine = height / std::sqrt(r2);
      const Vec3d through = p + (y - p) * (1 / height);
      sum += area * cosine * cosine / r2 * radiance *
             square_opacity(scene, ShapeId(2), {lamp, 0, 0}, y, sigma) *
             (1 - square_opacity(scene, ShapeId(1), {screen, 0, 0}, through, sigma));
    }
    return sum * 0.5 / kPi;
  };
  const auto everywhere = [&](double v) { return std::vector<double>(12, v); };
  const double h = 1e-4;
  expect_equal("image", image_of(scene, {sigma}, 16384, 8), everywhere(radiance_of(0, 0)),
               everywhere(0.5), 1);
  const auto result =
      gradient_of(scene, {"screen.translate.x", "lamp.translate.x"}, {sigma}, 16384, 9);
  expect_equal("of the screen", result.parameters[0].total,
               everywhere((radiance_of(h, 0) - radiance_of(-h, 0)) / (2 * h)), everywhere(0.5), 1);
  expect_equal("of the lamp", result.parameters[1].total,
               everywhere((radiance_of(0, h) - radiance_of(0, -h)) / (2 * h)), everywhere(0.5), 1);
}

// A cube over a glossy floor, a lamp beside it and a sky: all that paths meet.
Scene cube_over_floor(const TempFiles& files) {
  SceneParts parts;
  parts.max_depth = 4;
  parts.rr_depth = 2;
  parts.width = parts.height = 8;
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.4)) +
               obj_shape("cube", write_mesh(files, "cube.obj", cube_mesh()), true, 0.6,
                         {0.2, 0.7, 0.1}, diffuse("clay", "0.7, 0.5, 0.3")) +
               square("lamp", 1, 90, {0.3, 2.4, 0.5}, area_light("glow", "2, 2, 2")) +
               constant_light("sky", "0.3, 0.4, 0.5");
  return make_scene(files, parts);
}

// A cube that falls behind a pane of glass, over a painted floor and before a mirror.
Scene cube_behind_glass(const TempFiles& files, double close) {
  Image map(4, 4, 3);
  for (size_t i = 0; i < map.data.size(); ++i) {
    map.data[i] = 0.3f + 0.1f * static_cast<float>(i * 7 % 5);
  }
  write_exr(files.path("paint.exr"), map, false, {});
  SceneParts parts;
  parts.max_depth = 5;
  parts.rr_depth = 3;
  parts.width = parts.height = 8;
  const std::string cube = write_mesh(files, "cube.obj", cube_mesh());
  parts.body =
      square("floor", 2.5, -90, {0, 0, 0},
             R"(<bsdf type="diffuse" id="paint"><texture type="bitmap" name="reflectance">
                <string name="filename" value=")" +
                 files.path("paint.exr") +
                 R"("/><boolean name="raw" value="true"/></texture></bsdf>)") +
      animated(obj_shape("cube", cube, true, 0.5, {0.2, 0.9, 0.1}, diffuse("clay", ".7, .5, .3")),
               {0.3, -0.4, 0}, 20) +
      obj_shape("pane", cube, true, 0.4, {-0.1, 1.2, 2.5},
                R"(<bsdf type="dielectric" id="glass"/>)") +
      square("mirror", 1.5, 0, {0, 1, -1.5}, R"(<bsdf type="conductor"/>)") +
      square("lamp", 1, 90, {0.3, 3, 0.5}, area_light("glow", "2, 2, 2")) +
      constant_light("sky", "0.3, 0.4, 0.5");
  return scene_of_text(with_shutter(parts, 0, close));
}

// Numbers of arrays, textures, what smooth lobes turn, and times.
TEST(BlurredImages, DeriveWhatMovesBehindGlass) {
  const TempFiles files;
  const Scene still = cube_behind_glass(files, 0), moving = cube_behind_glass(files, 1);
  CheckOptions options;
  options.method = Method("blurred");
  options.blur = {0.02, 0};
  for (const auto& [scene, name, spp] : {std::tuple(&still, "glass.eta", 4096),
                                         {&still, "paint.reflectance.data.1.2.g", 256},
                                         {&still, "cube.vertex_positions.3.x", 512},
                                         {&still, "mirror.rotate.y", 512},
                                         {&moving, "cube.velocity.x", 128}}) {
    options.parameter = name;
    const CheckResult result = check(*scene, options, run_settings(spp, 12));
    fmt::print("{:28} {} {:10.4g} +- {:8.2g}, differences {:10.4g} +- {:8.2g}, z {:5.2f}\n", name,
               verdict_name(result.verdict), result.total.gradient, result.total.gradient_error,
               result.total.difference, result.total.difference_error, result.total.z);
    EXPECT_NE(result.verdict, Verdict::kDisagree) << name;
    EXPECT_NE(result.total.gradient, 0) << name;
  }
}

class BlurredGradients : public testing::TestWithParam<std::tuple<std::string, double>> {};

TEST_P(BlurredGradients, AreThoseOfBlurredImages) {
  const TempFiles files;
  const Scene scene = cube_over_floor(files);
  CheckOptions options;
  options.method = Method(std::get<0>(GetParam()));
  options.blur = {0.04, std::get<1>(GetParam())};
  for (const char* name : {"cube.translate.x", "cube.rotate.y", "lamp.translate.x",
                           "sensor.translate.x", "clay.reflectance", "gloss.alpha"}) {
    options.parameter = name;
    const CheckResult result = check(scene, options, run_settings(1024, 10));
    fmt::print("{:20} {} {:10.4g} +- {:8.2g}, differences {:10.4g} +- {:8.2g}, z {:5.2f}\n", name,
               verdict_name(result.verdict), result.total.gradient, result.total.gradient_error,
               result.total.difference, result.total.difference_error, result.total.z);
    EXPECT_NE(result.verdict, Verdict::kDisagree) << name;
    EXPECT_NE(result.total.gradient, 0) << name;
  }
}
INSTANTIATE_TEST_SUITE_P(, BlurredGradients,
                         testing::Values(std::tuple("blurred", 0.0), std::tuple("blurred", 0.05),
                                         std::tuple("blurred-published", 0.0)),
                         [](const auto& test) { return fmt::format("Case{}", test.index); });

TEST(BlurredThreads, HaveTheSameBitsOnAnyNumberOfThreads) {
  const TempFiles files;
  const Scene scene = cube_over_floor(files);
  const auto one = gradient_of(scene, {"cube.translate.x"}, {}, 4, 11, 1);
  const auto three = gradient_of(scene, {"cube.translate.x"}, {}, 4, 11, 3);
  for (size_t i = 0; i < one.radiance.size(); ++i) {
    EXPECT_EQ(one.radiance.mean(i), three.radiance.mean(i));
    EXPECT_EQ(one.parameters[0].total.mean(i), three.parameters[0].total.mean(i));
  }
}

std::string message_of(const std::function<void()>& act) {
  try {
    act();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(BlurredImages, RefuseByNameWhatTheyDoNotKnow) {
  const TempFiles files;
  const auto refusal = [&](const std::string& bsdf) {
    const Scene scene = make_scene(files, view_of(square("board", 1, 0, {0, 0, 0}, bsdf)));
    return message_of([&] { image_of(scene, {}, 1, 1); });
  };
  EXPECT_NE(refusal(R"(<bsdf type="thindielectric"/>)").find("masks and thin panes"),
            std::string::npos);
  EXPECT_NE(
      refusal(R"(<bsdf type="diffuse"><texture type="checkerboard" name="reflectance"/></bsdf>)")
          .find("textures with discontinuities"),
      std::string::npos);
  const Scene ball =
      make_scene(files, view_of(obj_shape("ball", write_mesh(files, "b.obj", icosphere_mesh(1)),
                                          false, 1, {0, 0, 0}, diffuse("clay", "1, 1, 1"))));
  EXPECT_NE(message_of([&] { image_of(ball, {}, 1, 1); }).find("interpolated normals"),
            std::string::npos);
  RenderOptions options;
  options.blur.sigma = 1;
  EXPECT_EQ(message_of([&] { render(ball, run_settings(1, 1), options); }),
            "error: sigma and gamma are for the methods blurred and blurred-published");
}

}  // namespace
}  // namespace limn
