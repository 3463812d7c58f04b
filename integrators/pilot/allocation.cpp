// Samples of each term for the least error after equal time.
#include "integrators/pilot/allocation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace limn {
namespace {

constexpr int kMost = 8;  // not tuned
// Products that differ by less are equal as far as a pilot can tell; the cheaper one leaves less
// behind when a run is stopped.
constexpr double kTie = 1.01;

std::vector<double> counts_to_try(const TermFigures& term) {
  std::vector<double> counts;
  // What costs nothing or does not vary is not there, or not worth more.
  for (double c = term.least; c < 1 && term.cost > 0; c *= 2) counts.push_back(c);
  for (int c = 1; c <= (term.variance > 0 && term.cost > 0 ? kMost : 1); ++c) counts.push_back(c);
  return counts;
}

constexpr int kSpreadRadii[] = {2, 4};  // windows of 5 by 5 and 9 by 9 cells
constexpr double kLeastShare = 0.25;    // of the mean; not tuned
constexpr int kMostInPixel = 64;        // not tuned
// A plan whose product is this close to the best has counts that are large enough. Short samples
// leave less behind when a run is stopped. Against 1.1, squared error times time is 0.76 to 0.97
// (a lamp moves, in a room and alone; an object in that room).
constexpr double kRounding = 1.03;

// Counts before rounding, at the scale 1; empty for a term of the film.
struct Wish {
  std::vector<double> cells;     // where they are 1 or more
  std::vector<double> rare;      // where they are less
  std::vector<double> variance;  // of the same cells, smoothed
  std::vector<double> squared;   // mean, the same
};

void raise_to_least_share(std::vector<double>& counts) {
  const double mean =
      std::accumulate(counts.begin(), counts.end(), 0.0) / static_cast<double>(counts.size());
  for (double& count : counts) count = std::max(count, kLeastShare * mean);
}

// Means over a window around each cell, the cell itself left out.
std::vector<double> means_around(const PlanGrid& grid, const std::vector<double>& values,
                                 int radius) {
  std::vector<double> means = window_means(grid, values, radius);
  for (size_t i = 0; i < means.size(); ++i) {
    const int x = static_cast<int>(i) % grid.columns, y = static_cast<int>(i) / grid.columns;
    const int columns = std::min(grid.columns - 1, x + radius) - std::max(0, x - radius) + 1;
    const int rows = std::min(grid.rows - 1, y + radius) - std::max(0, y - radius) + 1;
    const int count = columns * rows;
    if (count > 1) means[i] = (means[i] * count - values[i]) / (count - 1);
  }
  return means;
}

// Each is where one more sample is worth its work: v (1 - kept) power / n^(power + 1) = price c.
// The scale is price^(-1/2). around: by the cells around each.
Wish wish_of(const TermFigures& term, const PlanGrid& grid, bool around = false) {
  Wish wish;
  if (term.cells.empty()) return wish;
  wish.variance.assign(grid.size(), 0);
  wish.squared.assign(grid.size(), 0);
  wish.cells.assign(grid.size(), 0);
  wish.rare.assign(grid.size(), 0);
  // What a pilot has not seen may be there: one sample, whatever the scale.
  if (!(term.variance > 0)) return wish;
  const auto smooth = [&](const std::vector<double>& values, std::vector<double>& to) {
    for (const int radius : kSpreadRadii) {
      const std::vector<double> means =
          around ? means_around(grid, values, radius) : window_means(grid, values, radius);
      for (size_t i = 0; i < grid.size(); ++i)
        to[i] += std::max(means[i], 0.0) / std::size(kSpreadRadii);
    }
  };
  smooth(term.cells, wish.variance);
  if (!term.cells_squared.empty()) smooth(term.cells_squared, wish.squared);
  if (!(term.cost > 0)) return wish;
  const auto& [kept, power] = term.shares;
  for (size_t i = 0; i < grid.size(); ++i) {
    const double drawn = wish.variance[i] * (1 - kept) * power;
    wish.cells[i] = std::pow(drawn / (term.cost - term.first), 1 / (power + 1));
    wish.rare[i] = std::sqrt((wish.variance[i] + wish.squared[i]) / term.cost);
  }
  raise_to_least_share(wish.cells);
  raise_to_least_share(wish.rare);
  return wish;
}

double count_at(const TermFigures& term, double wish, double scale) {
  return term.shares.power == 1 ? wish * scale
                                : wish * std::pow(scale, 2 / (term.shares.power + 1));
}

// The number nearest to what is wished for that a pixel can have.
double possible(const TermFigures& term, const Wish& wish, size_t cell, double scale) {
  if (!(term.variance > 0)) return 1;
  const double rare = scale * wish.rare[cell];
  if (rare < 0.75) return std::max(rare, term.least);
  if (rare < 1) return 1;
  return std::clamp(std::round(count_at(term, wish.cells[cell], scale)), 1.0, double{kMostInPixel});
}

// Counts at one scale: those of terms of the film for the least product there.
struct ScaledPlan {
  PlanTotals totals;
  std::vector<double> film;  // of each term; 0 of the others
};

// Of the terms of cells, with all wishes multiplied by `scale`.
PlanTotals totals_of_cells(const std::vector<TermFigures>& terms, const std::vector<Wish>& wishes,
                           double scale) {
  PlanTotals totals;
  for (size_t t = 0; t < terms.size(); ++t) {
    const double each = 1.0 / static_cast<double>(wishes[t].cells.size());
    for (size_t i = 0; i < wishes[t].cells.size(); ++i) {
      const double n = possible(terms[t], wishes[t], i, scale);
      totals.error += each * terms[t].left_by(n, wishes[t].variance[i], wishes[t].squared[i]);
      totals.cost += each * terms[t].cost_of(n);
    }
  }
  return totals;
}

// The count of a term of the film beside `others`: the smallest whose product is that close to the
// least, or the largest that costs no more than is left of `most`; the fewest if none is
// that cheap.
double best_on_film(const TermFigures& term, const PlanTotals& others, double most) {
  if (!(term.variance > 0)) return term.least;
  constexpr double kStep = 1.189207115002721;  // the fourth root of 2
  const auto cost = [&](double n) { return others.cost + term.cost_of(n); };
  const auto product = [&](double n) { return (others.error + term.left_by(n)) * cost(n); };
  double least = std::numeric_limits<double>::infinity();
  for (double n = term.least; n <= kMostInPixel; n *= kStep) least = std::min(least, product(n));
  double n = term.least;
  while (product(n) > kRounding * least && cost(n * kStep) <= most) n *= kStep;
  return n;
}

ScaledPlan plan_at(const std::vector<TermFigures>& terms, const std::vector<Wish>& wishes,
                   double scale, double most) {
  ScaledPlan plan{totals_of_cells(terms, wishes, scale), std::vector<double>(terms.size())};
  PlanTotals& sum = plan.totals;
  const auto add = [&](size_t t, double sign) {
    sum.error += sign * terms[t].left_by(plan.film[t]);
    sum.cost += sign * terms[t].cost_of(plan.film[t]);
  };
  for (size_t t = 0; t < terms.size(); ++t) {
    if (!wishes[t].cells.empty()) continue;
    plan.film[t] = terms[t].least;
    add(t, 1);
  }
  // Each beside the others: after a few rounds none would change.
  for (int round = 0; round < 3; ++round) {
    for (size_t t = 0; t < terms.size(); ++t) {
      if (!wishes[t].cells.empty()) continue;
      add(t, -1);
      plan.film[t] = best_on_film(terms[t], sum, most);
      add(t, 1);
    }
  }
  return plan;
}

// The largest scale up to `scale` where a sample costs no more than `most`; 0, which leaves every
// term the fewest samples that it can have, where none is that cheap. Costs grow with the scale.
double fitting_scale(const std::vector<TermFigures>& terms, const std::vector<Wish>& wishes,
                     double scale, double most) {
  const auto fits_at = [&](double s) {
    return plan_at(terms, wishes, s, most).totals.cost <= most;
  };
  if (fits_at(scale)) return scale;
  double fits = 0, exceeds = scale;
  for (int i = 0; i < 20; ++i) {
    const double middle = (fits + exceeds) / 2;
    (fits_at(middle) ? fits : exceeds) = middle;
  }
  return fits;
}

// The scale at which the largest count of any cell is so large.
double scale_of(const std::vector<TermFigures>& terms, const std::vector<Wish>& wishes,
                double count) {
  double scale = kNoLimit;
  for (size_t t = 0; t < terms.size(); ++t) {
    for (const double wish : wishes[t].cells) {
      if (wish > 0) {
        scale = std::min(scale, std::pow(count / wish, (terms[t].shares.power + 1) / 2));
      }
    }
  }
  return scale;
}

// 0 where no term of cells varies.
double best_scale(const std::vector<TermFigures>& terms, const std::vector<Wish>& wishes) {
  const double smallest = scale_of(terms, wishes, 0.5);
  if (smallest == kNoLimit) return 0;
  const double largest = scale_of(terms, wishes, kMostInPixel);
  std::vector<double> scales, products;
  for (double scale = smallest; scale <= largest; scale *= std::sqrt(2.0)) {
    scales.push_back(scale);
    products.push_back(plan_at(terms, wishes, scale, kNoLimit).totals.product());
  }
  const double least = *std::min_element(products.begin(), products.end());
  for (size_t i = 0; i < scales.size(); ++i) {
    if (products[i] <= kRounding * least) return scales[i];
  }
  return scales.front();
}

constexpr int kLeastPilot = 4;  // two for each half

}  // namespace

double most_work(double left, double each, int samples, size_t pixels) {
  if (!(each > 0)) return kNoLimit;
  return std::max(left, 0.0) / (each * std::max(samples, 1) * static_cast<double>(pixels));
}

// The least product of two sums lies on the lower hull of all choices, where every term has its own
// least of variance / n + price * cost * n for one price. As the price falls, counts rise one by
// one: each step is taken where both of its counts are alike.
SampleCounts best_samples(const std::vector<TermFigures>& figures, double most) {
  struct Step {
    double price;
    size_t term;
    double count;  // after it
  };
  std::vector<Step> steps;
  std::vector<double> samples;
  double variance = 0, cost = 0;
  for (size_t t = 0; t < figures.size(); ++t) {
    const TermFigures& term = figures[t];
    const std::vector<double> counts = counts_to_try(term);
    samples.push_back(counts.front());
    variance += term.left_by(counts.front());
    cost += term.cost_of(counts.front());
    for (size_t i = 1; i < counts.size(); ++i) {
      const double fewer = counts[i - 1], more = counts[i];
      const double lost = term.left_by(fewer) - term.left_by(more);
      steps.push_back({lost / (term.cost_of(more) - term.cost_of(fewer)), t, more});
    }
  }
  std::stable_sort(steps.begin(), steps.end(),
                   [](const Step& a, const Step& b) { return a.price > b.price; });
  double least = variance * cost;
  std::vector<double> best = samples;
  for (const Step& step : steps) {
    const TermFigures& term = figures[step.term];
    variance += term.left_by(step.count) - term.left_by(samples[step.term]);
    cost += term.cost_of(step.count) - term.cost_of(samples[step.term]);
    samples[step.term] = step.count;
    if (cost > most) break;
    if (variance * cost * kTie >= least) continue;
    least = variance * cost;
    best = samples;
  }
  return least > 0 ? SampleCounts(best) : SampleCounts();
}

namespace {

// The error of a plan by its scale, where each cell's count is that which the cells around it wish
// for: its own figures tell what that leaves.
double error_beyond(const std::vector<TermFigures>& figures, const PlanGrid& grid,
                    const ScaledPlan& plan, double scale) {
  double error = 0;
  std::vector<double> cells(grid.size());
  for (size_t t = 0; t < figures.size(); ++t) {
    const TermFigures& term = figures[t];
    const Wish wish = wish_of(term, grid, true);
    if (wish.cells.empty()) error += term.left_by(plan.film[t]);
    for (size_t i = 0; i < wish.cells.size(); ++i) {
      const double squared = term.cells_squared.empty() ? 0 : term.cells_squared[i];
      cells[i] += term.left_by(possible(term, wish, i, scale), term.cells[i], squared);
    }
  }
  error += trimmed_mean(cells);
  return error;
}

}  // namespace

PlanTotals spread_samples(const std::vector<TermFigures>& figures, const PlanGrid& grid,
                          SamplePlan& plan, double most, bool expect) {
  std::vector<Wish> wishes;
  for (const TermFigures& term : figures) wishes.push_back(wish_of(term, grid));
  const auto varies = [](const TermFigures& term) { return term.variance > 0 && term.cost > 0; };
  if (std::none_of(figures.begin(), figures.end(), varies)) return {};
  const double scale = fitting_scale(figures, wishes, best_scale(figures, wishes), most);
  const ScaledPlan scaled = plan_at(figures, wishes, scale, most);
  plan.grid = grid;
  plan.counts.assign(grid.size(), {});
  std::vector<double> means;
  for (size_t t = 0; t < figures.size(); ++t) {
    if (wishes[t].cells.empty()) {
      means.push_back(scaled.film[t]);
      continue;
    }
    double sum = 0;
    for (size_t i = 0; i < grid.size(); ++i) {
      plan.counts[i][t] = static_cast<float>(possible(figures[t], wishes[t], i, scale));
      sum += plan.counts[i][t];
    }
    means.push_back(sum / static_cast<double>(grid.size()));
  }
  plan.uniform = SampleCounts(means);
  PlanTotals totals = scaled.totals;
  totals.expected = expect ? error_beyond(figures, grid, scaled, scale) : totals.error;
  return totals;
}

PlanTotals totals_of(const std::vector<TermFigures>& figures, const SampleCounts& counts) {
  PlanTotals totals;
  for (size_t t = 0; t < figures.size(); ++t) {
    totals.error += figures[t].left_by(counts[t]);
    totals.cost += figures[t].cost_of(counts[t]);
  }
  totals.expected = totals.error;
  return totals;
}

double least_error_times_cost(const std::vector<TermFigures>& figures) {
  return totals_of(figures, best_samples(figures)).product();
}

Lanes survival_of(const TracedDraws& traced, double price, std::span<const double> units) {
  Lanes survival;
  if (!(price > 0) || traced.rays == 0) return survival;
  const double squared = traced.squared_difference / (price * static_cast<double>(traced.rays));
  for (size_t k = 0; k < units.size(); ++k) {
    survival[static_cast<int>(k)] =
        units[k] > 0 ? std::sqrt(squared / units[k]) : std::numeric_limits<double>::infinity();
  }
  return survival;
}

double trimmed_mean(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t kept = values.size() - values.size() / 1000;
  return std::accumulate(values.begin(), values.begin() + static_cast<long>(kept), 0.0) /
         static_cast<double>(kept);
}

int pilot_samples(int spp) {
  // At 8 samples the least pilot takes half as much again, and without it squared error times time
  // is 1.9 to 4.2 times as large (lights, CAD part, plant, sun), 0.8 to 2.5 times in a room, behind
  // leaves, spikes and a fence (without the noisiest hundredth).
  if (spp < 8) return 0;
  // In runs of 192 samples with a pilot of 16 in place of 8, squared error times rays fell to 0.83
  // (near mirror), 0.84 (chandelier), 0.97 (soft shadow) and 0.5 (demo).
  return std::clamp(spp / 8, kLeastPilot, 32) / 2 * 2;
}

// A run of 1.2 s without a pilot, for which an eighth is too short, has 1.2 to 11 times the squared
// error of one with four samples.
int pilot_samples_in_time(int spp, double each, double seconds, double left) {
  constexpr double kMostTime = 0.3;  // of what is left; not tuned
  const int fitting = static_cast<int>(std::min(seconds / 8 / each, 1e6));
  if ((kLeastPilot - 1) * each > kMostTime * left) return 0;
  return std::min(spp, std::max(fitting, kLeastPilot)) / 2 * 2;
}

PilotSize pilot_size(double each, size_t pixels, int spp, double seconds, double left) {
  constexpr size_t kFewest = 64;     // pixels that tell terms apart; not tuned
  constexpr double kMostTime = 0.3;  // as above
  const double fitting = std::min(seconds / (each * static_cast<double>(pixels)), 1e6);
  if (fitting >= kLeastPilot) return {pixels, std::min(spp, static_cast<int>(fitting) / 2 * 2)};
  const auto some = static_cast<size_t>(std::max(seconds, 0.0) / (kLeastPilot * each));
  const size_t chosen = std::clamp(some, std::min(kFewest, pixels), pixels);
  if (kLeastPilot * each * static_cast<double>(chosen) > kMostTime * left) return {0, 0};
  return {chosen, kLeastPilot};
}

int film_pilot_samples(int spp) { return spp < 32 ? 0 : std::clamp(spp / 16, 8, 32) / 8 * 8; }

}  // namespace limn
