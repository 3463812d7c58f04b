#pragma once
// What a pilot found with a plan, where directions may turn as it found best.
#include <vector>

#include "integrators/pilot/field_fit.h"
#include "integrators/pilot/pilot.h"
#include "integrators/pilot/term_estimator.h"

namespace limn {

struct Probed {
  PilotFigures pilot;
  FieldFit fit;       // empty where turns are not looked at
  double shared = 1;  // of a pixel's variance by its own samples, what sharing them leaves

  // Of one sample of every slot, of a parameter: the mean over the film, and in cells where it has
  // them.
  struct Spread {
    std::vector<double> variances, squared_means;
    std::vector<std::vector<double>> cells, cells_squared;
  };
  Spread spread(int lane, bool turned = true) const;
  // After equal time, where samples are shared out best among terms: of so many parameters, as a
  // geometric mean; 0 where nothing of one was seen. turned: directions turn as fitted.
  double error_times_work(int parameters, bool turned = true) const;
};

// Arguments: as of run_pilot. The estimator has the plan that is looked at.
Probed probe(const TermEstimator& estimator, bool turns, const PilotSize& size,
             const RunSettings& settings, const Stopwatch& watch, const TermsAt& at = {});
// The same with the samples from those that it has up to size.spp, of the same pixels; as it was
// where time is short.
void extend(Probed& probed, const TermEstimator& estimator, bool turns, const PilotSize& size,
            const RunSettings& settings, const Stopwatch& watch);

// All is that of the terms, but for what the samples of a pixel add.
class ProbingEstimator : public SampleEstimator {
 public:
  explicit ProbingEstimator(const TermEstimator& terms) : terms_(&terms) {}  // which outlive it

  const Scene& scene() const override { return terms_->scene(); }
  size_t slots() const override { return terms_->slots(); }
  const char* slot_name(size_t slot) const override { return terms_->slot_name(slot); }
  int lanes() const override { return terms_->lanes(); }
  Lanes lane_scale() const override { return terms_->lane_scale(); }
  bool samples_pixels() const override { return terms_->samples_pixels(); }
  size_t pixel_slot() const override { return terms_->pixel_slot(); }
  double film_samples(size_t slot) const override { return terms_->film_samples(slot); }
  int film_stream(size_t slot) const override { return terms_->film_stream(slot); }
  bool sample_film(size_t slot, double u, const Rng& key, RayCount& rays,
                   FilmSample& sample) const override {
    return terms_->sample_film(slot, u, key, rays, sample);
  }
  const FilmMotion* film_motion(int x, int y) const override { return terms_->film_motion(x, y); }
  const Vec3<Lanes>* turn(int x, int y) const override { return terms_->turn(x, y); }

 protected:
  const TermEstimator* terms_;
};

}  // namespace limn
