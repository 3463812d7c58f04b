#pragma once
// What one path adds to a gradient: the interior term, and the terms of edges at its vertices.
#include "integrators/backward/adjoint_context.h"
#include "integrators/estimates/sample_estimator.h"

namespace limn {

// The path of sample `key` through pixel (x, y), weighed by `adjoint`: the pixel's, over its
// expected number of paths. Adds to `contributions`; false if something was not finite, and then
// nothing is added. Writes to the tape, which is cleared first.
bool add_path_adjoint(const AdjointContext& context, int x, int y, const Rng& key,
                      const Rgb<double>& adjoint, Tape& tape, AdjointCosts& costs,
                      std::vector<Contribution>& contributions);

// Whether all are finite; appends them if so.
bool append_finite(const Tape& tape, std::vector<Contribution>& contributions);

}  // namespace limn
