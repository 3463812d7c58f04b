#pragma once
// Moments of a set of planes, and the quadric that fits them best (Soroka, Peters, Marschner 2025,
// Sec. 4.3).
//
// In the frame of a node a plane q = (n, w) has the unit normal n and the signed distance w of the
// frame's center over its radius. The ten products of its coordinates are s = (n_x^2, n_y^2, n_z^2,
// n_y n_z, n_x n_z, n_x n_y) and w (n, w). For a symmetric Q, q . Q q = v . (s, w n, w w).
#include <Eigen/Core>

#include "edgetree/bounds/forest_fit.h"

namespace limn {

class PlaneMoments {
 public:
  void add(const Eigen::Vector4d& q);
  // Adds the moments of another set, converted between frames. Children are smaller than their
  // parents, so nothing cancels.
  void add(const PlaneMoments& other, const NodeFrame& from, const NodeFrame& to);

  // The Q that minimises sum (q . Q q)^2 / sum of 4 (Q q)_w^2: the generalized eigenproblem M v =
  // mu N v. N knows only the four products with w, so that the others follow from these (a Schur
  // complement), and the 4 x 4 problem N x = x S / mu is left. Few planes, or planes of a quadric,
  // leave M singular: any solution will do. Zero if there is none.
  Eigen::Matrix4d best_quadric() const;

 private:
  using Six = Eigen::Matrix<double, 6, 1>;
  Eigen::Matrix<double, 6, 6> normals_ = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 4> mixed_ = Eigen::Matrix<double, 6, 4>::Zero();
  Eigen::Matrix4d offsets_ = Eigen::Matrix4d::Zero();
  Eigen::Matrix4d second_ = Eigen::Matrix4d::Zero();  // sum of q q^T
};

// The matrix that transforms planes from one frame to the other.
Eigen::Matrix4d between(const NodeFrame& from, const NodeFrame& to);

}  // namespace limn
