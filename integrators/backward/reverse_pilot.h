#pragma once
// What `adaptive` is in reverse mode: a pilot chooses between the edges of `forest` and the listed
// silhouettes of `silhouettes`, and how many samples each term takes. The run behind it is that of
// the method chosen; the pilot's samples are thrown away.
#include <memory>
#include <string>

#include "integrators/backward/reverse_estimator.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/run.h"

namespace limn {

struct ReversePlan {
  // With its numbers of samples.
  std::unique_ptr<ReverseEstimator> estimator;
  // For people to read; empty if there was nothing to decide, and nothing kept a pilot from it.
  std::string decision;
};

// With the method that stands in for `adaptive` where there is no pilot; other methods stay.
BackwardOptions without_pilot(const BackwardOptions& options);

// Whether `adaptive` lists silhouettes. listed, drawn: squared error x work that the pilot predicts
// for lists of silhouettes and for edges drawn from the forest.
bool lists_silhouettes(double listed, double drawn);

// options: of the method `adaptive` or another; then, and where samples, terms or uniform pixels
// are asked for, in runs too short for a pilot and where the scene has times, there is no pilot:
// `adaptive` is `forest` then, or `silhouettes` where one of its own terms is asked for, or where
// a run is too short and the scene has light sets. Pilots take an eighth of the shortest run that
// has one, about, or less. The plan follows from the seed, and from whether the samples are
// enough for a pilot: with a limit of time, which watch has run towards since the run began,
// settings are left that keep the run on one side. kept: for the estimator where there is no pilot.
ReversePlan planned(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
                    RunSettings& settings, const Stopwatch& watch, KeptEdges* kept = nullptr);

}  // namespace limn
