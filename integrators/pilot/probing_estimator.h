#pragma once
// What pilots have in common: they look at the terms of a run.
#include "integrators/pilot/term_estimator.h"

namespace limn {

// All is that of the terms, but for what the samples of a pixel add.
class ProbingEstimator : public SampleEstimator {
 public:
  explicit ProbingEstimator(const TermEstimator& terms) : terms_(terms) {}  // which outlive it

  const Scene& scene() const override { return terms_.scene(); }
  size_t slots() const override { return terms_.slots(); }
  const char* slot_name(size_t slot) const override { return terms_.slot_name(slot); }
  int lanes() const override { return terms_.lanes(); }
  Lanes lane_scale() const override { return terms_.lane_scale(); }
  bool samples_pixels() const override { return terms_.samples_pixels(); }
  size_t pixel_slot() const override { return terms_.pixel_slot(); }
  double film_samples(size_t slot) const override { return terms_.film_samples(slot); }
  int film_stream(size_t slot) const override { return terms_.film_stream(slot); }
  bool sample_film(size_t slot, double u, const Rng& key, RayCount& rays,
                   FilmSample& sample) const override {
    return terms_.sample_film(slot, u, key, rays, sample);
  }
  const FilmMotion* film_motion(int x, int y) const override { return terms_.film_motion(x, y); }
  const Vec3<Lanes>* turn(int x, int y) const override { return terms_.turn(x, y); }

 protected:
  const TermEstimator& terms_;
};

}  // namespace limn
