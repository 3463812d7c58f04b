// The root of the path through parallel layers.
#include "integrators/edges/flat_layers.h"

#include <algorithm>
#include <cmath>

namespace limn {

Vec3d direction_through(std::span<const FlatLayer> layers, const Vec3d& n, const Vec3d& way) {
  const Vec3d across = way - n * dot(n, way);
  const double distance = length(across);
  if (distance == 0) return n;
  double least = layers[0].index;
  for (const FlatLayer& layer : layers) least = std::min(least, layer.index);
  // tan(theta_j) is k u / root, k = least / n_j and root^2 = 1 + (1 - k^2) u^2.
  const auto root = [](double k, double u) { return std::sqrt(1 + (1 - k * k) * u * u); };
  double u = 0;
  constexpr int kMostSteps = 200;  // some ten are taken
  for (int i = 0; i < kMostSteps; ++i) {
    double missing = distance, slope = 0;
    for (const FlatLayer& layer : layers) {
      const double k = least / layer.index, r = root(k, u);
      missing -= layer.height * k * u / r;
      slope += layer.height * k / (r * r * r);
    }
    const double next = u + missing / slope;
    if (!(next > u)) break;  // to rounding
    u = next;
  }
  const double k = least / layers[0].index;
  return normalize(n + across * (k * u / (root(k, u) * distance)));
}

}  // namespace limn
