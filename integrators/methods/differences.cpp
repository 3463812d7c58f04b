// Central differences: every moved scene is rendered with the same random numbers.
#include "limn/integrators/differences.h"

#include <algorithm>
#include <memory>

#include "integrators/estimates/batches.h"
#include "integrators/methods/blurred_estimator.h"
#include "integrators/methods/drawn_alike.h"
#include "integrators/methods/radiance_estimator.h"
#include "limn/core/environment.h"
#include "limn/core/exposure.h"
#include "limn/core/parameter.h"

namespace limn {
namespace {

// A weighted sum of central differences. images: at +steps[0], -steps[0], +steps[1], ...
std::vector<double> combine(const BatchSums* images, const std::vector<double>& steps,
                            const std::vector<double>& weights) {
  std::vector<double> sums(images[0].radiance.size());
  for (size_t j = 0; j < steps.size(); ++j) {
    const std::vector<double>& forward = images[2 * j].radiance;
    const std::vector<double>& back = images[2 * j + 1].radiance;
    const double factor = weights[j] / (2 * steps[j]);
    if (factor == 0) continue;
    for (size_t i = 0; i < sums.size(); ++i) sums[i] += factor * (forward[i] - back[i]);
  }
  return sums;
}

std::vector<double> mean_of_two(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> mean(a.size());
  for (size_t i = 0; i < a.size(); ++i) mean[i] = 0.5 * (a[i] + b[i]);
  return mean;
}

// Appends the scene moved by each step of a job, forwards and back. Where only materials or the
// environment change these draw the same directions.
void append_moved(const Scene& scene, const DifferenceJob& job, bool same_paths,
                  std::vector<Scene>& moved) {
  const Parameter& parameter = job.parameter;
  const size_t first = moved.size();
  for (const double step : job.steps) {
    for (const double h : {step, -step}) moved.push_back(parameter.moved(scene, h));
  }
  if (moved_by({&parameter, 1}).any()) return;
  for (size_t i = first; scene.environment && i < moved.size(); ++i) {
    moved[i].environment = drawn_alike(moved[i].environment, *scene.environment);
  }
  if (same_paths) return draw_as(std::span(moved).subspan(first), scene);
  const auto largest = std::max_element(job.steps.begin(), job.steps.end());
  const size_t farthest = 2 * (largest - job.steps.begin());
  draw_alike(std::span(moved).subspan(first), farthest, farthest + 1);
}

// images: of the scenes that append_moved() made for all jobs.
void add_images(const std::vector<DifferenceJob>& jobs, const BatchSums* images, const Film& film,
                int block, int samples, CentralDifferences& result) {
  for (size_t j = 0; j < jobs.size(); ++j) {
    for (size_t k = 0; k < jobs[j].combinations.size(); ++k) {
      result.estimates[j][k].add_batch(combine(images, jobs[j].steps, jobs[j].combinations[k]),
                                       film, block, samples);
    }
    images += 2 * jobs[j].steps.size();
  }
}

}  // namespace

DifferenceEstimate::DifferenceEstimate(const Film& film, int block)
    : total(film_size(film)),
      blocks(block > 0 ? block_count(film.crop_width, film.crop_height, block) : 0, true),
      image_sum(1) {}

void DifferenceEstimate::add_batch(const std::vector<double>& sums, const Film& film, int block,
                                   int samples) {
  const int width = film.crop_width;
  const int height = film.crop_height;
  total.add_batch(sums, samples);
  if (block > 0) blocks.add_batch(sum_blocks(sums, width, height, block), samples);
  image_sum.add_batch(sum_blocks(sums, width, height, std::max(width, height)), samples);
}

CentralDifferences central_differences(const Scene& scene, const std::vector<DifferenceJob>& jobs,
                                       int block, const RunSettings& settings, bool even,
                                       const std::optional<Blur>& blur, bool same_paths) {
  const Stopwatch watch;
  const Numbers numbers = even ? Numbers::kEvenInBatches : Numbers::kIndependent;
  std::vector<Scene> moved;
  CentralDifferences result;
  for (const DifferenceJob& job : jobs) {
    append_moved(scene, job, same_paths, moved);
    result.estimates.emplace_back(job.combinations.size(), DifferenceEstimate(scene.film, block));
  }
  const auto at = [&](const auto& placed) {
    const auto unmoved = placed(scene);
    if (blur) {
      const auto choices = std::make_shared<const BlurredScene>(*unmoved, *blur, settings.threads);
      EstimatorsAtTime now{{unmoved, choices}};
      for (const Scene& one : moved) {
        const auto there = placed(one);
        now.kept.push_back(there);
        now.list.push_back(
            std::make_unique<BlurredEstimator>(*there, *choices, settings.threads, numbers));
      }
      return now;
    }
    const auto choices = std::make_shared<PathChoices>(*unmoved);
    EstimatorsAtTime now{{unmoved, choices}};
    for (const Scene& one : moved) {
      const auto there = placed(one);
      now.kept.push_back(there);
      now.list.push_back(
          std::make_unique<RadianceEstimator>(*there, *choices, settings.threads, numbers));
    }
    return now;
  };
  const EstimatorsAtTime still =
      at([](const Scene& one) { return std::shared_ptr<const Scene>(&one, [](const Scene*) {}); });
  const EstimatorsAt at_times = [&](double u) {
    return at([&](const Scene& one) { return std::make_shared<const Scene>(at_time(one, u)); });
  };
  const auto& estimators = still.list;
  check_memory(estimators);
  result.radiance = Moments(film_size(scene.film));
  result.setup_seconds = watch.seconds();
  run_batches(
      estimators, settings, watch,
      [&](const Batch& batch, const auto& sums) {
        const BatchSums* images = sums.data();
        result.radiance.add_batch(mean_of_two(images[0].radiance, images[1].radiance),
                                  batch.count());
        add_images(jobs, images, scene.film, block, batch.count(), result);
        for (const BatchSums& s : sums) {
          result.cost.merge(s.costs[0]);
          result.non_finite.merge(s.non_finite);
        }
        result.spp += batch.count();
      },
      std::ranges::any_of(moved, is_moving) ? at_times : EstimatorsAt());
  result.seconds = watch.seconds();
  return result;
}

DifferenceResult finite_differences(const Scene& scene, const std::string& parameter, double step,
                                    int block, const RunSettings& settings,
                                    const std::optional<Blur>& blur) {
  CentralDifferences run = central_differences(
      scene,
      {{find_parameter(scene, parameter), {step, 2 * step}, {{1, 0}, {0, 1}, {4.0 / 3, -1.0 / 3}}}},
      block, settings, false, blur);
  auto& estimates = run.estimates[0];
  return {std::move(estimates[0]), std::move(estimates[1]),
          std::move(estimates[2]), run.spp,
          run.cost.rays,           run.seconds,
          run.setup_seconds,       std::move(run.non_finite)};
}

}  // namespace limn
