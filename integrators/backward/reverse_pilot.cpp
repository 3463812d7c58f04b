// Second moments of a few batches, term by term, along a few directions of the parameters.
#include "integrators/backward/reverse_pilot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "integrators/estimates/film_batch.h"
#include "integrators/pilot/allocation.h"
#include "limn/core/exposure.h"
#include "limn/core/names.h"
#include "limn/core/parallel.h"
#include "limn/integrators/methods.h"

namespace limn {
namespace {

// Of every term: degrees of freedom, and the fewest and most paths that one of them has. Not tuned.
constexpr size_t kBatches = 32, kFewestPaths = 32, kMostPaths = 256;
// A path that a pilot looks at with every term of both methods takes as long as so many of a run's.
constexpr double kCostOfProbe = 10;  // not tuned
constexpr double kShare = 1.0 / 8;   // of a run, for pilots
// What a choice must leave of squared error x work to be preferred to the usual numbers. Not tuned.
constexpr double kConvincing = 0.8;
// The edges that `forest` draws before lights have rare and large samples, most of which a pilot
// misses; listed silhouettes have none. So those are preferred unless the pilot finds `forest`
// better by this factor: in gloss and beside a lamp of 1,886 faces, without it, one of two adjoints
// got `forest`, and 7 to 23 times the squared error x time.
constexpr double kUnseen = 4;

// A derivative of the loss along a direction of one parameter, in comparable units.
struct Direction {
  size_t parameter;
  std::vector<double> weights;  // of its numbers
};

// Where an array's numbers lie: the vertices that it moves, or their places in it.
std::vector<Vec3d> places_of(const Scene& scene, const Parameter& parameter) {
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    if (parameter.velocities(scene, ShapeId(s)).empty()) continue;
    const Mesh& mesh = scene.shapes[s].mesh;
    const Bounds bounds = bounds_of(mesh);
    const double scale = 1 / std::max(bounds.diagonal(), 1e-300);
    std::vector<Vec3d> places;
    for (const auto weld : mesh.weld)
      places.push_back((cast<double>(mesh.positions[weld]) - bounds.center()) * scale);
    return places;
  }
  std::vector<Vec3d> places(parameter.numbers());
  for (size_t i = 0; i < places.size(); ++i)
    places[i].x = static_cast<double>(i) / static_cast<double>(places.size());
  return places;
}

// Numbers and channels one by one; of arrays smooth random fields, as what optimisers make of
// gradients is smooth: the noise of single vertices is another, and large.
std::vector<Direction> directions_of(const Scene& scene, const std::vector<Parameter>& parameters) {
  constexpr int kFields = 4;      // not tuned
  constexpr double kPeriods = 2;  // over the shape; not tuned
  std::vector<Direction> directions;
  for (size_t p = 0; p < parameters.size(); ++p) {
    const Parameter& parameter = parameters[p];
    const size_t count = parameter.numbers();
    if (parameter.array.empty()) {
      for (size_t i = 0; i < count; ++i) {
        directions.push_back({p, std::vector<double>(count)});
        directions.back().weights[i] = parameter.natural_step;
      }
      continue;
    }
    const std::vector<Vec3d> places = places_of(scene, parameter);
    const size_t each = std::max<size_t>(1, count / std::max<size_t>(1, places.size()));
    for (uint64_t field = 0; field < kFields; ++field) {
      Rng rng(0, field, 0);
      std::array<Vec3d, 3> waves;
      std::array<double, 3> phases;
      for (size_t k = 0; k < 3; ++k) {
        for (int j = 0; j < 3; ++j) waves[k][j] = 2 * kPi * kPeriods * (2 * rng.uniform() - 1);
        phases[k] = 2 * kPi * rng.uniform();
      }
      Direction direction{p, std::vector<double>(count)};
      for (size_t i = 0; i < count; ++i) {
        const size_t k = i % each % 3;
        const Vec3d& x = places[std::min(i / each, places.size() - 1)];
        direction.weights[i] = parameter.natural_step * std::sin(dot(waves[k], x) + phases[k]);
      }
      directions.push_back(std::move(direction));
    }
  }
  return directions;
}

// What single samples of a term come to.
class Probe {
 public:
  Probe(const ReverseEstimator& estimator, const RunSettings& settings, const Stopwatch& watch)
      : settings_(settings),
        watch_(watch),
        pixels_(static_cast<double>(film_size(estimator.scene().film)) / 3),
        directions_(directions_of(estimator.scene(), estimator.parameters().parameters())) {
    settings_.progress = nullptr;
  }

  // paths: of each batch, or as many samples of the film as belong to them.
  TermFigures figures(ReverseEstimator& estimator, size_t slot, size_t paths) const {
    estimator.probe(static_cast<double>(paths) / pixels_, slot);
    ProgressCounter progress(settings_, watch_, 1);
    constexpr uint64_t kStream = 0x9e1107;  // any number
    std::vector<BatchSums> sums(kBatches);
    parallel_for(kBatches, settings_.threads, [&](size_t b) {
      const int first = static_cast<int>(b);
      sums[b] = run_batch(estimator, Batch{mix_bits(settings_.seed + kStream), first, first + 1}, 1,
                          progress);
    });
    TermCost cost;
    for (const BatchSums& batch : sums) {
      if (batch.costs.empty()) return {};  // interrupted
      cost.merge(batch.costs[slot]);
    }
    // Of a sample.
    const double each = estimator.samples_of(slot);
    const size_t on_film = FilmBatch(estimator, slot, {0, 0, 1}).count;
    const double count = on_film > 0 ? on_film : static_cast<double>(paths) * each;
    TermFigures figures;
    figures.variance = variance(sums) * count;
    figures.cost = estimator.work(slot, cost) / (kBatches * count);
    figures.first = estimator.first_work(slot, cost) / (kBatches * count);
    figures.least = each;
    estimator.probe(1, {});
    return figures;
  }

 private:
  // Of what a batch adds, summed over directions.
  double variance(const std::vector<BatchSums>& sums) const {
    double result = 0;
    for (const Direction& direction : directions_) {
      double first = 0, second = 0;
      for (const BatchSums& batch : sums) {
        const std::vector<double>& numbers = batch.images[direction.parameter];
        double value = 0;
        for (size_t i = 0; i < numbers.size(); ++i) value += direction.weights[i] * numbers[i];
        first += value;
        second += value * value;
      }
      result += std::max(0.0, second - first * first / kBatches) / (kBatches - 1);
    }
    return result;
  }

  RunSettings settings_;
  const Stopwatch& watch_;
  double pixels_;
  std::vector<Direction> directions_;
};

struct Choice {
  std::vector<double> samples;  // of each slot, for each path
  double product;               // squared error x work
};

// One of the methods, with figures of its terms.
struct Candidate {
  std::unique_ptr<ReverseEstimator> estimator;
  std::vector<TermFigures> figures = {};

  bool has_choice() const {
    for (size_t slot = 0; slot < estimator->slots(); ++slot)
      if (estimator->possible_samples(slot).size() > 1) return true;
    return false;
  }
  double product(const std::vector<double>& samples) const {
    double error = 0, work = 0;
    for (size_t slot = 0; slot < figures.size(); ++slot) {
      if (samples[slot] == 0) continue;  // where the adjoint is continuous
      error += figures[slot].variance / samples[slot];
      work += figures[slot].cost_of(samples[slot]);
    }
    return error * work;
  }
  Choice plain() const {
    std::vector<double> samples;
    for (size_t slot = 0; slot < figures.size(); ++slot)
      samples.push_back(estimator->samples_of(slot));
    return {samples, product(samples)};
  }
  // The numbers of one term after the other, until none would change.
  Choice best() const {
    Choice best = plain();
    for (bool changed = true; changed;) {
      changed = false;
      for (size_t slot = 0; slot < figures.size(); ++slot) {
        for (const double count : estimator->possible_samples(slot)) {
          std::vector<double> samples = best.samples;
          samples[slot] = count;
          const double now = product(samples);
          if (now >= 0.99 * best.product) continue;
          best = {samples, now};
          changed = true;
        }
      }
    }
    return best;
  }
};

BackwardOptions with_method(const BackwardOptions& options, const char* method) {
  BackwardOptions own = options;
  own.method = Method(method);
  return own;
}

bool leaves_numbers(const BackwardOptions& options) {
  const BackwardOptions plain;
  return options.edge_samples == plain.edge_samples &&
         options.camera_samples == plain.camera_samples &&
         options.shadow_samples == plain.shadow_samples;
}

bool asks_for_regions(const BackwardOptions& options) {
  return std::any_of(options.terms.begin(), options.terms.end(), [](const std::string& name) {
    const auto types = term_types();
    return std::any_of(types.begin(), types.end(),
                       [&](const TermType& type) { return type.regions && type.name == name; });
  });
}

// Both methods, as far as the scene tells them apart.
class Pilot {
 public:
  Pilot(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
        const RunSettings& settings, const Stopwatch& watch)
      : settings_(settings), watch_(watch) {
    const auto add = [&](const char* method) {
      candidates_.push_back({std::make_unique<ReverseEstimator>(
          scene, adjoint, with_method(options, method), settings.threads)});
    };
    add("forest");
    probe_ = std::make_unique<Probe>(*candidates_[0].estimator, settings, watch);
    if (!candidates_[0].has_choice()) return;
    paths_ = paths_of_batch(static_cast<double>(film_size(scene.film)) / 3);
    const bool draws = candidates_[0].estimator->draws_at_vertices();
    if (paths_ > 0 && draws && LightRegions::any_in(scene)) add("silhouettes");
  }

  ReversePlan plan() {
    if (paths_ == 0) return {std::move(candidates_[0].estimator), ""};
    for (Candidate& candidate : candidates_) measure(candidate);
    const Choice plain = candidates_[0].plain();
    Candidate* chosen = &candidates_[0];
    Choice best = chosen->best();
    if (candidates_.size() > 1) {
      const Choice listed = candidates_[1].best();
      if (listed.product < kUnseen * best.product) {
        best = listed;
        chosen = &candidates_[1];
      }
    }
    const bool gains = chosen != &candidates_[0] || best.product < kConvincing * plain.product;
    ReversePlan plan{std::move(chosen->estimator), ""};
    if (gains) plan.estimator->set_samples(best.samples);
    plan.decision = fmt::format(
        "pilot of {} paths for each term: {} with {} numbers; squared error x work {:.3g} of that "
        "of forest with the usual numbers",
        kBatches * paths_, plan.estimator->method_name(), gains ? "these" : "the usual",
        gains && plain.product > 0 ? best.product / plain.product : 1.0);
    return plan;
  }

 private:
  // 0: the run is too short, or there is nothing to choose.
  size_t paths_of_batch(double pixels) const {
    const double probes = kBatches * kCostOfProbe;
    double paths = kShare * pixels * settings_.spp / probes;
    if (settings_.seconds > 0) {
      ReverseEstimator& estimator = *candidates_[0].estimator;
      const double before = watch_.seconds();
      probe_->figures(estimator, estimator.pixel_slot(), kFewestPaths);
      const double each = std::max(watch_.seconds() - before, 1e-9) / kFewestPaths;
      // Without edges a path takes a fifth of the time.
      paths = std::min(paths, kShare * (settings_.seconds - before) / (5 * kCostOfProbe * each));
    }
    return paths < kFewestPaths ? 0 : static_cast<size_t>(std::min<double>(paths, kMostPaths));
  }
  // Terms that no vertex has part in are the same in all.
  void measure(Candidate& candidate) {
    ReverseEstimator& estimator = *candidate.estimator;
    for (size_t slot = 0; slot < estimator.slots(); ++slot) {
      candidate.figures.emplace_back();
      if (!estimator.computes(slot) || estimator.samples_of(slot) == 0) continue;
      const auto known = alike_.find(estimator.slot_name(slot));
      candidate.figures.back() =
          known != alike_.end() ? known->second : probe_->figures(estimator, slot, paths_);
      if (!estimator.draws_at_vertices(slot))
        alike_[estimator.slot_name(slot)] = candidate.figures.back();
    }
  }

  RunSettings settings_;
  const Stopwatch& watch_;
  std::vector<Candidate> candidates_;
  std::unique_ptr<Probe> probe_;
  size_t paths_ = 0;
  std::map<std::string, TermFigures> alike_;
};

}  // namespace

BackwardOptions without_pilot(const BackwardOptions& options) {
  if (!options.method->reverse->chooses) return options;
  return with_method(options, asks_for_regions(options) ? "silhouettes" : "forest");
}

ReversePlan planned(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
                    const RunSettings& settings, const Stopwatch& watch) {
  const auto plain = [&](const BackwardOptions& own) {
    return ReversePlan{std::make_unique<ReverseEstimator>(scene, adjoint, own, settings.threads),
                       ""};
  };
  const bool free = options.method->reverse->chooses && options.terms.empty() &&
                    leaves_numbers(options) && !options.uniform_pixels &&
                    !needs_times(scene, reverse_parameters(scene, options));
  if (!free) return plain(without_pilot(options));
  return Pilot(scene, adjoint, options, settings, watch).plan();
}

}  // namespace limn
