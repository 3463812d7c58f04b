#pragma once
// The separating hyperplane of points in R^4, by linear programming.
#include <Eigen/Core>
#include <vector>

namespace limn {

// Maximises rho over D with D . q >= rho for all q and -1 <= D_i <= 1: the hyperplane with the
// largest distance from all q on one side. Returns D; rho is the minimum of D . q (0 with D = 0 if
// no hyperplane has all points on one side).
Eigen::Vector4d separating_direction(const std::vector<Eigen::Vector4d>& points);

}  // namespace limn
