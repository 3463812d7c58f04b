#pragma once
// How a job's work is shared among the terms of a derivative, and among the pixels.
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "integrators/pilot/pilot_moments.h"
#include "integrators/pilot/sample_plan.h"
#include "integrators/terms/lane_sinks.h"

namespace limn {

// The fewest samples of a term in one of a pixel, where they are spread: a rare event that a pilot
// has not seen must not cost more than this. Not tuned.
inline constexpr double kLeastSamples = 0.125;

inline constexpr double kNoLimit = std::numeric_limits<double>::infinity();

// The most work of a sample of one pixel, so that `samples` of all `pixels` fit into the seconds
// that are left, where a unit of work takes `each`: kNoLimit if no work was met.
double most_work(double left, double each, int samples, size_t pixels);

// What a pilot finds of one sample of a term, in units that all terms share.
struct TermFigures {
  double variance = 0;  // a mean over pixels, without the thousandth of them that varies most
  double cost = 0;
  double least = 1;  // the fewest samples it can have in a sample of a pixel
  // The variance in every cell of a grid; empty for a term of the film.
  std::vector<double> cells = {};
  // Of the cost, never all: what further samples at the same vertices do not take again.
  double first = 0;
  DrawShares shares = {};  // of the variance
  bool on_film = false;    // its samples are stratified over the film, also where they are few
  // The square of a sample's mean, averaged over pixels, and in every cell. A path without the term
  // adds 0, so fewer than one sample per path adds this square to the variance.
  double squared_mean = 0;
  std::vector<double> cells_squared = {};

  // The variance with so many samples. One has the variance `own` and the squared mean `squared`.
  double left_by(double samples, double own, double squared) const {
    if (samples < 1 && !on_film) return (own + squared) / samples - squared;
    return own * (shares.kept + (1 - shares.kept) * std::pow(samples, -shares.power));
  }
  double left_by(double samples) const { return left_by(samples, variance, squared_mean); }

  double cost_of(double samples) const {
    return cost * samples - first * std::max(samples - 1, 0.0);
  }
};

// What a plan leaves and what it costs, of one sample of a pixel.
struct PlanTotals {
  double error = 0, cost = 0;
  // The error that other samples than the pilot's are expected to have: the plan gives more where
  // the pilot's are large, by chance too.
  double expected = 0;
  double product() const { return error * cost; }
  // Of work, the Lagrange multiplier of the plan: how much of the squared error a unit of work is
  // worth in it; 0 if there is none.
  double price() const { return cost > 0 ? error / cost : 0; }
};

// After equal time, the squared error goes with (sum of variance / samples) times (sum of cost *
// samples). Its minimum is at samples ~ sqrt(variance / cost); this is the best of the small counts
// in use: at most eight, so that a pilot that saw too little of a term starves it no further.
// most: the most that a sample of a pixel may cost; where no choice is that cheap, the result is
// the cheapest.
SampleCounts best_samples(const std::vector<TermFigures>& figures, double most = kNoLimit);

// Squared error times cost with these.
double least_error_times_cost(const std::vector<TermFigures>& figures);

// The same as best_samples for every cell. The ideal share of a cell goes with the standard
// deviation there; a pilot sees that too rarely in one cell, so the variance is the mean of those
// over 5 by 5 and 9 by 9 cells, and a share is a quarter of the mean at least. Counts are whole;
// they are as small as rounding allows.
// most: see best_samples; the mean over cells. expect: whether to find PlanTotals::expected.
PlanTotals spread_samples(const std::vector<TermFigures>& figures, const PlanGrid& grid,
                          SamplePlan& plan, double most = kNoLimit, bool expect = false);

// The same where all pixels have these counts.
PlanTotals totals_of(const std::vector<TermFigures>& figures, const SampleCounts& counts);

// See SamplePlan. A draw of weight w and radiance difference d adds (w d)^2 to the squared error.
// Traced with the probability p it adds (w d)^2 / p, for p of its rays' work: p = w d / sqrt(price
// work) is best. Differences and work are those of all draws, means of squares and of rays. units:
// of the squared error of every parameter; where one is 0, all draws are traced.
Lanes survival_of(const TracedDraws& traced, double price, std::span<const double> units);

// Without the thousandth of the values that is largest: single bright samples would rule a choice.
double trimmed_mean(std::vector<double> values);

// Samples per pixel of a pilot for a job of `spp`, even; 0 if the job is too short for one.
int pilot_samples(int spp);
// How many of these where one took `each` seconds, in a job of so many, so many of which are left:
// what an eighth of the job holds, or at least four, if these take no more than 0.3 of what is
// left; 0 otherwise.
int pilot_samples_in_time(int spp, double each, double seconds, double left);
// How many pixels a pilot looks at, with how many samples each.
struct PilotSize {
  size_t pixels;
  int spp;
};
// At most `pixels` and `spp`, in about so many seconds, where a sample of a pixel takes `each`: a
// share of the pixels where four samples of all do not fit. At least four samples of a few; no
// pixels if `left` seconds are too few for that.
PilotSize pilot_size(double each, size_t pixels, int spp, double seconds, double left);
// The same of the pilot that finds how positions on the film move, of every other pixel.
int film_pilot_samples(int spp);

}  // namespace limn
