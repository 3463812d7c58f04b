#pragma once
// What a point sees of the sky, as closed polygons of points on the occluders: seen from a point
// nearby they are nearly its own. Exact at the point itself.
#include <cstdint>
#include <span>
#include <vector>

#include "integrators/contours/contours.h"

namespace limn {

// A corner of a polygon: a vertex of a mesh; two where outlines cross, on the nearer edge and on
// the farther; or a direction on the horizon.
struct SkyCorner {
  Vec3d q;
  bool far = false;  // q is a direction
  bool operator==(const SkyCorner&) const = default;
};

struct SkyPolygons {
  std::vector<SkyCorner> corners;
  std::vector<uint32_t> starts{0};  // of loops, and the end; the sky is on the left of each
  // Ways around that disagreed about the number of faces: 0, or the polygons may be wrong.
  int contradictions = 0;

  size_t loops() const { return starts.size() - 1; }
};

// Contradictions are met by small shifts of the point.
SkyPolygons find_sky_polygons(const Contours& contours, const ContourPoint& at);

// Unit directions of all corners from a point, appended.
void look_at(std::span<const SkyCorner> corners, const Vec3d& from, std::vector<Vec3d>& directions);

}  // namespace limn
