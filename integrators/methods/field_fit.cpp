// Control variates' coefficients: least squares over windows of cells, chosen by cross-validation.
#include "integrators/methods/field_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "integrators/methods/allocation.h"
#include "limn/core/parallel.h"

namespace limn {
namespace {

using Coefficients = Eigen::Matrix<double, kUnknowns, 1>;

// Which unknowns a fit uses: [first, first + count).
struct Basis {
  int first, count;
};
constexpr Basis kBases[] = {{0, 6}, {0, 3}, {3, 3}};
constexpr int kRadii[] = {1, 2, 4};
constexpr int kFits = static_cast<int>(std::size(kBases) * std::size(kRadii));
constexpr int kHeld = -1;
constexpr int kJudgeRadius = 4;
// A fit must leave less than this share of the variance. Covariances of rare edges mislead looser
// choices: with 0.85 a prototype lost a factor of two on a CAD part and in soft shadows.
constexpr double kConvincing = 0.5;
// Shrinks coefficients towards none: added to the diagonal, as a share of it. Not tuned.
constexpr double kRidge = 0.05;

using Halves = std::array<std::vector<Covariance>, 2>;

// Variance of the derivative plus the combination of the unknowns.
double variance_with(const Covariance& c, const Coefficients& b) {
  double sum = c.at(0, 0);
  for (int i = 0; i < kUnknowns; ++i) {
    if (b[i] == 0) continue;
    sum += 2 * b[i] * c.at(0, i + 1);
    for (int j = 0; j < kUnknowns; ++j) sum += b[i] * b[j] * c.at(i + 1, j + 1);
  }
  return sum;
}

template <int kCount>
Coefficients fit_of(const Covariance& c, int first) {
  Eigen::Matrix<double, kCount, kCount> a;
  Eigen::Matrix<double, kCount, 1> b;
  for (int i = 0; i < kCount; ++i) {
    b[i] = -c.at(0, first + i + 1);
    for (int j = 0; j < kCount; ++j) a(i, j) = c.at(first + i + 1, first + j + 1);
    a(i, i) *= 1 + kRidge;
  }
  const Eigen::Matrix<double, kCount, 1> solved = a.ldlt().solve(b);
  Coefficients result = Coefficients::Zero();
  if (solved.allFinite()) result.template segment<kCount>(first) = solved;
  return result;
}
Coefficients fit(const Covariance& c, const Basis& basis) {
  return basis.count == 3 ? fit_of<3>(c, basis.first) : fit_of<6>(c, basis.first);
}

// Sums over the windows around all cells of one row of the grid.
class Windows {
 public:
  Windows(const PlanGrid& grid, const std::vector<Covariance>& cells, int radius)
      : grid_(grid), cells_(cells), radius_(radius) {}

  std::vector<Covariance> row(int y) const {
    // Sums of columns first.
    std::vector<Covariance> columns(grid_.columns);
    for (int v = std::max(0, y - radius_); v <= std::min(grid_.rows - 1, y + radius_); ++v) {
      for (int x = 0; x < grid_.columns; ++x) add(columns[x], cells_[v * grid_.columns + x]);
    }
    std::vector<Covariance> sums(grid_.columns);
    for (int x = 0; x < grid_.columns; ++x) {
      for (int u = std::max(0, x - radius_); u <= std::min(grid_.columns - 1, x + radius_); ++u) {
        add(sums[x], columns[u]);
      }
    }
    return sums;
  }

 private:
  static void add(Covariance& a, const Covariance& b) {
    for (size_t i = 0; i < a.entries.size(); ++i) a.entries[i] += b.entries[i];
  }

  const PlanGrid& grid_;
  const std::vector<Covariance>& cells_;
  int radius_;
};

// One parameter's share of what is fitted.
struct ParameterFit {
  std::vector<std::vector<double>> variances;  // [slot][cell]
  std::vector<Coefficients> fields;            // by cell; empty if directions are better held
};

class Fitter {
 public:
  Fitter(const PilotFigures& figures, int parameter, int threads)
      : figures_(figures), grid_(figures.grid), parameter_(parameter), threads_(threads) {}

  ParameterFit run() {
    ParameterFit result;
    std::vector<int> chosen(grid_.size(), kHeld);
    set_variances(chosen, result);
    // What remains of a term decides how much of the work it gets, and so how much it counts.
    for (int round = 0; round < 2; ++round) {
      weigh_terms(result.variances);
      chosen = choose();
      set_variances(chosen, result);
    }
    set_fields(chosen, result);
    return result;
  }

 private:
  // The error after equal time goes with (sum of sqrt(v c))^2 over terms of variance v and cost c;
  // its derivative by v is proportional to sqrt(c / v).
  void weigh_terms(const std::vector<std::vector<double>>& variances) {
    for (int half = 0; half < 2; ++half) total_[half].assign(grid_.size(), {});
    for (size_t slot = 0; slot < figures_.work.size(); ++slot) {
      if (variances[slot].empty()) continue;
      const double mean = trimmed_mean(variances[slot]);
      if (!(mean > 0)) continue;
      const auto weight = static_cast<float>(std::sqrt(figures_.work[slot] / mean));
      for (int half = 0; half < 2; ++half) {
        for (size_t cell = 0; cell < grid_.size(); ++cell) {
          auto& to = total_[half][cell].entries;
          const auto from = of(half, slot, cell).entries;
          for (size_t i = 0; i < to.size(); ++i) to[i] += weight * from[i];
        }
      }
    }
  }

  // The index of a fit, or kHeld, for every cell.
  std::vector<int> choose() const {
    const size_t size = grid_.size();
    std::vector<double> held(size);
    for (size_t i = 0; i < size; ++i)
      held[i] = 0.5 * (total_[0][i].at(0, 0) + total_[1][i].at(0, 0));
    std::vector<double> least = window_means(grid_, held, kJudgeRadius);
    for (double& v : least) v *= kConvincing;
    std::vector<int> chosen(size, kHeld);
    for (int r = 0; r < static_cast<int>(std::size(kRadii)); ++r) {
      std::array<std::vector<double>, std::size(kBases)> left;
      for (auto& values : left) values.resize(size);
      parallel_for(grid_.rows, threads_, [&](size_t y) {
        const std::vector<Covariance> sums[2] = {window_row(0, r, y), window_row(1, r, y)};
        for (int x = 0; x < grid_.columns; ++x) {
          const size_t cell = y * grid_.columns + x;
          for (size_t b = 0; b < std::size(kBases); ++b) {
            left[b][cell] = 0.5 * (variance_with(total_[1][cell], fit(sums[0][x], kBases[b])) +
                                   variance_with(total_[0][cell], fit(sums[1][x], kBases[b])));
          }
        }
      });
      for (int b = 0; b < static_cast<int>(std::size(kBases)); ++b) {
        const std::vector<double> judged = window_means(grid_, left[b], kJudgeRadius);
        for (size_t i = 0; i < size; ++i) {
          if (!(judged[i] < least[i])) continue;
          least[i] = judged[i];
          chosen[i] = r * static_cast<int>(std::size(kBases)) + b;
        }
      }
    }
    return chosen;
  }

  std::vector<Covariance> window_row(int half, int radius_index, size_t y) const {
    return Windows(grid_, total_[half], kRadii[radius_index]).row(static_cast<int>(y));
  }

  // Calls visit(cell, fit from half 0, from half 1, from both) for the cells that have a field.
  template <class Visit>
  void for_fits(const std::vector<int>& chosen, const Visit& visit) const {
    for (int r = 0; r < static_cast<int>(std::size(kRadii)); ++r) {
      parallel_for(grid_.rows, threads_, [&](size_t y) {
        const auto begin = chosen.begin() + static_cast<long>(y) * grid_.columns;
        const auto uses = [&](int f) { return f != kHeld && f / int(std::size(kBases)) == r; };
        if (std::none_of(begin, begin + grid_.columns, uses)) return;
        const std::vector<Covariance> sums[2] = {window_row(0, r, y), window_row(1, r, y)};
        for (int x = 0; x < grid_.columns; ++x) {
          const size_t cell = y * grid_.columns + x;
          if (!uses(chosen[cell])) continue;
          const Basis& basis = kBases[chosen[cell] % std::size(kBases)];
          Covariance both = sums[0][x];
          for (size_t i = 0; i < both.entries.size(); ++i) both.entries[i] += sums[1][x].entries[i];
          visit(cell, fit(sums[0][x], basis), fit(sums[1][x], basis), fit(both, basis));
        }
      });
    }
  }

  Covariance of(int half, size_t slot, size_t cell) const {
    return figures_.halves[half][slot].of(cell, parameter_);
  }

  void set_variances(const std::vector<int>& chosen, ParameterFit& result) const {
    const size_t slots = figures_.halves[0].size();
    result.variances.assign(slots, {});
    const auto set = [&](size_t cell, const Coefficients& first, const Coefficients& second) {
      for (size_t slot = 0; slot < slots; ++slot) {
        if (!figures_.in_cells(slot)) continue;
        result.variances[slot][cell] = 0.5 * (variance_with(of(1, slot, cell), first) +
                                              variance_with(of(0, slot, cell), second));
      }
    };
    for (size_t slot = 0; slot < slots; ++slot) {
      if (figures_.in_cells(slot)) result.variances[slot].resize(grid_.size());
    }
    for (size_t cell = 0; cell < grid_.size(); ++cell) {
      set(cell, Coefficients::Zero(), Coefficients::Zero());
    }
    for_fits(chosen, [&](size_t cell, const Coefficients& first, const Coefficients& second,
                         const Coefficients&) { set(cell, first, second); });
  }

  void set_fields(const std::vector<int>& chosen, ParameterFit& result) const {
    if (std::all_of(chosen.begin(), chosen.end(), [](int f) { return f == kHeld; })) return;
    result.fields.resize(grid_.size(), Coefficients::Zero());
    for_fits(chosen, [&](size_t cell, const Coefficients&, const Coefficients&,
                         const Coefficients& both) { result.fields[cell] = both; });
  }

  const PilotFigures& figures_;
  const PlanGrid& grid_;
  int parameter_;
  int threads_;
  Halves total_;  // of all terms, weighed
};

}  // namespace

FieldFit fit_fields(const PilotFigures& figures, int parameters, int threads) {
  FieldFit result;
  for (int k = 0; k < parameters; ++k) {
    ParameterFit fit = Fitter(figures, k, threads).run();
    result.variances.push_back(std::move(fit.variances));
    if (fit.fields.empty()) continue;
    result.fields.resize(figures.grid.size());
    for (size_t cell = 0; cell < result.fields.size(); ++cell) {
      for (int axis = 0; axis < 3; ++axis) {
        result.fields[cell].turn[axis][k] = fit.fields[cell][axis];
        result.fields[cell].score[axis][k] = fit.fields[cell][3 + axis];
      }
    }
  }
  return result;
}

}  // namespace limn
