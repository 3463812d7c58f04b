// Positions on the film that follow what they see, in reverse mode: whatever they do, the mean
// stays; they take out most of the variance of fine detail, and leave other scenes alone.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/rng.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/statistics.h"
#include "support/meshes.h"
#include "support/running_mean.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr double kAlways = 0, kNever = 2;  // least_detail

Image random_adjoint(const Scene& scene) {
  Image adjoint(scene.film.crop_width, scene.film.crop_height, 3);
  for (size_t i = 0; i < adjoint.data.size(); ++i) {
    adjoint.data[i] = static_cast<float>(2 * Rng(3, i, 0).uniform() - 1);
  }
  return adjoint;
}

constexpr char kMirror[] = R"(<bsdf type="conductor"/>)";
constexpr char kBulb[] = R"(<emitter type="point" id="bulb">
    <point name="position" value="-1.5,3.2,1.6"/><rgb name="intensity" value="5,5,5"/></emitter>)";

// Edges on the film, of soft shadows, in gloss, and those of a mirror or of a bulb's sharp shadows;
// more at rest than move.
Scene ball_and_screens(const TempFiles& files, const std::string& film, bool mirror, bool bulb) {
  SceneParts parts;
  parts.film = film;
  parts.width = parts.height = 8;
  parts.max_depth = 3;
  parts.body =
      square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.3)) +
      square("mirror", 0.4, 20, {0.6, 0.4, -1}, mirror ? kMirror : conductor("satin", 0.3)) +
      square("screen", 0.3, 20, {-0.8, 0.9, -0.3}, diffuse("soot", "0.1, 0.1, 0.1")) +
      obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), true, 0.4,
                {0.4, 0.8, 0.2}, diffuse("clay", "0.7, 0.5, 0.3")) +
      square("lamp", 0.2, 90, {0.3, 2.4, 0.5}, area_light("glow", "30, 25, 20")) +
      (bulb ? kBulb : "") + make_sky(files, "sky");
  return make_scene(files, parts);
}

TEST(FilmField, HasTheMeanOfPositionsThatAreHeld) {
  const TempFiles files;
  std::vector<double> z;
  size_t films = 0;
  for (const char* film :
       {R"(<rfilter type="box"/>)", R"(<rfilter type="tent"/>)", R"(<rfilter type="gaussian"/>)",
        R"(<rfilter type="mitchell"/>)",
        R"(<rfilter type="gaussian"/><boolean name="sample_border" value="true"/>)"}) {
    const bool mirror = films % 2 == 0;
    const Scene scene = ball_and_screens(files, film, mirror, !mirror);
    const Image adjoint = random_adjoint(scene);
    // All methods with the first film, then one each.
    const std::vector<std::string> all = {"silhouettes", "adaptive", "forest"};
    const auto methods = films == 0 ? all : std::vector{all[films % 3]};
    ++films;
    for (const std::string& method : methods) {
      BackwardOptions options;
      options.method = Method(method);
      options.batches = 64;
      options.parameters = {"ball.translate.x",   "ball.translate.y",   "ball.scale",
                            "mirror.translate.x", "sensor.translate.x", "sensor.fov"};
      RunSettings settings;
      settings.spp = method == "adaptive" ? 1300 : 1024;
      settings.threads = 2;
      options.least_detail = kAlways;
      settings.seed = 1;
      const BackwardResult follows = backward(scene, adjoint, options, settings);
      EXPECT_STREQ(follows.terms.back().name.c_str(), "filter");
      EXPECT_EQ(follows.non_finite.count, 0u);
      if (method == "adaptive") {
        EXPECT_NE(follows.decision, "");
        options.method = Method("forest");
      }
      options.least_detail = kNever;
      settings.seed = 2;
      const BackwardResult held = backward(scene, adjoint, options, settings);
      for (const std::string& name : options.parameters) {
        const Moments &a = follows.of(name).moments, &b = held.of(name).moments;
        const double score = (a.mean(0) - b.mean(0)) / std::sqrt(a.variance(0) + b.variance(0));
        fmt::print("{:12} {:20} {:9.3g} +- {:7.2g}  held {:9.3g} +- {:7.2g}  z {:.2f}\n", method,
                   name, a.mean(0), std::sqrt(a.variance(0)), b.mean(0), std::sqrt(b.variance(0)),
                   score);
        z.push_back(score);
      }
    }
  }
  const ZSummary summary = summarize(z);
  EXPECT_GE(summary.p_largest, 1e-6);
}

// Where edges are missing, what positions do has no mean of zero: a bulb's shadows in a mirror.
TEST(FilmField, IsHeldWhereEdgesAreMissing) {
  const TempFiles files;
  const Scene scene = ball_and_screens(files, R"(<rfilter type="box"/>)", true, true);
  BackwardOptions options;
  options.parameters = {"ball.translate.x"};
  options.least_detail = kAlways;
  RunSettings settings;
  settings.spp = 2;
  const BackwardResult result = backward(scene, random_adjoint(scene), options, settings);
  for (const TermRun& term : result.terms) EXPECT_NE(term.name, "filter");
}

// Triangles about as large as twice `size`, which fill the view.
Scene triangles(const TempFiles& files, int count, double size) {
  std::vector<Vec3f> positions;
  std::vector<FaceIndices> faces;
  Rng rng(8, 0, 0);
  for (int i = 0; i < count; ++i) {
    double center[3];
    for (double& c : center) c = 3 * rng.uniform() - 1.5;
    for (int k = 0; k < 3; ++k) {
      const double x = center[0] + size * (2 * rng.uniform() - 1);
      const double y = center[1] + size * (2 * rng.uniform() - 1);
      const double z = center[2] / 3 + size * (2 * rng.uniform() - 1);
      positions.emplace_back(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
    }
    const auto first = static_cast<uint32_t>(3 * i);
    faces.push_back({first, first + 1, first + 2});
  }
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 0, 5};
  parts.target = {0, 0, 0};
  parts.fov = 28;
  parts.body =
      obj_shape("leaves", write_mesh(files, "leaves.obj", make_mesh(positions, faces)), true, 1,
                {0, 0, 0},
                R"(<bsdf type="twosided">)" + diffuse("green", "0.3, 0.6, 0.2") + "</bsdf>") +
      square("lamp", 0.5, 60, {1, 3, 4}, area_light("glow", "30, 25, 20")) + make_sky(files, "sky");
  return make_scene(files, parts);
}

// Neighbouring pixels alike.
Image smooth_adjoint(const Scene& scene) {
  Image adjoint(scene.film.crop_width, scene.film.crop_height, 3);
  for (int y = 0; y < adjoint.height; ++y) {
    for (int x = 0; x < adjoint.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        adjoint.at(x, y, c) = static_cast<float>(std::sin(0.3 * x + 0.2 * y + c));
      }
    }
  }
  return adjoint;
}

TEST(FilmField, TakesOutWhatFineDetailCosts) {
  const TempFiles files;
  const Scene scene = triangles(files, 3000, 0.12);
  const Image adjoint = smooth_adjoint(scene);
  BackwardOptions options;
  options.parameters = {"leaves.translate.x", "leaves.translate.y", "leaves.rotate.z"};
  options.batches = 64;
  RunSettings settings;
  settings.spp = 64;
  settings.threads = 2;
  RunningMean gain;
  for (uint64_t run = 0; run < 8; ++run) {
    settings.seed = 2 * run;
    options.least_detail = BackwardOptions().least_detail;
    const BackwardResult follows = backward(scene, adjoint, options, settings);
    ++settings.seed;
    options.least_detail = kNever;
    const BackwardResult held = backward(scene, adjoint, options, settings);
    double log_gain = 0;
    for (size_t p = 0; p < options.parameters.size(); ++p) {
      log_gain += std::log(held.parameters[p].moments.variance(0) /
                           follows.parameters[p].moments.variance(0)) /
                  static_cast<double>(options.parameters.size());
    }
    gain.add(log_gain);
  }
  fmt::print("variance of positions that are held: {:.1f} times (log +- {:.2f})\n",
             std::exp(gain.mean()), gain.standard_error());
  EXPECT_GT(gain.z_score(std::log(2.0)), 3);
}

// Where `adaptive` chooses numbers of samples, too: the same mean, on any number of threads.
TEST(FilmField, IsRightBehindAPilot) {
  const TempFiles files;
  const Scene scene = triangles(files, 1000, 0.16);
  const Image adjoint = smooth_adjoint(scene);
  BackwardOptions options;
  options.parameters = {"leaves.translate.x", "leaves.translate.y", "leaves.rotate.z",
                        "leaves.scale"};
  options.batches = 64;
  RunSettings settings;
  settings.spp = 1 + 85000 / (scene.film.crop_width * scene.film.crop_height);
  settings.threads = 3;
  options.method = Method("adaptive");
  const BackwardResult chosen = backward(scene, adjoint, options, settings);
  EXPECT_NE(chosen.decision, "");
  EXPECT_EQ(chosen.terms.back().name, "filter");
  EXPECT_GT(chosen.terms.back().samples, 0);
  settings.threads = 1;
  const BackwardResult alike = backward(scene, adjoint, options, settings);
  options.method = Method("forest");
  settings.threads = 2;
  settings.spp *= 4;
  settings.seed = 7;
  const BackwardResult usual = backward(scene, adjoint, options, settings);
  EXPECT_EQ(usual.terms.back().samples, chosen.terms.back().samples);
  std::vector<double> z;
  for (size_t p = 0; p < options.parameters.size(); ++p) {
    const Moments &a = chosen.parameters[p].moments, &b = usual.parameters[p].moments;
    EXPECT_EQ(a.mean(0), alike.parameters[p].moments.mean(0));
    z.push_back((a.mean(0) - b.mean(0)) / std::sqrt(a.variance(0) + b.variance(0)));
    fmt::print("{:20} {:9.3g} +- {:7.2g}, usual {:9.3g} +- {:7.2g}, z {:.2f}\n",
               options.parameters[p], a.mean(0), std::sqrt(a.variance(0)), b.mean(0),
               std::sqrt(b.variance(0)), z.back());
  }
  EXPECT_GE(summarize(z).p_largest, 1e-6);
}

TEST(FilmField, LeavesCoarseScenesAlone) {
  const TempFiles files;
  const Scene scene = triangles(files, 3, 1);
  const Image adjoint = random_adjoint(scene);
  BackwardOptions options;
  options.parameters = {"leaves.vertex_positions"};
  RunSettings settings;
  settings.spp = 4;
  const BackwardResult usual = backward(scene, adjoint, options, settings);
  options.least_detail = kNever;
  const BackwardResult held = backward(scene, adjoint, options, settings);
  ASSERT_EQ(usual.terms.size(), held.terms.size());
  const Moments &a = usual.parameters[0].moments, &b = held.parameters[0].moments;
  for (size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a.mean(i), b.mean(i));
}

}  // namespace
}  // namespace limn
