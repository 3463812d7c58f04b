// A convex hull, point by point.
#include "integrators/interpolation/spherical_delaunay.h"

#include <map>
#include <utility>

#include "limn/core/rng.h"

namespace limn {
namespace {

struct Facet {
  std::array<uint32_t, 3> corners;  // counter-clockwise from outside
  Vec3d n;
  double offset;
  bool alive = true;
};

}  // namespace

std::vector<std::array<uint32_t, 3>> spherical_delaunay(std::span<const Vec3d> points) {
  if (points.size() < 4) return {};
  std::vector<Vec3d> x;
  Rng rng(1, 2, 3);
  for (const Vec3d& point : points) {
    const double a = rng.uniform(), b = rng.uniform(), c = rng.uniform();
    x.push_back(normalize(point + Vec3d{a, b, c} * 1e-7));
  }
  std::vector<Facet> facets;
  const auto add = [&](uint32_t a, uint32_t b, uint32_t c) {
    const Vec3d n = cross(x[b] - x[a], x[c] - x[a]);
    facets.push_back({{a, b, c}, n, dot(n, x[a])});
  };
  // Two sides of one triangle: every other point lies beyond one of them.
  add(0, 1, 2), add(0, 2, 1);
  std::map<std::pair<uint32_t, uint32_t>, bool> rim;  // sides of what a point sees
  for (uint32_t p = 3; p < x.size(); ++p) {
    rim.clear();
    const size_t count = facets.size();
    for (size_t f = 0; f < count; ++f) {
      Facet& facet = facets[f];
      if (!facet.alive || !(dot(facet.n, x[p]) > facet.offset)) continue;
      facet.alive = false;
      for (int k = 0; k < 3; ++k) rim[{facet.corners[k], facet.corners[(k + 1) % 3]}] = true;
    }
    for (const auto& [side, seen] : rim) {
      if (!rim.contains({side.second, side.first})) add(side.first, side.second, p);
    }
    if (facets.size() > 4 * x.size())
      std::erase_if(facets, [](const Facet& f) { return !f.alive; });
  }
  std::vector<std::array<uint32_t, 3>> result;
  for (const Facet& facet : facets) {
    if (facet.alive) result.push_back(facet.corners);
  }
  return result;
}

}  // namespace limn
