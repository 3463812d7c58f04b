// Linear programs with CLP; the only file that includes it.
#include "edgetree/bounds/normaliser.h"

#include <array>
#include <coin/ClpSimplex.hpp>
#include <limits>
#include <memory>

namespace limn {
namespace {

constexpr int kVariables = 5;  // D and rho
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Reused by a thread between programs: creating a model's message tables costs a third of a
// solution.
struct Workplace {
  // An empty program, copied for each solution. No state can leak between solutions, so results do
  // not depend on the thread.
  ClpSimplex empty;
  std::vector<int> indices;
  std::vector<double> values, row_lower, row_upper;

  Workplace() { empty.setLogLevel(0); }
};

// Loads all columns at once: adding single rows would copy the matrix each time.
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
  // On the heap: shared libraries have little thread-local storage.
  static thread_local const auto owned = std::make_unique<Workplace>();
  Workplace& place = *owned;
  ClpSimplex simplex(place.empty);
  load(points, place, simplex);
  simplex.dual();
  const double* solution = simplex.primalColumnSolution();
  return {solution[0], solution[1], solution[2], solution[3]};
}

}  // namespace limn
