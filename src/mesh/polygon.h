#pragma once
// Triangulation of polygons.
#include <array>
#include <cstdint>
#include <vector>

#include "limn/core/vec.h"

namespace limn {

// Ear clipping takes quadratic time.
inline constexpr size_t kMaxConcaveCorners = 4096;  // not tuned: some hundredths of a second

// The corners.size() - 2 triangles of a polygon, as indices of its corners, in its orientation;
// none if it is concave with more than kMaxConcaveCorners corners. If no triangle folds over: a fan
// up to 64 corners, recursive bisection above (so few triangles share a corner). Else ear clipping.
// A self-intersecting polygon gets arbitrary triangles.
std::vector<std::array<uint32_t, 3>> split_polygon(const std::vector<Vec3d>& corners);

}  // namespace limn
