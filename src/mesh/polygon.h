#pragma once
// Polygons as triangles.
#include <array>
#include <cstdint>
#include <vector>

#include "limn/core/vec.h"

namespace limn {

// Ears take a time of their number's square.
inline constexpr size_t kMaxConcaveCorners = 4096;  // not tuned: some hundredths of a second

// The corners.size() - 2 triangles of a polygon, as numbers of its corners, wound as it is; none if
// it is concave and has more than kMaxConcaveCorners. Where that folds no triangle over, up to 64
// corners are a fan from the first one, and more are halved again and again, so that few triangles
// share a corner; else ears are clipped. A polygon that crosses itself gets some triangles.
std::vector<std::array<uint32_t, 3>> split_polygon(const std::vector<Vec3d>& corners);

}  // namespace limn
