// The reverse pass as a run of batches, each a gradient of its own.
#include "limn/integrators/backward.h"

#include <fmt/format.h>

#include <stdexcept>

#include "integrators/backward/faces_gradient.h"
#include "integrators/backward/parameter_slots.h"
#include "integrators/backward/reverse_estimator.h"
#include "integrators/backward/reverse_pilot.h"
#include "integrators/backward/steps.h"
#include "integrators/edges/scene_edges.h"
#include "integrators/estimates/batches.h"
#include "integrators/methods/hair_gaps.h"
#include "limn/core/exposure.h"
#include "limn/core/names.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/parts.h"

namespace limn {

const ParameterAdjoint& BackwardResult::of(const std::string& name) const {
  for (const ParameterAdjoint& parameter : parameters)
    if (parameter.name == name) return parameter;
  throw std::logic_error("no parameter \"" + name + "\" in this result");
}

namespace {

void check(const BackwardOptions& options) {
  check_task(options.method, Task::kBackward);
  check_points(options.points, options.method->closed_light, options.method.name());
}

void identify(const ReverseEstimator& estimator, const Image& adjoint,
              const BackwardOptions& options, const std::vector<TermRun>& terms,
              BatchStore& store) {
  const std::vector<Parameter>& parameters = estimator.parameters().parameters();
  std::vector<std::string> computed, samples;
  for (const TermRun& term : terms) {
    if (term.computed) computed.push_back(term.name);
    samples.push_back(fmt::format("{} {}", term.name, term.samples));
  }
  store.identify("method", "backward");
  store.identify("sampling", estimator.method_name());
  store.identify("adjoint", fingerprint({adjoint.data.begin(), adjoint.data.end()}));
  store.identify("parameters", join(names_of(parameters)));
  store.identify("velocities", fingerprint(estimator.scene(), parameters));
  store.identify("terms", join(computed));
  store.identify(
      "samples",
      fmt::format("{} pixels, {} edges, {} on film, {} of shadows, {}, {} batches",
                  options.uniform_pixels ? "uniform" : "adjoint", options.edge_samples,
                  options.camera_samples, options.shadow_samples, join(samples), options.batches));
}

// watch: runs since the job began.
template <class Estimator>
BackwardResult run(const Scene& scene, std::unique_ptr<Estimator> owned, const Image& adjoint,
                   const BackwardOptions& options, const RunSettings& settings,
                   const Stopwatch& watch) {
  constexpr bool kExact = std::is_same_v<Estimator, FacesGradient>;
  const Estimator& estimator = *owned;
  BackwardResult result;
  estimator.describe(result);
  for (const Parameter& p : estimator.parameters().parameters()) {
    result.parameters.push_back({p.name, p.unit, p.shape(), Moments(p.numbers())});
  }
  if constexpr (!kExact) {
    if (settings.store) identify(estimator, adjoint, options, result.terms, *settings.store);
  }
  result.setup_seconds = watch.seconds();
  std::vector<std::unique_ptr<SampleEstimator>> estimators;
  estimators.push_back(std::move(owned));
  EstimatorsAt at;
  KeptEdges kept;
  if (!kExact && needs_times(scene, estimator.parameters().parameters())) {
    at = [&](double u) {
      EstimatorsAtTime now;
      now.list.push_back(
          std::make_unique<ReverseEstimator>(scene, adjoint, options, settings.threads, u, &kept));
      return now;
    };
  }
  const auto take = [&](const Batch& batch, const auto& sums) {
    std::vector<std::vector<double>> numbers = sums[0].images;
    const std::vector<double> counts = numbers.back();
    numbers.pop_back();
    result.contributions += static_cast<uint64_t>(counts[0]);
    result.tape_bytes = std::max(result.tape_bytes, static_cast<uint64_t>(counts[1]));
    for (size_t i = 0; i < numbers.size(); ++i) {
      Moments& moments = result.parameters[i].moments;
      kExact ? moments.add_exact(numbers[i]) : moments.add_batch(numbers[i], batch.count());
    }
    if (options.each_batch) options.each_batch(batch.count(), numbers);
    for (size_t t = 0; t < result.terms.size(); ++t) result.terms[t].cost.merge(sums[0].costs[t]);
    result.non_finite.merge(sums[0].non_finite);
    result.spp += batch.count();
    ++result.batches;
  };
  run_batches(estimators, settings, watch, take, at);

  const bool moves = moved_in(estimator.scene(), estimator.parameters().parameters()).any();
  if (!kExact && moves && result.spp > 0 && options.find_gaps) {
    warn_of_hair_gaps(estimator.scene(), static_cast<double>(result.spp), settings.threads,
                      result.warnings);
  }
  result.seconds = watch.seconds();
  return result;
}

// kept: may be null.
BackwardResult backward(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
                        const RunSettings& requested, KeptEdges* kept) {
  check(options);
  const Stopwatch watch;
  RunSettings settings = settings_for(options.points, requested);
  if (options.points == FilmPoints::kFaces) {
    auto faces = std::make_unique<FacesGradient>(scene, adjoint, options, settings.threads);
    return run(scene, std::move(faces), adjoint, options, settings, watch);
  }
  ReversePlan plan = planned(scene, adjoint, options, settings, watch, kept);
  const BackwardOptions own = plan.estimator->options();
  BackwardResult result = run(scene, std::move(plan.estimator), adjoint, own, settings, watch);
  result.method = own.method.name();
  result.decision = plan.decision;
  return result;
}

}  // namespace

BackwardResult backward(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
                        const RunSettings& settings) {
  return backward(scene, adjoint, options, settings, nullptr);
}
BackwardResult backward(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
                        const RunSettings& settings, KeptEdges& kept) {
  // With times the estimator at the reference time takes no samples.
  return backward(scene, adjoint, options, settings, scene.exposure ? nullptr : &kept);
}

std::vector<std::string> trace_backward(const Scene& scene, const Image& adjoint,
                                        const BackwardOptions& options, const RunSettings& settings,
                                        const NonFinite::SampleId& place) {
  check(options);
  check_still(scene, "the trace of one sample (debug-sample)", reverse_parameters(scene, options));
  SampleLog log;
  const auto trace = [&](const auto& estimator) {
    for (const Parameter& p : estimator.parameters().parameters()) {
      log.push_back(fmt::format("parameter {}: {}", log.size() + 1, p.name));
    }
    run_sample(estimator, settings, place, log);
  };
  if (options.points == FilmPoints::kFaces) {
    trace(FacesGradient(scene, adjoint, options, settings.threads));
  } else {
    const Stopwatch watch;
    RunSettings own = settings;
    trace(*planned(scene, adjoint, options, own, watch).estimator);
  }
  return log;
}

}  // namespace limn
