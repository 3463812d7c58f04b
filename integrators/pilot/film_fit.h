#pragma once
// How positions on the film move: chosen for every cell by a pilot of its own, which comes behind
// the first samples of the other one. With positions that move by V (terms/filter.cpp) a derivative
// changes by V times an amount whose mean is zero: what all other terms add where the film moves
// under the scene, edges at rest included, less what the pixels lose and gain at their rims. So V
// is the coefficient of a control variate: any one is right, and one that follows what a pixel sees
// takes out most of what slides and is covered there, shadows and mirror images as well.
#include <cstdint>
#include <vector>

#include "integrators/pilot/pilot.h"
#include "integrators/pilot/probed.h"
#include "integrators/pilot/sample_plan.h"
#include "integrators/pilot/term_estimator.h"

namespace limn {

// The film takes two lanes behind those of the parameters.
inline constexpr int kMostFilmParameters = kLanes - 2;

struct FilmFit {
  PlanGrid grid;                   // as fine as kMostProbes allows
  std::vector<FilmMotion> motion;  // by cell; empty if positions are better held everywhere
};

struct FilmLook {
  int spp;      // of every other probed pixel, at most
  double work;  // of these, at most: see TermEstimator::work
  // Positions are held where motion leaves more than this share of squared error times work, while
  // directions are held.
  double most_left;
  size_t pixels = kMostProbes;  // that are probed, as by the other pilot
};

// What a pilot took of a limit of time.
struct PilotTime {
  int spp;  // samples of every probed pixel
  double taken, seconds;
};

// From so many edges in a pixel on, their motion is looked for by pilots of a share of the pixels.
// Not tuned.
inline constexpr double kFilmDetail = 2;
// Edges that move on the film, hidden ones too, for each pixel that any of them lies in.
double edges_per_pixel(const TermEstimator& estimator);

// Whether looking for motion pays: it takes two pilots more. slides: whether textures, or all
// that is seen, may slide. detail: edges_per_pixel.
bool is_time_for_film(const PilotTime& pilot, bool slides, double detail);

// By a pilot, which chooses between film_flows and motions that fit its samples, in windows about
// each cell that it looks at. The estimator has kMostFilmParameters at most, and is left with a
// plan that is of no use. settings, watch: as of run_pilot; it takes a 16th of a limit of time.
// Deterministic on any number of threads.
FilmFit fit_film(TermEstimator& estimator, const SamplePlan& plan, const FilmLook& look,
                 const RunSettings& settings, const Stopwatch& watch);

// How fast, about, what moves does so on the film [pixels per unit of the first parameter].
double film_speed(const TermEstimator& estimator);

// All terms with two lanes more than there are parameters, at the pixels that a pilot probes:
// `turn` samples at every other one, then as many at the rest, and so on.
class FilmProbe final : public ProbingEstimator {
 public:
  // Both must outlive it.
  FilmProbe(const TermEstimator& terms, const PlanGrid& grid, int turn)
      : ProbingEstimator(terms), grid_(grid), turn_(turn) {}

  int lanes() const override { return terms_->lanes() + 2; }
  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override;
  bool looks_at(const PixelSample& at) const;

 private:
  const PlanGrid& grid_;
  int turn_;
};

// A turn and a score of every pixel and parameter, of the order of what moves. Their means are not
// zero: otherwise a change of the derivative that they should not make would go unseen in sums over
// pixels.
std::vector<DirectionField> random_fields(size_t count, const TermEstimator& estimator,
                                          uint64_t seed);
// The same of positions on the film.
std::vector<FilmMotion> random_motions(size_t count, const TermEstimator& estimator, uint64_t seed);

}  // namespace limn
