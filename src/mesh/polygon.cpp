// Triangulation of polygons: fans, bisection, or ear clipping.
#include "src/mesh/mesh_file.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace limn {

namespace {

using Corners = std::vector<Vec3d>;
using Triangles = std::vector<std::array<uint32_t, 3>>;

// All triangles of a fan share a corner. Searches for touching pairs take quadratic time in their
// number.
constexpr size_t kLargestFan = 64;  // not tuned

Vec3d doubled_area(const Vec3d& a, const Vec3d& b, const Vec3d& c) { return cross(b - a, c - a); }

// Newell's normal: twice the area vector.
Vec3d polygon_area(const Corners& p) {
  Vec3d area;
  for (size_t i = 2; i < p.size(); ++i) area += doubled_area(p[0], p[i - 1], p[i]);
  return area;
}

Triangles fan(size_t count) {
  Triangles triangles;
  for (uint32_t i = 2; i < count; ++i) triangles.push_back({0, i - 1, i});
  return triangles;
}

Triangles halves(size_t count) {
  Triangles triangles;
  std::vector<std::pair<uint32_t, uint32_t>> open{{0, static_cast<uint32_t>(count) - 1}};
  while (!open.empty()) {
    const auto [first, last] = open.back();
    open.pop_back();
    if (last - first < 2) continue;
    const uint32_t middle = (first + last) / 2;
    triangles.push_back({first, middle, last});
    open.push_back({middle, last});
    open.push_back({first, middle});
  }
  return triangles;
}

// If no triangle has the opposite orientation, the triangles cover the polygon once. Opposite area
// below a billionth of the polygon's is rounding.
bool folds(const Corners& p, const Triangles& triangles) {
  const Vec3d area = polygon_area(p);
  const double least = -1e-9 * dot(area, area);
  return std::any_of(triangles.begin(), triangles.end(), [&](const auto& t) {
    return dot(doubled_area(p[t[0]], p[t[1]], p[t[2]]), area) < least;
  });
}

// Ear clipping, seen along the polygon's normal: removes corners whose triangle holds no other
// corner (Meisters 1975).
class EarClipper {
 public:
  explicit EarClipper(const Corners& corners) {
    const Vec3d area = polygon_area(corners);
    int axis = 0;
    for (int k = 1; k < 3; ++k)
      if (std::fabs(area[k]) > std::fabs(area[axis])) axis = k;
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const double sign = area[axis] < 0 ? -1 : 1;
    for (const Vec3d& p : corners) points_.push_back({p[u] * sign, p[v]});
    for (uint32_t i = 0; i < corners.size(); ++i) left_.push_back(i);
  }

  Triangles clip() {
    Triangles triangles;
    size_t at = 0;
    while (left_.size() > 2) {
      // A simple polygon always has an ear. Where none is found, any corner is clipped.
      size_t tries = simple_ ? 0 : left_.size();
      while (tries < left_.size() && !is_ear(at % left_.size())) ++at, ++tries;
      simple_ = tries < left_.size();
      at %= left_.size();
      triangles.push_back({around(at, -1), around(at, 0), around(at, 1)});
      left_.erase(left_.begin() + static_cast<std::ptrdiff_t>(at));
    }
    return triangles;
  }

 private:
  struct Point {
    double x, y;
    bool operator==(const Point&) const = default;
  };

  uint32_t around(size_t at, int step) const {
    return left_[(at + left_.size() + static_cast<size_t>(step)) % left_.size()];
  }

  static double turn(const Point& a, const Point& b, const Point& c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
  }

  bool is_ear(size_t at) const {
    const Point a = points_[around(at, -1)], b = points_[around(at, 0)], c = points_[around(at, 1)];
    if (!(turn(a, b, c) > 0)) return false;
    for (const uint32_t i : left_) {
      const Point p = points_[i];
      if (p == a || p == b || p == c) continue;
      if (turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0) return false;
    }
    return true;
  }

  std::vector<Point> points_;
  std::vector<uint32_t> left_;  // corners, in order
  bool simple_ = true;
};

}  // namespace

Triangles split_polygon(const Corners& corners) {
  if (corners.size() > kLargestFan) {
    Triangles triangles = halves(corners.size());
    if (!folds(corners, triangles)) return triangles;
  }
  Triangles triangles = fan(corners.size());
  if (corners.size() == 3 || !folds(corners, triangles)) return triangles;
  if (corners.size() > kMaxConcaveCorners) return {};
  return EarClipper(corners).clip();
}

}  // namespace limn
