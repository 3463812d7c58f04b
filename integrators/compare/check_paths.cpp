// Derivatives without edges against differences along the same paths.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "integrators/estimates/batches.h"
#include "integrators/pilot/term_estimator.h"
#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/parameter.h"
#include "limn/edgetree/edge_sampler_types.h"
#include "limn/integrators/check.h"

namespace limn {
namespace {

// Deeper in glass the least step leads paths elsewhere.
constexpr int kMostDepth = 8;
// Over the natural one. Long steps bend, short ones round: right derivatives agree at two of four.
// At one alone a wrong one may, by chance.
constexpr double kSteps[] = {1, 1e-2, 1e-4, 1e-6};

std::vector<double> derivative_of(const Scene& scene, const Parameter& parameter,
                                  const RunSettings& settings, PathsCheck& check) {
  const EdgeSamplerType& sampler = edge_sampler_types().front();
  const std::vector<const TermType*> types = terms_of(scene, sampler, false);
  std::vector<std::unique_ptr<SampleEstimator>> list;
  list.push_back(std::make_unique<TermEstimator>(
      scene, std::span(&parameter, 1), types, std::vector<bool>(types.size(), true), sampler,
      settings.threads, TermExtras{.of_differences = true}));
  check_memory(list);
  // Where no edge moves, no other has samples.
  const size_t slot = list[0]->pixel_slot();
  Moments image(film_size(scene.film));
  run_batches(list, settings, Stopwatch(), [&](const Batch& batch, const auto& sums) {
    image.add_batch(sums[0].images[slot], batch.count());
    check.non_finite.merge(sums[0].non_finite);
  });
  std::vector<double> means(image.size());
  for (size_t i = 0; i < means.size(); ++i) means[i] = image.mean(i);
  return means;
}

}  // namespace

void refuse_moved_paths(const Scene& scene, const std::string& name) {
  const Parameter parameter = find_parameter(scene, name);
  if (moved_in(scene, {&parameter, 1}).any()) {
    throw InputError(
        "--same-paths: \"" + name +
        "\" moves edges or where paths go, which differences along the same paths miss: "
        "leave it out");
  }
  check_still(scene, "--same-paths");
}

PathsCheck check_paths(const Scene& whole, const std::string& name, double step,
                       const RunSettings& settings) {
  Scene scene = whole;
  if (scene.max_depth < 0 || scene.max_depth > kMostDepth) scene.max_depth = kMostDepth;
  refuse_moved_paths(scene, name);
  const Parameter parameter = find_parameter(scene, name);
  DifferenceJob job{parameter, {}, {}};
  for (const double share : kSteps) job.steps.push_back(share * parameter.natural_step);
  if (step > 0) job.steps = {step};
  for (size_t k = 0; k < job.steps.size(); ++k) {
    job.combinations.emplace_back(job.steps.size());
    job.combinations[k][k] = 1;
  }
  PathsCheck check;
  const std::vector<double> gradient = derivative_of(scene, parameter, settings, check);
  const CentralDifferences run =
      central_differences(scene, {job}, 0, settings, false, std::nullopt, true);
  check.non_finite.merge(run.non_finite);
  check.interrupted = settings.interrupted && settings.interrupted->load();
  if (check.interrupted) return check;
  std::vector<PathsCheck> found(job.steps.size(), check);
  for (size_t k = 0; k < found.size(); ++k) {
    const Moments& differences = run.estimates[0][k].total;
    double apart = 0, both = 0;
    for (size_t i = 0; i < gradient.size(); ++i) {
      const double a = gradient[i], b = differences.mean(i);
      found[k].gradient_sum += a;
      found[k].difference_sum += b;
      apart += std::fabs(a - b);
      both += 0.5 * (std::fabs(a) + std::fabs(b));
    }
    found[k].step = job.steps[k];
    found[k].error = apart > 0 ? apart / both : 0;
  }
  std::ranges::sort(found, {}, &PathsCheck::error);
  return found[std::min<size_t>(1, found.size() - 1)];
}

}  // namespace limn
