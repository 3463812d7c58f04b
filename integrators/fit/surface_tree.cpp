// Boxes over faces: the nearest face of a point, all faces on a ray.
#include "integrators/fit/surface_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "limn/core/error.h"

namespace limn {

namespace {

constexpr uint32_t kLeaf = 4;  // faces of a leaf at most; not tuned

double squared_distance(const Bounds& box, const Vec3d& p) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    const double out = std::max({box.lower[k] - p[k], 0.0, p[k] - box.upper[k]});
    sum += out * out;
  }
  return sum;
}

Vec3d nearest_on(const Vec3d& a, const Vec3d& b, const Vec3d& p) {
  const Vec3d ab = b - a;
  return a + ab * std::clamp(dot(p - a, ab) / length_squared(ab), 0.0, 1.0);
}

Vec3d nearest_on(const std::array<Vec3d, 3>& c, const Vec3d& p) {
  const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
  bool inside = true;
  Vec3d best = c[0];
  for (int k = 0; k < 3; ++k) {
    const Vec3d &a = c[k], &b = c[(k + 1) % 3];
    inside = inside && determinant(n, b - a, p - a) >= 0;
    const Vec3d found = nearest_on(a, b, p);
    if (length_squared(found - p) < length_squared(best - p)) best = found;
  }
  return inside ? p - n * (dot(n, p - c[0]) / dot(n, n)) : best;
}

bool meets(const Bounds& box, const Vec3d& origin, const Vec3d& direction) {
  double near = 0, far = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    if (direction[k] == 0) {
      if (origin[k] < box.lower[k] || origin[k] > box.upper[k]) return false;
      continue;
    }
    const double a = (box.lower[k] - origin[k]) / direction[k];
    const double b = (box.upper[k] - origin[k]) / direction[k];
    near = std::max(near, std::min(a, b));
    far = std::min(far, std::max(a, b));
  }
  // Wider by the rounding of the above: a face that lies in a side of its box is not lost.
  return near <= far * (1 + 0x1p-50) + 0x1p-1000;
}

// 1 where the ray leaves through the face, -1 where it enters, 0 where it passes by.
int crossing(const std::array<Vec3d, 3>& c, const Vec3d& origin, const Vec3d& direction) {
  double sides[3];
  for (int k = 0; k < 3; ++k) {
    sides[k] = determinant(direction, c[k] - origin, c[(k + 1) % 3] - origin);
  }
  const bool leaves = sides[0] > 0 && sides[1] > 0 && sides[2] > 0;
  const bool enters = sides[0] < 0 && sides[1] < 0 && sides[2] < 0;
  if (!leaves && !enters) return 0;
  const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
  const bool ahead = dot(n, c[0] - origin) * dot(n, direction) > 0;
  return !ahead ? 0 : leaves ? 1 : -1;
}

}  // namespace

std::array<Vec3d, 3> corners_of(const Mesh& mesh, uint32_t face) {
  std::array<Vec3d, 3> c;
  for (int k = 0; k < 3; ++k) c[k] = cast<double>(mesh.positions[mesh.faces[face][k]]);
  return c;
}

SurfaceTree::SurfaceTree(const Mesh& mesh) : mesh_(mesh) {
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    if (has_area(mesh, mesh.faces[f])) faces_.push_back(f);
  }
  if (faces_.empty()) throw InputError("a mesh has no face with an area");
  nodes_.emplace_back();
  build(0, 0, static_cast<uint32_t>(faces_.size()));
}

void SurfaceTree::build(uint32_t node, uint32_t first, uint32_t count) {
  Bounds bounds;
  const auto center = [&](uint32_t face) {
    const auto c = corners_of(mesh_, face);
    return c[0] + c[1] + c[2];
  };
  for (uint32_t i = first; i < first + count; ++i) {
    for (const Vec3d& c : corners_of(mesh_, faces_[i])) bounds.extend(c);
  }
  nodes_[node] = {bounds, first, count};
  if (count <= kLeaf) return;
  const Vec3d size = bounds.upper - bounds.lower;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const uint32_t half = count / 2;
  const auto begin = faces_.begin() + first;
  std::nth_element(begin, begin + half, begin + count, [&](uint32_t a, uint32_t b) {
    const double x = center(a)[axis], y = center(b)[axis];
    return x != y ? x < y : a < b;
  });
  const auto child = static_cast<uint32_t>(nodes_.size());
  nodes_.resize(child + 2);
  nodes_[node].first = child;
  nodes_[node].count = 0;
  build(child, first, half);
  build(child + 1, first + half, count - half);
}

SurfaceTree::Nearest SurfaceTree::nearest(const Vec3d& p) const {
  double best = std::numeric_limits<double>::infinity();
  uint32_t face = faces_[0];
  Vec3d point;
  std::vector<uint32_t> stack{0};
  while (!stack.empty()) {
    const Node& node = nodes_[stack.back()];
    stack.pop_back();
    if (squared_distance(node.bounds, p) >= best) continue;
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Vec3d found = nearest_on(corners_of(mesh_, faces_[i]), p);
      if (length_squared(found - p) >= best) continue;
      best = length_squared(found - p);
      point = found;
      face = faces_[i];
    }
    if (node.count > 0) continue;
    const bool swap = squared_distance(nodes_[node.first].bounds, p) <
                      squared_distance(nodes_[node.first + 1].bounds, p);
    stack.push_back(node.first + swap);
    stack.push_back(node.first + !swap);
  }
  return {std::sqrt(best), FaceId(face), point};
}

int SurfaceTree::crossings(const Vec3d& origin, const Vec3d& direction, FaceId skip) const {
  int sum = 0;
  std::vector<uint32_t> stack{0};
  while (!stack.empty()) {
    const Node& node = nodes_[stack.back()];
    stack.pop_back();
    if (!meets(node.bounds, origin, direction)) continue;
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      if (FaceId(faces_[i]) == skip) continue;
      sum += crossing(corners_of(mesh_, faces_[i]), origin, direction);
    }
    if (node.count > 0) continue;
    stack.push_back(node.first);
    stack.push_back(node.first + 1);
  }
  return sum;
}

}  // namespace limn
