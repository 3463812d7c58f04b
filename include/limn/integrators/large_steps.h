#pragma once
// The change of variables of Nicolet, Jacobson and Jakob 2021: u = (I + lambda L) v, L the uniform
// Laplacian over welded vertices. A step of u along its gradient moves v smoothly.
#include <cstdint>
#include <memory>
#include <vector>

#include "limn/core/mesh.h"

namespace limn {

class LargeSteps {
 public:
  // lambda: at least 0. mesh.weld must be filled.
  LargeSteps(const Mesh& mesh, double lambda);
  ~LargeSteps();
  LargeSteps(LargeSteps&&) noexcept;

  double lambda() const { return lambda_; }
  size_t size() const { return first_.size(); }  // n welded vertices
  // For each of the mesh's V vertices its welded one, in [0, n).
  const std::vector<uint32_t>& welded() const { return welded_; }
  // For each welded one the first of its copies.
  const std::vector<uint32_t>& first() const { return first_; }

  // n by 3, row by row, or n by 1: (I + lambda L) x.
  std::vector<double> apply(const std::vector<double>& x) const;
  // (I + lambda L)^-1 x, by Cholesky factors. The matrix is symmetric: it takes gradients of v to
  // those of u, and u to v.
  std::vector<double> solve(const std::vector<double>& x) const;

 private:
  struct Factors;
  double lambda_ = 0;
  std::vector<uint32_t> welded_, first_;
  std::unique_ptr<Factors> factors_;  // null for lambda = 0
};

// The mean length of a mesh's edges, each counted once, in scene units.
double mean_edge_length(const Mesh& mesh);

}  // namespace limn
