// The one door to CLP.
#include "edgetree/forest/linear_program.h"

#include <array>
#include <coin/ClpSimplex.hpp>
#include <limits>

namespace limn {

Eigen::Vector4d separating_direction(const std::vector<Eigen::Vector4d>& points) {
  constexpr int kVariables = 5;  // D and rho
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  ClpSimplex simplex;
  simplex.setLogLevel(0);
  simplex.resize(0, kVariables);
  for (int i = 0; i < 4; ++i) simplex.setColumnBounds(i, -1, 1);
  simplex.setColumnBounds(4, 0, kInfinity);
  simplex.setObjectiveCoefficient(4, -1);  // CLP minimises
  const std::array<int, kVariables> columns{0, 1, 2, 3, 4};
  for (const Eigen::Vector4d& q : points) {
    const std::array<double, kVariables> row{q[0], q[1], q[2], q[3], -1};
    simplex.addRow(kVariables, columns.data(), row.data(), 0, kInfinity);
  }
  simplex.dual();
  const double* solution = simplex.primalColumnSolution();
  return {solution[0], solution[1], solution[2], solution[3]};
}

}  // namespace limn
