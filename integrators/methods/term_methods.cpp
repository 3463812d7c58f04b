// Derivatives term by term: passes over the parameters, a pilot that shares the work among the
// terms, and what batches add up to.
#include "integrators/methods/term_methods.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "integrators/estimates/batches.h"
#include "integrators/methods/allocation.h"
#include "integrators/methods/selection.h"
#include "integrators/methods/term_estimator.h"
#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/edgetree/edge_sampler_types.h"

namespace limn {
namespace {

// Collects sums of batches into the moments of one parameter. sums: of its lane, for each term
// (empty for those that are not computed).
void collect(const std::vector<const std::vector<double>*>& sums, const std::vector<TermRun>& terms,
             int samples, const Film& film, int block, ParameterGradient& g) {
  const int width = film.crop_width;
  const int height = film.crop_height;
  std::vector<double> edges(film_size(film));
  std::vector<double> total(film_size(film));
  // Terms of edges are added up first: their sum is what counts as an event.
  for (const bool of_edges : {true, false}) {
    for (size_t t = 0; t < terms.size(); ++t) {
      if (!sums[t] || terms[t].edges != of_edges) continue;
      std::vector<double>& to = of_edges ? edges : total;
      for (size_t i = 0; i < to.size(); ++i) to[i] += (*sums[t])[i];
    }
  }
  for (size_t i = 0; i < total.size(); ++i) total[i] += edges[i];
  g.events.add_batch(edges);
  for (size_t t = 0; t < terms.size(); ++t) {
    if (!sums[t]) continue;
    g.terms[t].add_batch(*sums[t], samples);
    if (block > 0) g.term_blocks[t].add_batch(sum_blocks(*sums[t], width, height, block), samples);
  }
  g.total.add_batch(total, samples);
  g.image_sum.add_batch(sum_blocks(total, width, height, std::max(width, height)), samples);
  if (block > 0) g.total_blocks.add_batch(sum_blocks(total, width, height, block), samples);
}

// A whole run of one method.
class TermJob {
 public:
  TermJob(const Scene& scene, const GradientOptions& options, const EdgeSamplerType& sampler,
          int threads)
      : scene_(scene), options_(options), types_(terms_of(scene, sampler)) {
    const std::vector<std::string> chosen = selected_terms(term_names(), options.terms, scene.file);
    for (const TermType* type : types_) {
      computed_.push_back(std::find(chosen.begin(), chosen.end(), type->name) != chosen.end());
    }
    if (options.samples) check_samples(*options.samples);
    std::vector<Parameter> parameters;
    for (const auto& name : options.parameters) parameters.push_back(find_parameter(scene, name));
    for (size_t k = 0; k < parameters.size(); k += kLanes) {
      const auto some =
          std::span(parameters).subspan(k).first(std::min<size_t>(kLanes, parameters.size() - k));
      passes_.push_back(std::make_unique<TermEstimator>(scene, some, computed_, sampler, threads));
    }
  }

  GradientResult run(const RunSettings& settings, const Stopwatch& watch) {
    GradientResult result = empty_result();
    for (size_t p = 0; p < passes_.size(); ++p) pass(p).describe(result.stats);
    const Stopwatch pilot_watch;
    const SampleCounts samples =
        options_.samples ? *options_.samples : choose_samples(settings, watch, result.pilot_spp);
    if (result.pilot_spp > 0) result.stats.setup.emplace_back("pilot", pilot_watch.seconds());
    set_samples(samples, result);
    result.setup_seconds = watch.seconds();
    run_batches(passes_, settings, watch, [&](const Batch& batch, const auto& sums) {
      add_batch(batch.count(), sums, result);
    });
    result.seconds = watch.seconds();
    return result;
  }

  std::vector<std::string> trace(const RunSettings& settings, const NonFinite::Place& place) {
    GradientResult unused = empty_result();
    set_samples(options_.samples.value_or(SampleCounts{}), unused);
    SampleLog log;
    for (size_t p = 0; p < passes_.size(); ++p) {
      for (size_t k = 0; k < static_cast<size_t>(pass(p).lanes()); ++k) {
        log.push_back(fmt::format("parameter {}: {}", k + 1, options_.parameters[p * kLanes + k]));
      }
      if (place.x >= 0) {
        check_pixel(scene_.film, place);
        run_pixel_sample(pass(p), settings.seed, {place.x, place.y, place.sample}, log);
      } else {
        trace_film(pass(p), settings, place, log);
      }
    }
    return log;
  }

 private:
  TermEstimator& pass(size_t p) const { return static_cast<TermEstimator&>(*passes_[p]); }

  std::vector<std::string> term_names() const {
    std::vector<std::string> names;
    for (const TermType* type : types_) names.emplace_back(type->name);
    return names;
  }

  void trace_film(const TermEstimator& estimator, const RunSettings& settings,
                  const NonFinite::Place& place, SampleLog& log) const {
    for (size_t slot = 0; slot < types_.size(); ++slot) {
      if (types_[slot]->name != place.term) continue;
      if (run_film_sample(estimator, settings, slot, place.sample, log)) return;
    }
    throw InputError(fmt::format("there is no sample {} of the term \"{}\" on the film",
                                 place.sample, place.term));
  }

  void check_samples(const SampleCounts& samples) const {
    bool good = samples.size() <= types_.size();
    for (size_t t = 0; t < types_.size(); ++t) {
      const bool whole = types_[t]->least_samples == 1;
      good = good && std::isfinite(samples[t]) && samples[t] > 0 &&
             (!whole || samples[t] == std::floor(samples[t]));
    }
    if (good) return;
    std::string wanted;
    for (const TermType* type : types_) {
      wanted += fmt::format("{}{}{}", wanted.empty() ? "" : ", ", type->name,
                            type->least_samples == 1 ? "" : " (may be less than 1)");
    }
    throw InputError(
        fmt::format("--samples: \"{}\": counts must be positive, and whole where "
                    "paths are concerned, as in 3,0.5,1; the terms are {}",
                    to_string(samples), wanted));
  }

  void set_samples(const SampleCounts& samples, GradientResult& result) const {
    for (size_t p = 0; p < passes_.size(); ++p) pass(p).set_samples(samples);
    for (size_t t = 0; t < result.terms.size(); ++t) result.terms[t].samples = samples[t];
  }

  GradientResult empty_result() const {
    const Film& film = scene_.film;
    const int block = options_.block;
    const Moments blocks(block > 0 ? block_count(film.crop_width, film.crop_height, block) : 0);
    GradientResult result;
    for (size_t t = 0; t < types_.size(); ++t) {
      result.terms.push_back({types_[t]->name, computed_[t], types_[t]->edges, 1, {}});
    }
    for (const auto& name : options_.parameters) {
      ParameterGradient& g = result.parameters.emplace_back();
      g.name = name;
      g.total = Moments(film_size(film));
      g.image_sum = Moments(1);
      g.total_blocks = blocks;
      for (const bool computed : computed_) {
        g.terms.push_back(computed ? Moments(film_size(film)) : Moments());
        g.term_blocks.push_back(computed ? blocks : Moments());
      }
    }
    result.radiance = Moments(film_size(film));
    return result;
  }

  void add_batch(int samples, const std::vector<BatchSums>& sums, GradientResult& result) const {
    for (size_t p = 0; p < passes_.size(); ++p) {
      const auto lanes = static_cast<size_t>(pass(p).lanes());
      for (size_t k = 0; k < lanes; ++k) {
        std::vector<const std::vector<double>*> terms;
        for (size_t t = 0; t < types_.size(); ++t) {
          terms.push_back(computed_[t] ? &sums[p].images[t * lanes + k] : nullptr);
        }
        collect(terms, result.terms, samples, scene_.film, options_.block,
                result.parameters[p * kLanes + k]);
      }
      for (size_t t = 0; t < types_.size(); ++t) result.terms[t].cost.merge(sums[p].costs[t]);
      result.non_finite.merge(sums[p].non_finite);
    }
    result.radiance.add_batch(sums[0].radiance, samples);
    result.spp += samples;
  }

  // Chooses the samples of each term by a pilot. watch: since the job began.
  SampleCounts choose_samples(const RunSettings& settings, const Stopwatch& watch, int& pilot_spp) {
    const int spp = pilot_samples(film_size(scene_.film) / 3, settings.spp);
    if (spp == 0 || std::count(computed_.begin(), computed_.end(), true) < 2) return {};
    RunSettings quiet = settings;
    quiet.progress = nullptr;
    ProgressCounter progress(quiet, watch, 1);
    GradientResult pilot = empty_result();
    // Another stream of random numbers: a choice that depends on the samples it is made for would
    // bias them.
    const uint64_t seed = mix_bits(settings.seed + 0x9110);
    const double began = watch.seconds();
    while (pilot.spp < spp) {
      const int s = static_cast<int>(pilot.spp);
      const auto sums = run_batch(passes_, {seed, s, s + 1}, settings.threads, progress);
      if (sums.empty()) return {};
      add_batch(1, sums, pilot);
      if (settings.seconds > 0 && watch.seconds() - began > settings.seconds / 8) break;
    }
    pilot_spp = static_cast<int>(pilot.spp);
    if (pilot.spp < 2) return {};
    const std::vector<double> variances = pilot_variances(pilot);
    std::vector<TermFigures> figures;
    for (size_t t = 0; t < types_.size(); ++t) {
      figures.push_back(
          {variances[t], pass(0).work(t, pilot.terms[t].cost), types_[t]->least_samples});
    }
    return best_samples(figures);
  }

  const Scene& scene_;
  const GradientOptions& options_;
  std::vector<const TermType*> types_;
  std::vector<bool> computed_;  // of each term
  std::vector<std::unique_ptr<SampleEstimator>> passes_;
};

MethodType term_method(const EdgeSamplerType& sampler) {
  MethodType method;
  method.name = sampler.name;
  method.description = sampler.description;
  for (const TermType& type : term_types()) {
    if (!type.regions || sampler.regions) method.terms.emplace_back(type.name);
  }
  method.terms_can_be_left_out = true;
  method.ablation = sampler.ablation;
  method.run = [&sampler](const MethodType&, const Scene& scene, const GradientOptions& options,
                          const RunSettings& settings) {
    const Stopwatch watch;
    return TermJob(scene, options, sampler, settings.threads).run(settings, watch);
  };
  method.trace = [&sampler](const MethodType&, const Scene& scene, const GradientOptions& options,
                            const RunSettings& settings, const NonFinite::Place& place) {
    return TermJob(scene, options, sampler, settings.threads).trace(settings, place);
  };
  return method;
}

}  // namespace

std::vector<MethodType> term_methods() {
  std::vector<MethodType> methods;
  for (const EdgeSamplerType& type : edge_sampler_types()) methods.push_back(term_method(type));
  return methods;
}

}  // namespace limn
