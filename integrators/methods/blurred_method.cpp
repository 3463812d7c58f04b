// Derivatives of scenes whose faces are blurred, as a method.
#include "integrators/estimates/batches.h"
#include "integrators/methods/blurred_estimator.h"
#include "integrators/methods/method_table.h"
#include "integrators/methods/term_sums.h"
#include "limn/core/exposure.h"

namespace limn {
namespace {

GradientResult empty_result(const Scene& scene, const GradientOptions& options,
                            const std::string& term) {
  const Film& film = scene.film;
  GradientResult result;
  result.terms.push_back({term, true, false, 1, {}, {}});
  result.radiance = Moments(film_size(film));
  for (const std::string& name : options.parameters) {
    ParameterGradient& g = result.parameters.emplace_back();
    g.name = name;
    g.total = Moments(film_size(film));
    g.terms = {g.total};
    g.image_sum = Moments(1);
    const int block = options.block;
    g.total_blocks =
        Moments(block > 0 ? block_count(film.crop_width, film.crop_height, block) : 0, true);
    g.term_blocks = {g.total_blocks};
  }
  return result;
}

}  // namespace

GradientResult run_blurred(const MethodType& method, const Scene& scene,
                           const GradientOptions& options, const RunSettings& settings) {
  const Stopwatch watch;
  const Blur blur = resolved(method.blurred_by(options.blur), scene);
  const std::vector<Parameter> parameters = parameters_of(scene, options);
  std::vector<BlurredNumber> derived;
  for (const Parameter& parameter : parameters) derived.push_back({parameter});
  const auto passes = blurred_passes(scene, blur, derived, settings.threads);
  const EstimatorsAt at = [&](double u) {
    return EstimatorsAtTime{{}, blurred_passes(scene, blur, derived, settings.threads, u)};
  };
  check_memory(passes);
  GradientResult result = empty_result(scene, options, method.terms[0]);
  result.settings = {{"sigma", blur.sigma}, {"gamma", blur.gamma}};
  result.warnings.push_back(bias_of_blur(scene, blur));
  result.setup_seconds = watch.seconds();
  const auto take = [&](const Batch& batch, const auto& sums) {
    result.radiance.add_batch(sums[0].radiance, batch.count());
    for (size_t k = 0; k < parameters.size(); ++k) {
      collect({&sums[k / kLanes].images[k % kLanes]}, result.terms, batch.count(), scene.film,
              options.block, result.parameters[k]);
    }
    for (const BatchSums& s : sums) {
      result.terms[0].cost.merge(s.costs[0]);
      result.non_finite.merge(s.non_finite);
    }
    result.spp += batch.count();
  };
  run_batches(passes, settings, watch, take, needs_times(scene, parameters) ? at : EstimatorsAt());
  result.seconds = watch.seconds();
  return result;
}

}  // namespace limn
