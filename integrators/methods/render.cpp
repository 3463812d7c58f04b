// Images: the radiance estimator, run.
#include "limn/integrators/render.h"

#include <fmt/format.h>

#include <algorithm>

#include "integrators/estimates/batches.h"
#include "integrators/methods/faces_estimator.h"
#include "integrators/methods/radiance_estimator.h"
#include "integrators/methods/render_seeds.h"
#include "integrators/methods/visibility_estimator.h"
#include "limn/core/check.h"
#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/integrators/parts.h"

namespace limn {

namespace {

constexpr RenderMethod kMethods[] = {
    {"path", "paths, with light and BSDF samples", false},
    {"analytic", "direct light of flat lamps on diffuse surfaces in closed form", true},
    {"silhouettes", "as lines, and as rays where these are better", false, true, true, true},
    {"lines", "direct light and open sky, by lines between silhouettes", false, true, true},
    {"rays", "direct light and open sky, by quasi-random rays", false, true},
};

const RenderMethod& find_render_method(const std::string& name) {
  for (const RenderMethod& method : kMethods) {
    if (method.name == name) return method;
  }
  throw InputError(unknown_name("method", name, names_of(render_methods())));
}

std::vector<RenderMethod> looking_around() {
  std::vector<RenderMethod> methods;
  for (const RenderMethod& method : kMethods) {
    if (method.looks_around) methods.push_back(method);
  }
  return methods;
}

Numbers numbers_of(const std::string& sampler) {
  for (const char* name : kRenderSamplers) {
    if (name == sampler) {
      return name == kRenderSamplers[0] ? Numbers::kEvenInRun : Numbers::kIndependent;
    }
  }
  throw InputError(
      unknown_name("sampler", sampler, {std::begin(kRenderSamplers), std::end(kRenderSamplers)}));
}

std::unique_ptr<SampleEstimator> make_estimator(const Scene& scene, const RunSettings& settings,
                                                const RenderOptions& options) {
  const RenderMethod& method = find_render_method(options.method);
  const Numbers numbers = numbers_of(options.sampler);  // checked for all
  check_points(options.points, method.closed_light, options.method);
  if (!method.looks_around && options.what != RenderWhat::kImage) {
    throw InputError(
        fmt::format("the method \"{}\" knows radiance alone: how open the sky is say {}",
                    options.method, join(names_of(looking_around()))));
  }
  if (options.points == FilmPoints::kFaces) {
    if (options.exact_film)
      throw InputError(
          "--film exact is for random points: --points faces "
          "has its own");
    return std::make_unique<FacesEstimator>(scene, std::span<const Parameter>(), settings.threads);
  }
  if (method.looks_around) {
    if (options.exact_film) {
      throw InputError(fmt::format("--film exact: not with the method \"{}\"", options.method));
    }
    return std::make_unique<VisibilityEstimator>(scene, settings, method, options);
  }
  std::shared_ptr<const FilmRegions> visible;
  if (options.exact_film) {
    visible = std::make_shared<FilmRegions>(scene, settings.threads, settings.interrupted);
  }
  return std::make_unique<RadianceEstimator>(scene, settings.threads, std::move(visible),
                                             method.closed_light, numbers);
}

// What the method reads of the options: parts that differ elsewhere are of one run.
void identify(BatchStore& store, const RenderOptions& options) {
  const RenderMethod& method = find_render_method(options.method);
  store.identify("method", options.method);
  if (!method.looks_around) {
    store.identify("sampler", options.sampler);
    store.identify("film", options.exact_film ? "exact" : "rays");
    return;
  }
  store.identify("what", fmt::format("{}", static_cast<int>(options.what)));
  if (method.by_lines) {
    store.identify("lines", fmt::format("{}, tolerance {}", options.lines, options.tolerance));
  } else {
    store.identify("rays", fmt::format("{}", options.rays));
  }
}

}  // namespace

std::span<const RenderMethod> render_methods() { return kMethods; }

namespace {

using EstimatorList = std::vector<std::unique_ptr<SampleEstimator>>;

EstimatorList estimators_of(const Scene& scene, const RunSettings& settings,
                            const RenderOptions& options) {
  EstimatorList estimators;
  estimators.push_back(make_estimator(scene, settings, options));
  check_memory(estimators);
  return estimators;
}

// watch: runs since the job began.
RenderResult run(const EstimatorList& estimators, const RunSettings& settings,
                 const Stopwatch& watch, size_t size, FilmPoints points) {
  RenderResult result;
  result.radiance = Moments(size);
  run_batches(estimators, settings, watch, [&](const Batch& batch, const auto& sums) {
    if (points == FilmPoints::kFaces) {
      result.radiance.add_exact(sums[0].radiance);
    } else {
      result.radiance.add_batch(sums[0].radiance, batch.count());
    }
    result.rays += sums[0].costs[0].rays;
    result.non_finite.merge(sums[0].non_finite);
    result.spp += batch.count();
  });
  result.seconds = watch.seconds();
  return result;
}

}  // namespace

RenderResult render(const Scene& scene, const RunSettings& asked, const RenderOptions& options) {
  const Stopwatch watch;
  const RunSettings settings = settings_for(options.points, asked);
  if (settings.store) identify(*settings.store, options);
  const EstimatorList estimators = estimators_of(scene, settings, options);
  const auto* around = dynamic_cast<const VisibilityEstimator*>(estimators[0].get());
  if (settings.store && around) {
    // Other machines must have chosen the same.
    settings.store->identify("choice of the pilot", fingerprint(around->choice()));
  }
  RenderResult result = run(estimators, settings, watch, film_size(scene.film), options.points);
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
  CHECK(!find_render_method(options.method).looks_around);
  const Stopwatch watch;
  RunSettings own = settings_for(options.points, settings);
  own.store = nullptr;
  const EstimatorList estimators = estimators_of(scene, own, options);
  if (own.seconds > 0) {
    const double setup = watch.seconds() / static_cast<double>(seeds.size());
    own.seconds = std::max(1e-9, settings.seconds - setup);
  }
  std::vector<RenderResult> results;
  for (const uint64_t seed : seeds) {
    own.seed = seed;
    results.push_back(run(estimators, own, Stopwatch(), film_size(scene.film), options.points));
  }
  return results;
}

std::vector<std::string> trace_sample(const Scene& scene, const RunSettings& settings,
                                      const NonFinite::Place& place, const RenderOptions& options) {
  check_pixel(scene.film, place);
  const auto estimator = make_estimator(scene, settings, options);
  SampleLog log;
  run_pixel_sample(*estimator, settings.seed, {place.x, place.y, place.sample}, log);
  return log;
}

}  // namespace limn
