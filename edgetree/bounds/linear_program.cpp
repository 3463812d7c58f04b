// The one door to CLP.
#include "edgetree/bounds/linear_program.h"

#include <array>
#include <coin/ClpSimplex.hpp>
#include <limits>
#include <memory>

namespace limn {
namespace {

constexpr int kVariables = 5;  // D and rho
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// What a thread keeps from one program to the next: to make a model's tables of messages anew costs
// a third of a solution.
struct Workplace {
  // Holds no program, and is copied for each: whatever a solution leaves in its model cannot reach
  // the next one, so that the bits do not depend on which thread solves what.
  ClpSimplex empty;
  std::vector<int> indices;
  std::vector<double> values, row_lower, row_upper;

  Workplace() { empty.setLogLevel(0); }
};

// Column by column, all at once: every row added by itself would copy the matrix.
void load(const std::vector<Eigen::Vector4d>& points, Workplace& place, ClpSimplex& simplex) {
  const size_t rows = points.size();
  std::array<CoinBigIndex, kVariables + 1> starts{};
  place.indices.clear();
  place.values.clear();
  for (int i = 0; i < kVariables; ++i) {
    for (size_t r = 0; r < rows; ++r) {
      place.indices.push_back(static_cast<int>(r));
      place.values.push_back(i < 4 ? points[r][i] : -1);
    }
    starts[i + 1] = static_cast<CoinBigIndex>(place.indices.size());
  }
  const std::array<double, kVariables> lower{-1, -1, -1, -1, 0}, upper{1, 1, 1, 1, kInfinity};
  const std::array<double, kVariables> objective{0, 0, 0, 0, -1};  // CLP minimises
  place.row_lower.assign(rows, 0.0);
  place.row_upper.assign(rows, kInfinity);
  simplex.loadProblem(kVariables, static_cast<int>(rows), starts.data(), place.indices.data(),
                      place.values.data(), lower.data(), upper.data(), objective.data(),
                      place.row_lower.data(), place.row_upper.data());
}

}  // namespace

Eigen::Vector4d separating_direction(const std::vector<Eigen::Vector4d>& points) {
  // On the heap: a shared library has little room for what belongs to threads.
  static thread_local const auto owned = std::make_unique<Workplace>();
  Workplace& place = *owned;
  ClpSimplex simplex(place.empty);
  load(points, place, simplex);
  simplex.dual();
  const double* solution = simplex.primalColumnSolution();
  return {solution[0], solution[1], solution[2], solution[3]};
}

}  // namespace limn
