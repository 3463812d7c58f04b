// Images: the radiance estimator, run.
#include "limn/integrators/render.h"

#include <fmt/format.h>

#include <algorithm>

#include "integrators/estimates/batches.h"
#include "integrators/methods/blurred_estimator.h"
#include "integrators/methods/faces_estimator.h"
#include "integrators/methods/light_traced_estimator.h"
#include "integrators/methods/radiance_estimator.h"
#include "integrators/methods/render_seeds.h"
#include "integrators/methods/visibility_estimator.h"
#include "limn/core/check.h"
#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/names.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/options.h"
#include "limn/integrators/parts.h"

namespace limn {

namespace {

std::vector<std::string> names_looking_around() {
  std::vector<std::string> names;
  for (const MethodType& type : method_types()) {
    if (type.image && type.image->looks_around && !type.image->make) names.push_back(type.name);
  }
  return names;
}

Numbers numbers_of(const std::string& generator) {
  return number_of(kGeneratorOption, generator) == 0 ? Numbers::kEvenInRun : Numbers::kIndependent;
}

Scene with_direct_light_alone(const Scene& scene) {
  Scene direct = scene;
  direct.max_depth = 2;
  return direct;
}
RenderOptions of_radiance(RenderOptions options) {
  options.what = RenderWhat::kImage;
  return options;
}

std::unique_ptr<SampleEstimator> make_estimator(const Scene& scene, const RunSettings& settings,
                                                const RenderOptions& options) {
  check_task(options.method, Task::kImage);
  const ImageMethod& method = *options.method->image;
  const Numbers numbers = numbers_of(options.generator);  // checked for all
  if (method.looks_around) check_still(scene, "the method \"" + options.method.name() + "\"");
  check_points(options.points, method.closed_light, options.method.name());
  if ((!method.looks_around || method.make) && options.what != RenderWhat::kImage) {
    throw InputError(
        fmt::format("the method \"{}\" knows radiance alone: how open the sky is say {}",
                    options.method.name(), join(names_looking_around())));
  }
  if (options.points == FilmPoints::kFaces) {
    return std::make_unique<FacesEstimator>(scene, std::span<const Parameter>(), settings.threads);
  }
  if (method.make) return method.make(scene, settings, options.method->settings);
  if (method.looks_around) {
    return std::make_unique<VisibilityEstimator>(scene, settings, options);
  }
  if (options.method->blurs) {
    const Blur blur = resolved(options.method->blurred_by(options.blur), scene);
    return std::make_unique<BlurredEstimator>(scene, blur, std::span<const BlurredNumber>(),
                                              settings.threads, numbers);
  }
  if (method.from_lights) {
    return std::make_unique<LightTracedEstimator>(scene, settings.threads, numbers);
  }
  return std::make_unique<RadianceEstimator>(scene, settings.threads, method.closed_light, numbers);
}

// What the method reads of the options: parts that differ elsewhere are of one run.
void identify(BatchStore& store, const RenderOptions& options) {
  const ImageMethod& method = *options.method->image;
  store.identify("method", options.method.name());
  if (!method.looks_around) {
    store.identify("generator", options.generator);
    store.identify("blur", fmt::format("{}, {}", options.blur.sigma, options.blur.gamma));
    return;
  }
  store.identify("what", kRenderWhat[static_cast<int>(options.what)]);
  if (method.by_lines) {
    store.identify("lines", fmt::format("{}, tolerance {}", options.lines, options.tolerance));
  } else if (!method.make) {
    store.identify("rays", fmt::format("{}", options.rays));
  }
}

using EstimatorList = std::vector<std::unique_ptr<SampleEstimator>>;

EstimatorList estimators_of(const Scene& scene, const RunSettings& settings,
                            const RenderOptions& options) {
  EstimatorList estimators;
  estimators.push_back(make_estimator(scene, settings, options));
  check_memory(estimators);
  return estimators;
}

// The scene, if it moves, with what its times share.
std::optional<Scene> shared_by_times(const Scene& scene, int threads) {
  std::optional<Scene> start;
  if (is_moving(scene)) share_between_times(start.emplace(scene), threads);
  return start;
}

// watch: runs since the job began.
RenderResult run(const Scene& scene, const EstimatorList& estimators, const RunSettings& settings,
                 const Stopwatch& watch, const RenderOptions& options) {
  const FilmPoints points = options.points;
  const size_t size = film_size(scene.film);
  EstimatorsAt at;
  if (is_moving(scene)) {
    at = [&](double u) {
      const auto there = std::make_shared<const Scene>(at_time(scene, u));
      EstimatorsAtTime now{{there}};
      now.list.push_back(make_estimator(*there, settings, options));
      return now;
    };
  }
  RenderResult result;
  result.radiance = Moments(size);
  run_batches(
      estimators, settings, watch,
      [&](const Batch& batch, const auto& sums) {
        if (points == FilmPoints::kFaces) {
          result.radiance.add_exact(sums[0].radiance);
        } else {
          // Particles have an image of their own.
          std::vector<double> radiance = sums[0].radiance;
          for (const std::vector<double>& image : sums[0].images) {
            for (size_t i = 0; i < image.size(); ++i) radiance[i] += image[i];
          }
          result.radiance.add_batch(radiance, batch.count());
        }
        for (const TermCost& cost : sums[0].costs) result.rays += cost.rays;
        result.non_finite.merge(sums[0].non_finite);
        result.spp += batch.count();
      },
      at);
  result.seconds = watch.seconds();
  return result;
}

}  // namespace

RenderResult render(const Scene& scene, const RunSettings& requested,
                    const RenderOptions& options) {
  check_options(options);
  if (options.what == RenderWhat::kDirect) {
    return render(with_direct_light_alone(scene), requested, of_radiance(options));
  }
  const Stopwatch watch;
  const RunSettings settings = settings_for(options.points, requested);
  check_task(options.method, Task::kImage);
  check_blur(options.blur, {options.method});
  if (settings.store) identify(*settings.store, options);
  const std::optional<Scene> shared = shared_by_times(scene, settings.threads);
  const Scene& start = shared ? *shared : scene;
  const EstimatorList estimators = estimators_of(start, settings, options);
  const auto* around = dynamic_cast<const VisibilityEstimator*>(estimators[0].get());
  RenderResult result = run(start, estimators, settings, watch, options);
  if (options.method->blurs) {
    result.warnings.push_back(
        bias_of_blur(scene, resolved(options.method->blurred_by(options.blur), scene)));
  }
  if (around && around->missed() > 0) {
    result.warnings.push_back(fmt::format(
        "{} integrals did not reach the tolerance {} with {} lines: ask for a larger one",
        around->missed(), options.tolerance, kMostLines));
  }
  return result;
}

std::vector<RenderResult> render_seeds(const Scene& scene, const RunSettings& settings,
                                       std::span<const uint64_t> seeds,
                                       const RenderOptions& options) {
  // The estimators of others hold their seed.
  CHECK(!options.method->image->looks_around);
  const Stopwatch watch;
  RunSettings own = settings_for(options.points, settings);
  own.store = nullptr;
  const std::optional<Scene> shared = shared_by_times(scene, own.threads);
  const Scene& start = shared ? *shared : scene;
  const EstimatorList estimators = estimators_of(start, own, options);
  if (own.seconds > 0) {
    const double setup = watch.seconds() / static_cast<double>(seeds.size());
    own.seconds = std::max(1e-9, settings.seconds - setup);
  }
  std::vector<RenderResult> results;
  for (const uint64_t seed : seeds) {
    own.seed = seed;
    results.push_back(run(start, estimators, own, Stopwatch(), options));
  }
  return results;
}

std::vector<std::string> trace_sample(const Scene& scene, const RunSettings& settings,
                                      const NonFinite::SampleId& place,
                                      const RenderOptions& options) {
  check_options(options);
  if (options.what == RenderWhat::kDirect) {
    return trace_sample(with_direct_light_alone(scene), settings, place, of_radiance(options));
  }
  check_still(scene, "the trace of one sample (debug-sample)");
  const auto estimator = make_estimator(scene, settings, options);
  SampleLog log;
  if (!place.term.empty()) {
    run_film_sample(*estimator, settings, place, log);
    return log;
  }
  check_pixel(scene.film, place);
  run_pixel_sample(*estimator, settings.seed, {place.x, place.y, place.sample}, log);
  return log;
}

}  // namespace limn
