// Motions by chance.

#include "integrators/pilot/film_fit.h"

namespace limn {

std::vector<DirectionField> random_fields(size_t count, const TermEstimator& estimator,
                                          uint64_t seed) {
  constexpr uint64_t kStream = 0xf1e1d;  // any number
  const Lanes steps = estimator.lane_scale();
  std::vector<DirectionField> fields(count);
  for (size_t i = 0; i < count; ++i) {
    Rng rng(mix_bits(seed + kStream), i, 0);
    for (Vec3<Lanes>* v : {&fields[i].turn, &fields[i].score}) {
      for (int k = 0; k < 3; ++k) {
        for (int lane = 0; lane < estimator.lanes(); ++lane) {
          (*v)[k][lane] = rng.uniform() * steps[0] / steps[lane];
        }
      }
    }
  }
  return fields;
}

std::vector<FilmMotion> random_motions(size_t count, const TermEstimator& estimator,
                                       uint64_t seed) {
  constexpr uint64_t kStream = 0xf1e2d;  // any number
  const Lanes steps = estimator.lane_scale();
  const double speed = film_speed(estimator);
  std::vector<FilmMotion> motions(count);
  for (size_t i = 0; i < count; ++i) {
    Rng rng(mix_bits(seed + kStream), i, 0);
    for (Lanes* v : {&motions[i].x, &motions[i].y}) {
      for (int lane = 0; lane < estimator.lanes(); ++lane) {
        (*v)[lane] = speed * rng.uniform() * steps[0] / steps[lane];
      }
    }
  }
  return motions;
}

}  // namespace limn
