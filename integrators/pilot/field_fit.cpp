// Control variates' coefficients: least squares over windows of cells, chosen by cross-validation.
#include "integrators/pilot/field_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "integrators/pilot/allocation.h"
#include "limn/core/parallel.h"

namespace limn {
namespace {

using Coefficients = std::array<double, kUnknowns>;

constexpr int kRadii[] = {1, 2, 4};
constexpr int kHeld = -1;
constexpr int kJudgeRadius = 4;
// A fit must leave less than this share of the variance. Covariances of rare edges mislead looser
// choices: with 0.85 a prototype lost a factor of two on a CAD part and in soft shadows.
constexpr double kConvincing = 0.5;
// Shrinks coefficients towards none: added to the diagonal, as a share of it. Not tuned.
constexpr double kRidge = 0.05;
// The same where a window has seen next to nothing of an unknown: against what is usual on the
// film, as a share of it. Without it, rounding decided on coefficients of 1e12 where an edge was
// yet to be met. Coefficients end below 5 times what is usual. Not tuned.
constexpr double kLeast = 0.01;
// A term counts for the choice if turns change so much of it, as a share of what they change in all
// terms over its own share of the variance. In a soft shadow, where most of the noise is that of
// `direct` and turns change next to none of it (5e-5), no fit can halve the whole; among four
// emitters and in the sun they do (2, 5e-3), and leaving it out costs a tenth. Not tuned in
// between.
constexpr double kChanged = 1e-3;
// A term counts as if it had at least this share of the variance: turns may be all that makes it
// noisy. Not tuned.
constexpr double kLeastShare = 0.01;

// Variance of the derivative plus the combination of the unknowns.
double variance_with(const Covariances& c, int parameter, const Coefficients& b) {
  double sum = c.variance(parameter);
  for (int i = 0; i < kUnknowns; ++i) {
    if (b[i] == 0) continue;
    sum += 2 * b[i] * c.with(parameter, i);
    for (int j = 0; j < kUnknowns; ++j) sum += b[i] * b[j] * c.of(i, j);
  }
  return sum;
}

// What is known before a window is looked at: over the whole film, variances of the unknowns and of
// the parameters' derivatives.
struct Prior {
  std::array<double, kUnknowns> unknowns{};
  std::vector<double> parameters;

  // Of the derivatives summed up in c, in units of those of a cell.
  double size_of(const Covariances& c) const {
    double sum = 0;
    for (size_t k = 0; k < parameters.size(); ++k) {
      if (parameters[k] > 0) sum += c.variance(static_cast<int>(k)) / parameters[k];
    }
    return parameters.empty() ? 0 : sum / static_cast<double>(parameters.size());
  }
};

// Least squares, for any of the parameters: A x = b by A = L D L^T.
class Fit {
 public:
  Fit(const Covariances& c, const Prior& prior) : c_(c) {
    const double size = prior.size_of(c);
    for (int j = 0; j < kUnknowns; ++j) {
      for (int i = j; i < kUnknowns; ++i) {
        double rest = c.of(i, j);
        if (i == j) rest = (1 + kRidge) * rest + kLeast * size * prior.unknowns[i];
        for (int k = 0; k < j; ++k) rest -= lower_[i][k] * lower_[j][k] * diagonal_[k];
        if (i == j) diagonal_[j] = rest;
        // An unknown that was not seen has no coefficient.
        lower_[i][j] = diagonal_[j] > 0 ? rest / diagonal_[j] : 0;
      }
    }
  }
  Coefficients of(int parameter) const {
    Coefficients x;
    for (int i = 0; i < kUnknowns; ++i) {
      x[i] = -c_.with(parameter, i);
      for (int k = 0; k < i; ++k) x[i] -= lower_[i][k] * x[k];
    }
    bool finite = true;
    for (int i = kUnknowns - 1; i >= 0; --i) {
      x[i] = diagonal_[i] > 0 ? x[i] / diagonal_[i] : 0;
      for (int k = i + 1; k < kUnknowns; ++k) x[i] -= lower_[k][i] * x[k];
      finite = finite && std::isfinite(x[i]);
    }
    return finite ? x : Coefficients{};
  }

 private:
  Covariances c_;
  double lower_[kUnknowns][kUnknowns] = {};  // below the diagonal
  double diagonal_[kUnknowns] = {};
};

// Sums of n numbers.
void add(float* to, const float* from, size_t n) {
  for (size_t i = 0; i < n; ++i) to[i] += from[i];
}

// Sums over the windows around all cells of one row of the grid.
CellCovariances window_row(const PlanGrid& grid, const CellCovariances& cells, int parameters,
                           int radius, int y) {
  const auto count = static_cast<size_t>(grid.columns);
  // Sums of columns first.
  CellCovariances columns(count, parameters), sums(count, parameters);
  for (int v = std::max(0, y - radius); v <= std::min(grid.rows - 1, y + radius); ++v) {
    for (size_t x = 0; x < count; ++x) {
      add(columns.entries(x), cells.entries(v * count + x), cells.size());
    }
  }
  for (int x = 0; x < grid.columns; ++x) {
    for (int u = std::max(0, x - radius); u <= std::min(grid.columns - 1, x + radius); ++u) {
      add(sums.entries(x), columns.entries(u), cells.size());
    }
  }
  return sums;
}

// The index of a window, or kHeld, for every parameter and cell.
using Choice = std::vector<std::vector<int>>;

class Fitter {
 public:
  Fitter(const PilotFigures& figures, int parameters, int threads)
      : figures_(figures), grid_(figures.grid), parameters_(parameters), threads_(threads) {}

  FieldFit run() {
    FieldFit result;
    Choice chosen(parameters_, std::vector<int>(grid_.size(), kHeld));
    set_variances(chosen, result);
    // What remains of a term decides how much of the work it gets, and so how much it counts.
    for (int round = 0; round < 2; ++round) {
      weigh_terms(result.variances);
      set_prior();
      chosen = choose();
      set_variances(chosen, result);
    }
    set_fields(chosen, result);
    return result;
  }

 private:
  // The error after equal time goes with (sum of sqrt(v c))^2 over terms of variance v and cost c;
  // its derivative by v is proportional to sqrt(c / v). Each parameter counts alike: its variances
  // are those in units of their sum over terms, up to a factor.
  void weigh_terms(const std::vector<std::vector<std::vector<double>>>& variances) {
    const size_t slots = figures_.work.size();
    std::vector<double> means(slots);
    double first_sum = 0;
    for (int k = 0; k < parameters_; ++k) {
      std::vector<double> own(slots);
      double sum = 0;
      for (size_t slot = 0; slot < slots; ++slot) {
        if (!variances[k][slot].empty()) own[slot] = trimmed_mean(variances[k][slot]);
        sum += own[slot];
      }
      if (!(sum > 0)) continue;
      if (!(first_sum > 0)) first_sum = sum;
      for (size_t slot = 0; slot < slots; ++slot) means[slot] += own[slot] * (first_sum / sum);
    }
    for (auto& half : total_) half = CellCovariances(grid_.size(), parameters_);
    const double variance = std::accumulate(means.begin(), means.end(), 0.0);
    std::vector<double> turned;
    for (size_t slot = 0; slot < slots; ++slot) turned.push_back(turned_variance(slot));
    const double all_turned = std::accumulate(turned.begin(), turned.end(), 0.0);
    for (size_t slot = 0; slot < slots; ++slot) {
      const double mean = std::max(means[slot], kLeastShare * variance);
      if (!(turned[slot] > 0) || turned[slot] / all_turned < kChanged * mean / variance) continue;
      const auto weight = static_cast<float>(std::sqrt(figures_.work[slot] / mean));
      for (int half = 0; half < 2; ++half) {
        for (size_t cell = 0; cell < grid_.size(); ++cell) {
          float* to = total_[half].entries(cell);
          const float* from = figures_.halves[half][slot].entries(cell);
          for (size_t i = 0; i < total_[half].size(); ++i) to[i] += weight * from[i];
        }
      }
    }
  }

  // Of what turns change in a slot, over the film.
  double turned_variance(size_t slot) const {
    if (!figures_.in_cells(slot)) return 0;
    double sum = 0;
    for (const auto& half : figures_.halves) {
      for (size_t cell = 0; cell < grid_.size(); ++cell) {
        for (int i = 0; i < 3; ++i) sum += half[slot][cell].of(i, i);
      }
    }
    return sum;
  }

  void set_prior() {
    prior_ = {};
    prior_.parameters.resize(parameters_);
    const double share = 0.5 / static_cast<double>(grid_.size());
    for (const CellCovariances& half : total_) {
      for (size_t cell = 0; cell < grid_.size(); ++cell) {
        for (int i = 0; i < kUnknowns; ++i) prior_.unknowns[i] += share * half[cell].of(i, i);
        for (int k = 0; k < parameters_; ++k) {
          prior_.parameters[k] += share * half[cell].variance(k);
        }
      }
    }
  }

  // By parameter and cell: the variance that fits leave, by cross-validation, with windows of one
  // size.
  std::vector<std::vector<double>> left_by(int radius) const {
    std::vector<std::vector<double>> left(parameters_, std::vector<double>(grid_.size()));
    parallel_for(grid_.rows, threads_, [&](size_t y) {
      const CellCovariances sums[2] = {row(0, radius, y), row(1, radius, y)};
      for (int x = 0; x < grid_.columns; ++x) {
        const size_t cell = y * grid_.columns + x;
        const Fit first(sums[0][x], prior_), second(sums[1][x], prior_);
        for (int k = 0; k < parameters_; ++k) {
          left[k][cell] = 0.5 * (variance_with(total_[1][cell], k, first.of(k)) +
                                 variance_with(total_[0][cell], k, second.of(k)));
        }
      }
    });
    return left;
  }

  Choice choose() const {
    const size_t size = grid_.size();
    Choice chosen(parameters_, std::vector<int>(size, kHeld));
    std::vector<std::vector<double>> held(parameters_), least;
    for (int k = 0; k < parameters_; ++k) {
      std::vector<double> cells(size);
      for (size_t i = 0; i < size; ++i)
        cells[i] = 0.5 * (total_[0][i].variance(k) + total_[1][i].variance(k));
      held[k] = window_means(grid_, cells, kJudgeRadius);
      least.push_back(held[k]);
      for (double& v : least[k]) v *= kConvincing;
    }
    for (int r = 0; r < static_cast<int>(std::size(kRadii)); ++r) {
      const std::vector<std::vector<double>> left = left_by(kRadii[r]);
      for (int k = 0; k < parameters_; ++k) {
        const std::vector<double> judged = window_means(grid_, left[k], kJudgeRadius);
        for (size_t i = 0; i < size; ++i) {
          if (!(judged[i] < least[k][i])) continue;
          least[k][i] = judged[i];
          chosen[k][i] = r;
        }
      }
    }
    if (parameters_ > 1) hold_where_few_gain(held, least, chosen);
    return chosen;
  }

  // Edges are drawn for all parameters at once: a turn for one of them, which moves edges at rest,
  // takes samples from the others. So the same must hold for all of them together, each variance in
  // units of its mean.
  void hold_where_few_gain(const std::vector<std::vector<double>>& held,
                           const std::vector<std::vector<double>>& least, Choice& chosen) const {
    std::vector<double> weights;
    for (const std::vector<double>& values : held) {
      const double mean = trimmed_mean(values);
      weights.push_back(mean > 0 ? 1 / mean : 0);
    }
    for (size_t i = 0; i < grid_.size(); ++i) {
      double before = 0, after = 0;
      for (int k = 0; k < parameters_; ++k) {
        before += weights[k] * held[k][i];
        after += weights[k] * (chosen[k][i] == kHeld ? held[k][i] : least[k][i]);
      }
      if (after < kConvincing * before) continue;
      for (auto& fits : chosen) fits[i] = kHeld;
    }
  }

  CellCovariances row(int half, int radius, size_t y) const {
    return window_row(grid_, total_[half], parameters_, radius, static_cast<int>(y));
  }

  // Calls visit(parameter, cell, fit from half 0, from half 1, from both) where there is a field.
  template <class Visit>
  void for_fits(const Choice& chosen, const Visit& visit) const {
    for (int r = 0; r < static_cast<int>(std::size(kRadii)); ++r) {
      const auto uses = [&](int window) { return window == r; };
      parallel_for(grid_.rows, threads_, [&](size_t y) {
        const size_t first = y * grid_.columns;
        const auto any = [&](const std::vector<int>& fits) {
          const auto begin = fits.begin() + static_cast<long>(first);
          return std::any_of(begin, begin + grid_.columns, uses);
        };
        if (std::none_of(chosen.begin(), chosen.end(), any)) return;
        const CellCovariances sums[2] = {row(0, kRadii[r], y), row(1, kRadii[r], y)};
        CellCovariances both = sums[0];
        add(both.entries(0), sums[1].entries(0), both.size() * grid_.columns);
        for (int k = 0; k < parameters_; ++k) {
          for (int x = 0; x < grid_.columns; ++x) {
            if (!uses(chosen[k][first + x])) continue;
            visit(k, first + x, Fit(sums[0][x], prior_).of(k), Fit(sums[1][x], prior_).of(k),
                  Fit(both[x], prior_).of(k));
          }
        }
      });
    }
  }

  void set_variances(const Choice& chosen, FieldFit& result) const {
    const size_t slots = figures_.halves[0].size();
    result.variances.assign(parameters_, std::vector<std::vector<double>>(slots));
    const auto set = [&](int k, size_t cell, const Coefficients& first,
                         const Coefficients& second) {
      for (size_t slot = 0; slot < slots; ++slot) {
        if (!figures_.in_cells(slot)) continue;
        result.variances[k][slot][cell] =
            0.5 * (variance_with(figures_.halves[1][slot][cell], k, first) +
                   variance_with(figures_.halves[0][slot][cell], k, second));
      }
    };
    for (int k = 0; k < parameters_; ++k) {
      for (size_t slot = 0; slot < slots; ++slot) {
        if (figures_.in_cells(slot)) result.variances[k][slot].resize(grid_.size());
      }
      for (size_t cell = 0; cell < grid_.size(); ++cell) {
        set(k, cell, Coefficients{}, Coefficients{});
      }
    }
    for_fits(chosen, [&](int k, size_t cell, const Coefficients& first, const Coefficients& second,
                         const Coefficients&) { set(k, cell, first, second); });
  }

  void set_fields(const Choice& chosen, FieldFit& result) const {
    const auto held = [](const std::vector<int>& fits) {
      return std::all_of(fits.begin(), fits.end(), [](int fit) { return fit == kHeld; });
    };
    if (std::all_of(chosen.begin(), chosen.end(), held)) return;
    result.fields.resize(grid_.size());
    for_fits(chosen, [&](int parameter, size_t cell, const Coefficients&, const Coefficients&,
                         const Coefficients& both) {
      DirectionField& field = result.fields[cell];
      for (int k = 0; k < 3; ++k) {
        field.turn[k][parameter] = both[k];
        field.score[k][parameter] = both[3 + k];
      }
    });
  }

  const PilotFigures& figures_;
  const PlanGrid& grid_;
  int parameters_;
  int threads_;
  std::array<CellCovariances, 2> total_;  // of all terms, weighed, from either half
  Prior prior_;                           // of total_
};

}  // namespace

FieldFit fit_fields(const PilotFigures& figures, int parameters, int threads) {
  return Fitter(figures, parameters, threads).run();
}

}  // namespace limn
