#pragma once
// What one path, or one point of the film, adds to a gradient. Terms are those of forward mode.
#include <array>
#include <memory>
#include <vector>

#include "integrators/backward/edge_motion.h"
#include "integrators/backward/film_adjoint.h"
#include "integrators/estimates/sample_estimator.h"
#include "integrators/paths/path.h"
#include "integrators/terms/term.h"

namespace limn {

// What all samples of a reverse pass share.
struct AdjointContext {
  const PathContext& path;
  EdgeMotion motion;
  FilterTable filter;
  std::vector<std::unique_ptr<Term>> terms = {};  // of each slot; null where not computed
  size_t pixel_slot = 0;                          // of the term that traces paths
  int edge_samples = 1;                           // of each term, at every vertex

  const Scene& scene() const { return path.scene; }
};

using AdjointCosts = std::array<TermCost, kMostTerms>;

// The path of sample `key` through pixel (x, y), weighed by `adjoint`: the pixel's, over its
// expected number of paths. Adds to `contributions`; false if something was not finite, and then
// nothing is added. Writes to the tape, which is cleared first.
bool add_path_adjoint(const AdjointContext& context, int x, int y, const Rng& key,
                      const Rgb<double>& adjoint, Tape& tape, AdjointCosts& costs,
                      std::vector<Contribution>& contributions);

// A sample of the film, as Term::sample_film takes it.
struct FilmDraw {
  size_t slot;
  double u;
  Rng key;
  double share;  // of the batch's samples, one over their number for each pixel and path
};
// The same for it.
bool add_film_adjoint(const AdjointContext& context, const FilmAdjoint& film, const FilmDraw& draw,
                      Tape& tape, TermCost& cost, std::vector<Contribution>& contributions);

// Whether all are finite; appends them if so.
bool append_finite(const Tape& tape, std::vector<Contribution>& contributions);

}  // namespace limn
