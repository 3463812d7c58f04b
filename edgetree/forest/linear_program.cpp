// The one door to CLP.
#include "edgetree/forest/linear_program.h"

#include <array>
#include <coin/ClpSimplex.hpp>
#include <limits>

namespace limn {

Eigen::Vector4d separating_direction(const std::vector<Eigen::Vector4d>& points) {
  constexpr int kVariables = 5;  // D and rho
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  // Column by column, all at once: every row added by itself would copy the matrix.
  const size_t rows = points.size();
  std::vector<CoinBigIndex> starts(kVariables + 1);
  std::vector<int> indices;
  std::vector<double> values;
  for (int i = 0; i < kVariables; ++i) {
    for (size_t r = 0; r < rows; ++r) {
      indices.push_back(static_cast<int>(r));
      values.push_back(i < 4 ? points[r][i] : -1);
    }
    starts[i + 1] = static_cast<CoinBigIndex>(indices.size());
  }
  const std::array<double, kVariables> lower{-1, -1, -1, -1, 0}, upper{1, 1, 1, 1, kInfinity};
  const std::array<double, kVariables> objective{0, 0, 0, 0, -1};  // CLP minimises
  const std::vector<double> row_lower(rows, 0.0), row_upper(rows, kInfinity);
  ClpSimplex simplex;
  simplex.setLogLevel(0);
  simplex.loadProblem(kVariables, static_cast<int>(rows), starts.data(), indices.data(),
                      values.data(), lower.data(), upper.data(), objective.data(), row_lower.data(),
                      row_upper.data());
  simplex.dual();
  const double* solution = simplex.primalColumnSolution();
  return {solution[0], solution[1], solution[2], solution[3]};
}

}  // namespace limn
