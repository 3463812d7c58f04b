#pragma once
// The pilot of a run: a few samples of every pixel, or of one pixel in every cell of a large film,
// for choices about the others. Its random numbers are its own, and its samples are thrown away: a
// choice that depends on the samples it is made for would bias them.
#include <array>
#include <functional>
#include <memory>
#include <numeric>
#include <vector>

#include "integrators/estimates/batches.h"
#include "integrators/pilot/allocation.h"
#include "integrators/pilot/pilot_moments.h"
#include "integrators/pilot/sample_plan.h"
#include "integrators/pilot/term_estimator.h"

namespace limn {

inline constexpr size_t kMostProbes = 65536;  // a film of 256 by 256 has them all; not tuned

struct PilotFigures {
  int spp = 0;  // samples of every probed pixel; 0: there was no time for a pilot
  PlanGrid grid;
  size_t pixel_slot = 0;  // of the term that traces paths
  // [half][slot]: covariances of one sample, from either half of the pilot. Empty for slots that
  // add nothing to pixels.
  std::array<std::vector<CellCovariances>, 2> halves;
  // Of slots on the film: the mean over pixels of the variance of one sample per pixel, summed over
  // channels, of each lane.
  std::vector<Lanes> film_variance;
  std::vector<Lanes> film_power;  // see DrawShares
  std::vector<Lanes> film_kept;   // the same; 0 where samples have no times
  // Of one sample of a slot, in every cell.
  std::vector<double> variances(size_t slot, int lane) const;
  std::vector<double> squared_means(size_t slot, int lane) const;
  std::vector<PairSums> pairs;     // of every slot; of none but those at vertices
  TracedDraws traced;              // of edges at vertices
  std::vector<double> work;        // of one sample of a pixel, of every slot, see Term::work
  std::vector<double> first_work;  // the same, see Term::first_work
  double seconds_of_work = 0;      // what a unit of work took; 0: there was no work

  double work_of_pixel() const { return std::accumulate(work.begin(), work.end(), 0.0); }
  // What further samples of a slot do.
  DrawShares shares(size_t slot, int lane) const {
    // Paths of a run are low-discrepancy: they leave so much of what those of a pilot do. Squared
    // error times time is 0.8 to 0.9 of that with 1 (a room whose lamp or whose object moves).
    constexpr double kEven = 0.3;
    if (!in_cells(slot)) return {film_kept[slot][lane], film_power[slot][lane]};
    const DrawShares shares = pairs[slot].shares(lane);
    return {kEven * shares.kept, shares.power};
  }
  // Whether a slot's samples belong to pixels.
  bool in_cells(size_t slot) const { return !halves[0][slot].empty(); }
  // Figures of other samples of the same pixels; once.
  void merge(const PilotFigures& more);

 private:
  template <class Function>
  std::vector<double> both_halves(size_t slot, const Function& of) const;
};

// Of the samples of a probed pixel: an even number. pixels: so many are probed, about.
struct PilotSamples {
  int first, last;
  size_t pixels = kMostProbes;
  int count() const { return last - first; }
};

// What a pilot's sample of a pixel takes [s], by one sample of a few. settings, watch: as of
// run_pilot.
double seconds_of_pixel(const TermEstimator& estimator, bool turns, const RunSettings& settings,
                        const Stopwatch& watch);

// Makes the estimator of one sample of a pilot, where samples have times: at that sample's time.
using TermsAt = std::function<std::unique_ptr<TermEstimator>(int sample)>;

// turns: whether turns of directions at first vertices are looked at. settings: its limit of time
// is what all pilots and the samples behind them share, which `watch` has timed since they began; a
// pilot takes what pilot_samples_in_time says, the samples before these included. at: makes
// each sample's estimator, which gets the plan of `estimator`; empty: all samples are of that one.
PilotFigures run_pilot(const TermEstimator& estimator, bool turns, PilotSamples samples,
                       const RunSettings& settings, const Stopwatch& watch, const TermsAt& at = {});

}  // namespace limn
