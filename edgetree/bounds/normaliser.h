#pragma once
// The hyperplane onto which the planes of a node are projected.
#include <Eigen/Core>
#include <vector>

namespace limn {

// A unit vector Z with Z . q > 0 for all points, far from zero; or zero if no unit vector has Z . q
// >= 2^-20 for all of them. points: at least one, (unit normal, distance), with distances of about
// 1.
Eigen::Vector4d normaliser_of(const std::vector<Eigen::Vector4d>& points);

// Columns: orthonormal, and orthogonal to the unit vector z (a Householder reflection).
Eigen::Matrix<double, 4, 3> complement_of(const Eigen::Vector4d& z);

// Maximises rho over D with D . q >= rho for all q and -1 <= D_i <= 1: the hyperplane with the
// largest distance from all q on one side. Returns D; rho is the minimum of D . q (0 with D = 0 if
// no hyperplane has all points on one side).
Eigen::Vector4d separating_direction(const std::vector<Eigen::Vector4d>& points);

}  // namespace limn
