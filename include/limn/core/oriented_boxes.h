#pragma once
// Boxes along the sides of faces. The axis-aligned boxes of slivers that lie askew are mostly empty
// and overlap each other: rays and searches for pairs would meet all of them.
#include <array>
#include <optional>
#include <span>

#include "limn/core/bounds.h"

namespace limn {

using FaceCorners = std::array<Vec3d, 3>;

struct OrientedBox {
  Vec3d center;
  std::array<Vec3d, 3> axes;  // unit, perpendicular to each other
  Vec3d half;                 // half of its size along each axis
};

// A box along the axes of the world in this form.
OrientedBox oriented(const Bounds& bounds);

// True if a plane along two axes of one box, or along the first axis of each, separates them. It
// may be false for boxes that do not overlap.
bool are_apart(const OrientedBox& a, const OrientedBox& b);

// The box around faces, `margin` larger on every side, along the longest side and the normal of the
// first, if it has at most a quarter of the area of `aligned`. margin must exceed the rounding of
// doubles. There must be a face; its area may be zero.
std::optional<OrientedBox> thin_box(std::span<const FaceCorners> faces, double margin,
                                    const Bounds& aligned);

// The box around faces along the longest side of all, if there the boxes of single faces have at
// most a quarter of the area of their axis-aligned ones.
std::optional<OrientedBox> box_of_slivers(std::span<const FaceCorners> faces);

}  // namespace limn
