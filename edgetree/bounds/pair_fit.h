#pragma once
// Fits a pair of bounding quadrics in the coordinates of a dual box (Soroka, Peters, Marschner
// 2025, Sec. 4.2 and 4.3).
#include <span>
#include <vector>

#include "edgetree/bounds/plane_moments.h"
#include "edgetree/bounds/quadric_pair.h"

namespace limn {

// columns: of the box, whose planes are column_0 + sum of u_k column_(k+1), in the frame of
// the quadric. points: coordinates u of planes, of wedge i at 2 i and 2 i + 1; set to 0
// along axes that are too short. Bounds are rounded outward, so that all wedges satisfy
// them.
PairFit fit_pair(Eigen::Matrix4d columns, const Eigen::Matrix4d& quadric,
                 std::vector<Eigen::Vector3d>& points);

PlaneMoments moments_of(std::span<const Wedge> wedges, const NodeFrame& frame);
// A plane as a point of R^4: its unit normal, and the signed distance of the frame's center divided
// by the radius.
Eigen::Vector4d dual_point(const Plane& plane, const NodeFrame& frame);

}  // namespace limn
