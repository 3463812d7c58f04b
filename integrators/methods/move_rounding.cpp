// The largest moved coordinate against the fastest vertex.
#include "integrators/methods/move_rounding.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// Below this part of a moved coordinate, a vertex moves by what rounding leaves of its way: an
// error of kRounding of it.
constexpr double kLeastMove = 0x1p-14, kRounding = 0x1p-10;

// The least step of texels. The fastest texel decides: radiance is linear in texels, so a step that
// is too large for others does no harm.
double least_texel_step(const Scene& scene, const Parameter& parameter) {
  const Image velocities = parameter.texel_velocities(scene);
  if (velocities.data.empty()) return 0;
  const Image texels = parameter.texel_map(scene)->texels();
  double moving = 0, speed = 0;
  for (size_t i = 0; i < velocities.data.size(); ++i) {
    const double v = std::fabs(double{velocities.data[i]});
    moving = std::max(moving, v * std::fabs(double{texels.data[i]}));
    speed = std::max(speed, v);
  }
  return speed > 0 ? kLeastMove * moving / (speed * speed) : 0;
}

}  // namespace

double least_step(const Scene& scene, const Parameter& parameter) {
  double place = 0, speed = 0;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const std::vector<Vec3d> velocities = parameter.velocities(scene, ShapeId(s));
    for (size_t v = 0; v < velocities.size(); ++v) {
      const Vec3f& x = scene.shapes[s].mesh.positions[v];
      for (int c = 0; c < 3; ++c) {
        if (velocities[v][c] == 0) continue;
        place = std::max(place, std::fabs(static_cast<double>(x[c])));
        speed = std::max(speed, std::fabs(velocities[v][c]));
      }
    }
  }
  return speed > 0 ? kLeastMove * place / speed : least_texel_step(scene, parameter);
}

double rounding_of_moves(const Scene& scene, const Parameter& parameter, double step) {
  return kRounding * least_step(scene, parameter) / step;
}

double power_of_two_below(double step) { return std::exp2(std::floor(std::log2(step))); }

double resolved_step(const Scene& scene, const Parameter& parameter) {
  constexpr double kSpacing = 0x1p-23 / kLeastMove;  // of floats, over the least step
  const double least = kSpacing * least_step(scene, parameter);
  const double step = power_of_two_below(parameter.natural_step);
  return step >= least ? step : 2 * power_of_two_below(least);
}

}  // namespace limn
