#pragma once
// The one linear program of this folder.
#include <Eigen/Core>
#include <vector>

namespace limn {

// Maximises rho over D with D . q >= rho for all q and -1 <= D_i <= 1: the hyperplane that has all
// q farthest on one side. Returns D; rho is the smallest D . q (0 with D = 0 if no D has all on one
// side).
Eigen::Vector4d separating_direction(const std::vector<Eigen::Vector4d>& points);

}  // namespace limn
