#pragma once
// The hyperplane that the planes of a node are projected to.
#include <Eigen/Core>
#include <vector>

namespace limn {

// Unit Z with Z . q > 0 for all points, far from zero; or zero, if no unit vector has 2^-20 or more
// with all of them. points: at least one, of four coordinates (unit normal, distance), the latter
// of the size of 1.
Eigen::Vector4d normaliser_of(const std::vector<Eigen::Vector4d>& points);

// Columns: orthonormal, and orthogonal to the unit vector z (a Householder reflection).
Eigen::Matrix<double, 4, 3> complement_of(const Eigen::Vector4d& z);

}  // namespace limn
