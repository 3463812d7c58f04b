#pragma once
// Directions and positions on the film that move by chance: no mean may change by it.
#include <cstdint>
#include <vector>

#include "integrators/pilot/sample_plan.h"
#include "integrators/pilot/term_estimator.h"

namespace limn {

// A turn and a score of every pixel and parameter, of the order of what moves. Their means are not
// zero: otherwise a change of the derivative that they should not make would go unseen in sums over
// pixels.
std::vector<DirectionField> random_fields(size_t count, const TermEstimator& estimator,
                                          uint64_t seed);
// The same of positions on the film.
std::vector<FilmMotion> random_motions(size_t count, const TermEstimator& estimator, uint64_t seed);

}  // namespace limn
