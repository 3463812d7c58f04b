#pragma once
// A whole run of one method that works term by term.
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "integrators/estimates/sample_estimator.h"
#include "limn/edgetree/edge_sampler_types.h"
#include "limn/integrators/gradient.h"

namespace limn {

// What a method does beside sampling its terms.
struct TermMethod {
  EdgeSamplerType sampler = {};
  bool moves_directions = false;   // see direction_field.h
  bool spreads_samples = false;    // over pixels, see spread_samples
  bool moves_film = false;         // positions on the film, see film_fit.h
  bool random_directions = false;  // directions and positions move by chance: no mean may change
  bool warps = false;              // directions follow the edges that they see, see warp_field.h
  bool unbiased = false;           // the same without the bias of few rays
  bool closed = false;  // light that is scattered once in closed form, see closed_light.h
  Numbers numbers = Numbers::kIndependent;
  bool or_differences = false;  // where pilots expect less error of them
};

// The squared error and the cost that pilots predict for a run.
struct TermForecast {
  // Of each parameter, summed over channels: the variance of one sample of every term.
  std::vector<double> units;
  // Of one sample of a pixel: the squared error over these units, summed over parameters; work as
  // Term::work counts it; seconds that all pixels take.
  double error = 0, work = 0, seconds = 0;
  double tracer_seconds = 0;  // that a ray tracer took to build
};
// Asked behind the pilots of a run, where there was time for them: whether another method does the
// rest. It may not use the samples that the run would take, or its choice would bias them.
using Rival = std::function<std::optional<GradientResult>(const TermForecast&)>;

GradientResult run_terms(const TermMethod& method, const Scene& scene,
                         const GradientOptions& options, const RunSettings& settings,
                         const Rival& rival = {});

// With differences for a rival.
GradientResult run_fastest(const TermMethod& method, const Scene& scene,
                           const GradientOptions& options, const RunSettings& settings);

// What one sample of a run meets, line by line.
std::vector<std::string> trace_terms(const TermMethod& method, const Scene& scene,
                                     const GradientOptions& options, const RunSettings& settings,
                                     const NonFinite::SampleId& place);

// Of an image that FacesEstimator makes: one term, `faces`.
GradientResult run_faces(const Scene& scene, const GradientOptions& options,
                         const RunSettings& settings);

// As trace_sample() in gradient.h.
std::vector<std::string> trace_faces(const Scene& scene, const GradientOptions& options,
                                     const NonFinite::SampleId& place);

// `chosen`, or all if none is chosen. InputError that lists `known` for a name that is not among
// them. file: of the scene.
std::vector<std::string> selected_terms(const std::vector<std::string>& known,
                                        const std::vector<std::string>& chosen,
                                        const std::string& file);

}  // namespace limn
