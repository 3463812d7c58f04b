#pragma once
// Environments from maps made in memory.
#include <memory>
#include <string>
#include <vector>

#include "limn/core/environment.h"
#include "limn/core/image.h"
#include "limn/core/scene.h"
#include "support/temp_files.h"
#include "support/test_properties.h"

namespace limn::test {

inline std::shared_ptr<Environment> make_envmap(const Image& image, double scale = 1,
                                                const Matrix4& to_world = {}) {
  const TempFiles files;
  const std::string file = files.path("map.exr");
  write_exr(file, image, false, {});
  TestProperties properties("emitter", "envmap",
                            {{"filename", file}, {"scale", scale}, {"to_world", to_world}});
  Scene scene;
  read_light(properties, scene, nullptr);
  return scene.environment;
}

// A turn by 40 degrees about (2, -1, 2) / 3.
inline Matrix4 some_rotation() {
  const double angle = 40 * kPi / 180, c = std::cos(angle), s = std::sin(angle);
  const Vec3d a{2.0 / 3, -1.0 / 3, 2.0 / 3};
  Matrix4 m;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) m.m[i][j] = (i == j ? c : 0) + (1 - c) * a[i] * a[j];
  }
  const double cross[3][3] = {{0, -a.z, a.y}, {a.z, 0, -a.x}, {-a.y, a.x, 0}};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) m.m[i][j] += s * cross[i][j];
  }
  return m;
}

struct MapCase {
  std::string name;
  Image image;
};

// Grey maps that are hard to sample.
inline std::vector<MapCase> map_cases() {
  const auto fill = [](int w, int h, auto f) {
    Image image(w, h, 1);
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) image.at(x, y, 0) = static_cast<float>(f(x, y));
    }
    return image;
  };
  return {
      {"tiny", fill(2, 3, [](int x, int y) { return 0.2 + x + 3 * y * x; })},
      {"one texel", fill(1, 1, [](int, int) { return 2; })},
      {"one column", fill(1, 4, [](int, int y) { return y; })},
      {"one row", fill(5, 1, [](int x, int) { return x; })},
      {"black", fill(4, 4, [](int, int) { return 0; })},
      {"sun", fill(16, 9, [](int x, int y) { return x == 11 && y == 2 ? 1e4 : 0.1; })},
      {"sun at the pole", fill(12, 9, [](int, int y) { return y == 0 ? 1e3 : 0.01; })},
      {"sun alone", fill(16, 9, [](int x, int y) { return x == 0 && y == 4 ? 5 : 0; })},
      {"half black", fill(16, 8, [](int x, int y) { return y < 4 ? 1 + 0.3 * (x % 3) : 0; })},
      // Smooth but for a sun and a black corner: cells of many sizes are drawn as one.
      {"large sky", fill(150, 77,
                         [](int x, int y) {
                           if (x < 40 && y > 60) return 0.0;
                           return x == 101 && y == 20
                                      ? 30
                                      : 1 + 0.5 * std::sin(2 * kPi * x / 150) + 0.01 * y;
                         })},
      {"negative texels", fill(8, 5, [](int x, int y) { return (x * 5 + y * 3) % 7 - 2; })},
  };
}

// The direction at (u, w) of the unit square that a map covers.
inline Vec3d map_direction(double u, double w) {
  const double phi = 2 * kPi * u, theta = kPi * w;
  return {std::sin(phi) * std::sin(theta), std::cos(theta), -std::cos(phi) * std::sin(theta)};
}

}  // namespace limn::test
