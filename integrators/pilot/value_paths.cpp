// Paths whose colours alone carry derivatives, and how an estimator adds them up.
#include "integrators/pilot/value_paths.h"

#include <array>
#include <vector>

#include "integrators/paths/film_rays.h"
#include "integrators/paths/path_follow.h"
#include "integrators/paths/traced_scene.h"
#include "integrators/pilot/term_estimator.h"

namespace limn {

ValuePaths::ValuePaths(const PathContext& context, std::span<const Parameter> parameters)
    : context_(context),
      colours_(context.scene, parameters),
      camera_(context.scene.camera),
      filter_(context.scene.film.filter),
      glossy_(is_glossy(context.scene)) {}

void ValuePaths::trace(std::span<const KeyedSample> samples,
                       std::span<const SharedPlace* const> places, RayCount& rays,
                       std::span<Found> found) const {
  PathTracer<Dual, Unmoved> tracer(context_, rays);
  tracer.colour_by(colours_);
  tracer.work_wide(glossy_);
  const FilmRays starts = places.empty()
                              ? FilmRays(context_.scene, camera_, filter_, samples, false)
                              : FilmRays(context_.scene, camera_, samples, places);
  std::vector<Walk<Dual, Unmoved>> walks;
  walks.reserve(samples.size());
  for (const KeyedSample& sample : samples) walks.emplace_back(sample.key, 0, nullptr);
  tracer.follow_rays(starts.starts(), walks);
  for (size_t i = 0; i < samples.size(); ++i) {
    found[i] = {walks[i].sums.radiance, walks[i].failed};
  }
}

void TermEstimator::add_values(std::span<const KeyedSample> samples,
                               std::span<const SharedPlace* const> places, SampleSink& sink) const {
  std::vector<KeyedSample> paths;
  std::vector<const SharedPlace*> shared;  // of the paths, where samples are
  std::vector<int> numbers;
  std::vector<double> weights;
  const auto finish = [&] {
    std::array<ValuePaths::Found, kMostTogether> found;
    PathCosts costs;
    values_->trace(paths, shared, costs.rays, found);
    add_cost(costs, paths.size(), sink.cost(pixel_slot_));
    for (size_t i = 0; i < paths.size(); ++i) {
      PathSums<Dual> sums;
      sums.radiance = found[i].radiance;
      const SharedPlace* place = shared.empty() ? nullptr : shared[i];
      add_path(weighed({paths[i].at, false, place, numbers[i]}, paths[i].key),
               path_of(sums, found[i].failed), weights[i], sink);
    }
    paths.clear();
    shared.clear();
    numbers.clear();
    weights.clear();
  };
  for (size_t s = 0; s < samples.size(); ++s) {
    const auto& [at, key] = samples[s];
    const int count = static_cast<int>(plan_.counts_at(at)[pixel_slot_]);
    for (int i = 0; i < count; ++i) {
      if (paths.size() == kMostTogether) finish();
      if (!places.empty()) shared.push_back(places[s] + i);
      paths.push_back({at, key.path(i)});
      numbers.push_back(i);
      weights.push_back(1.0 / count);
    }
  }
  finish();
}

}  // namespace limn
