// Boxes along the sides of faces.
#include "limn/core/box_tree.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// A box along other axes pays below this share of the area of the axis-aligned one; not tuned.
constexpr double kThin = 0.25;
constexpr std::array<Vec3d, 3> kWorld{Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}};

double half_area(const Vec3d& size) { return size.x * size.y + size.y * size.z + size.z * size.x; }

Vec3d longest_side(const FaceCorners& face) {
  const std::array sides{face[1] - face[0], face[2] - face[1], face[0] - face[2]};
  return *std::ranges::max_element(sides, {}, [](const Vec3d& side) { return dot(side, side); });
}

std::array<Vec3d, 3> axes_along(const FaceCorners& face) {
  const Vec3d side = longest_side(face);
  if (side == Vec3d{}) return kWorld;
  const Vec3d along = normalize(side);
  Vec3d normal = cross(face[1] - face[0], face[2] - face[0]);
  if (normal == Vec3d{})
    normal = cross(along, std::fabs(along.x) < 0.5 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0});
  // Rounding may leave the normal of a needle askew.
  const Vec3d across = normalize(cross(normal, along));
  return {along, across, cross(along, across)};
}

// The bounds of points in coordinates along the axes.
Bounds bounds_along(const std::array<Vec3d, 3>& axes, std::span<const FaceCorners> faces) {
  Bounds bounds;
  for (const FaceCorners& face : faces) {
    for (const Vec3d& x : face) bounds.extend({dot(axes[0], x), dot(axes[1], x), dot(axes[2], x)});
  }
  return bounds;
}

OrientedBox box_of(const std::array<Vec3d, 3>& axes, const Bounds& bounds, double margin) {
  const Vec3d at = bounds.center();
  return {axes[0] * at.x + axes[1] * at.y + axes[2] * at.z, axes,
          (bounds.upper - bounds.lower) * 0.5 + Vec3d{margin, margin, margin}};
}

// Half of the box's extent along a vector, times the vector's length.
double reach_along(const OrientedBox& box, const Vec3d& v) {
  double reach = 0;
  for (int k = 0; k < 3; ++k) reach += std::fabs(dot(v, box.axes[k])) * box.half[k];
  return reach;
}

bool separates(const Vec3d& v, const OrientedBox& a, const OrientedBox& b) {
  return std::fabs(dot(v, b.center - a.center)) > reach_along(a, v) + reach_along(b, v);
}

}  // namespace

OrientedBox oriented(const Bounds& bounds) { return box_of(kWorld, bounds, 0); }

bool are_apart(const OrientedBox& a, const OrientedBox& b) {
  const auto by = [&](const Vec3d& axis) { return separates(axis, a, b); };
  // Rounding leaves too little of a shorter product.
  const Vec3d both = cross(a.axes[0], b.axes[0]);
  return (length_squared(both) > 0x1p-40 && by(both)) || std::ranges::any_of(a.axes, by) ||
         std::ranges::any_of(b.axes, by);
}

std::optional<OrientedBox> thin_box(std::span<const FaceCorners> faces, double margin,
                                    const Bounds& aligned) {
  const auto axes = axes_along(faces[0]);
  const OrientedBox box = box_of(axes, bounds_along(axes, faces), margin);
  if (!(half_area(box.half * 2) <= kThin * half_area(aligned.upper - aligned.lower)))
    return std::nullopt;
  return box;
}

std::optional<OrientedBox> box_of_slivers(std::span<const FaceCorners> faces) {
  if (faces.empty()) return std::nullopt;
  const auto axes = axes_along(*std::ranges::max_element(
      faces, {}, [](const FaceCorners& face) { return length_squared(longest_side(face)); }));
  double along = 0, aligned = 0;
  for (const FaceCorners& face : faces) {
    const Bounds own = bounds_along(axes, {&face, 1}), world = bounds_along(kWorld, {&face, 1});
    along += half_area(own.upper - own.lower);
    aligned += half_area(world.upper - world.lower);
  }
  if (!(along <= kThin * aligned)) return std::nullopt;
  return box_of(axes, bounds_along(axes, faces), 0);
}

}  // namespace limn
