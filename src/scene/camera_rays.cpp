// Camera rays, eight at a time, and points of lenses.
#include <algorithm>
#include <cmath>

#include "limn/core/camera.h"
#include "src/base/wide.h"

namespace limn {

LensPoint lens_point(double u, double v) {
  const double x = 2 * u - 1, y = 2 * v - 1;
  if (x == 0 && y == 0) return {};
  const bool steep = std::fabs(x) < std::fabs(y);
  const double r = steep ? y : x;
  const double angle = steep ? kPi / 2 - kPi / 4 * (x / y) : kPi / 4 * (y / x);
  return {r * std::cos(angle), r * std::sin(angle)};
}

void find_rays(const CameraView<double>& view, std::span<const Camera::FilmPoint<double>> positions,
               std::span<CameraRay<double>> rays) {
  const Camera& camera = view.camera();
  if (camera.is_orthographic()) {
    for (size_t i = 0; i < positions.size(); ++i) {
      rays[i] = view.parallel(positions[i].x, positions[i].y);
    }
    return;
  }
  wide::for_blocks(positions.size(), [&](size_t first, size_t last) {
    const auto at = [&](int i) { return positions[std::min(first + i, last - 1)]; };
    const auto d = view.towards(wide::gather([&](int i) { return at(i).x; }),
                                wide::gather([&](int i) { return at(i).y; }));
    const wide::Doubles size = length(d);
    const wide::Vec unit = d * (1 / size);
    for (size_t i = first; i < last; ++i) {
      const int k = static_cast<int>(i - first);
      rays[i] = {view.origin(), wide::lane(unit, k), camera.near_clip * size[k],
                 camera.far_clip * size[k]};
    }
  });
}

}  // namespace limn
