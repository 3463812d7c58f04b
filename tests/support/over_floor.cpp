// Bodies over a floor, and runs of the methods that look around.
#include "support/over_floor.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/image.h"
#include "support/compare_moments.h"

namespace limn {

Scene over_floor(const TempFiles& files, const std::vector<Body>& bodies, bool smooth,
                 const std::string& more, double unit, const Vec3d& shift) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.hide_emitters = true;
  parts.unit = unit;
  parts.origin = parts.origin + shift * (1 / unit);
  parts.target = parts.target + shift * (1 / unit);
  parts.body = square("floor", 5 * unit, -90, shift, diffuse("chalk", "0.8, 0.7, 0.6")) + more;
  for (size_t i = 0; i < bodies.size(); ++i) {
    const std::string name = fmt::format("body{}", i);
    parts.body += obj_shape(name, write_mesh(files, name + ".obj", bodies[i].mesh), !smooth,
                            bodies[i].scale * unit, bodies[i].offset * unit + shift,
                            diffuse(name + "_bsdf", "0.5, 0.6, 0.7"));
  }
  return make_scene(files, parts);
}

std::string make_sun(const TempFiles& files, const std::string& id) {
  Image map(64, 32, 3);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < map.height; ++y) {
      for (int x = 0; x < map.width; ++x) map.at(x, y, c) = static_cast<float>(0.1 + 0.1 * c);
    }
    map.at(40, 8, c) = map.at(41, 8, c) = map.at(40, 9, c) = 150;
  }
  write_exr(files.path("sun.exr"), map, false, {});
  return fmt::format(
      R"(  <emitter type="envmap" id="{}"><string name="filename" value="{}"/></emitter>)", id,
      files.path("sun.exr"));
}

RenderResult run(const Scene& scene, const std::string& method, int spp, RenderOptions options,
                 int threads) {
  RunSettings settings;
  settings.spp = spp;
  settings.seed = method == "lines" || method == "silhouettes" ? 1 : 2;
  settings.threads = threads;
  options.method = method;
  RenderResult result = render(scene, settings, options);
  EXPECT_EQ(result.non_finite.count, 0u) << result.non_finite.message();
  return result;
}

void expect_alike(const RenderResult& a, const RenderResult& b, const std::string& what) {
  std::vector<double> z;
  double sum_a = 0, sum_b = 0, variance = 0;
  for (size_t i = 0; i < a.radiance.size(); ++i) {
    const double v = a.radiance.variance(i) + b.radiance.variance(i);
    sum_a += a.radiance.mean(i), sum_b += b.radiance.mean(i), variance += v;
  }
  const double score = (sum_a - sum_b) / std::sqrt(variance);
  fmt::print("{}: {:.6g} and {:.6g}, z {:.2f}\n", what, sum_a / a.radiance.size(),
             sum_b / a.radiance.size(), score);
  EXPECT_LT(std::fabs(score), 4) << what;
  EXPECT_LT(std::sqrt(variance), 0.01 * sum_a) << what;
  EXPECT_LT(compare_moments(a.radiance, b.radiance).largest, 6) << what;
}

}  // namespace limn
