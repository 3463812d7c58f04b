// Second moments of a few batches, term by term, along a few directions of the parameters.
#include "integrators/backward/reverse_pilot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>

#include "integrators/estimates/film_batch.h"
#include "integrators/terms/direct_edges.h"
#include "limn/core/exposure.h"
#include "limn/core/names.h"
#include "limn/core/parallel.h"
#include "limn/integrators/methods.h"

namespace limn {
namespace {

// A pilot of a term traces so many batches of so many paths. Both are constant, so that the plan
// does not depend on the length of the run, nor on a limit of time. Not tuned.
constexpr size_t kBatches = 16, kPaths = 64;
constexpr uint64_t kStream = 0x9e1107;  // of random numbers; any
// The time of a pilot's path with every term of both methods, over that of a path of the run.
constexpr double kCostOfProbe = 10;  // not tuned
// The time that a pilot takes per number of the gradient, which every batch gathers, and per face,
// which both methods set up, over that of a path of the run: 0.03 to 0.5 in four scenes.
constexpr double kCostOfNumber = 0.2;
constexpr double kShare = 1.0 / 8;  // of a run, at most, for pilots
// The share of a term's variance that more edge samples per vertex cannot reduce. In a room lit
// through a window, eight samples per vertex leave .21 to .49 of the variance of one. Not tuned.
constexpr double kKept = 0.5;
// Other numbers of samples for `forest` are taken if they are predicted to reduce squared error x
// work to this share or less: for a lattice in front of a sky the pilot predicted 0.59 to 0.72 on
// average, but one of five motions got 1.2 to 2.6.
constexpr double kConvincing = 0.5;
// `silhouettes` is taken unless it is predicted to have more than this many times the squared error
// x work of what `forest` would run with. Where the prediction was .8 to 1.9 (six scenes: a bunny
// before a small lamp, the demo, boxes under lamps), it had .23, .30, .76 and 1.0 to 1.25 times:
// a pilot misses what `forest` meets rarely.
constexpr double kBetter = 2;
// The edges that `forest` draws have rare and large samples, most of which a pilot
// misses; listed silhouettes have none. So their variance is taken to be so many times what the
// pilot finds: in gloss and beside a lamp of 1,886 faces, without it, one of two adjoints got
// `forest`, and 7 to 23 times the squared error x time.
constexpr double kUnseen = 4;

// In the unit of Term::work: 15 to 110 for 6 to 400 pieces, timed in five scenes.
double work_of(const ListCount& count) {
  return 10 * static_cast<double>(count.lists) + 0.4 * static_cast<double>(count.pieces);
}

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

// Motions of a shape along which the pilot measures variance: translations, rotations and smooth
// random fields. Optimisers smooth gradients, so the larger noise of single vertices counts less.
std::vector<std::function<Vec3d(const Vec3d&)>> smooth_fields() {
  constexpr uint64_t kWaves = 2;  // not tuned
  constexpr double kPeriods = 2;  // over the shape; not tuned
  std::vector<std::function<Vec3d(const Vec3d&)>> fields;
  for (const Vec3d& axis : {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}) {
    fields.emplace_back([axis](const Vec3d&) { return axis; });
    fields.emplace_back([axis](const Vec3d& x) { return cross(axis, x); });
  }
  for (uint64_t i = 0; i < kWaves; ++i) {
    Rng rng(0, i, 0);
    std::array<Vec3d, 3> waves;
    Vec3d phases;
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) waves[k][j] = 2 * kPi * kPeriods * (2 * rng.uniform() - 1);
      phases[k] = 2 * kPi * rng.uniform();
    }
    fields.emplace_back([waves, phases](const Vec3d& x) {
      Vec3d value;
      for (int k = 0; k < 3; ++k) value[k] = std::sin(dot(waves[k], x) + phases[k]);
      return value;
    });
  }
  return fields;
}

// Numbers and channels one by one; of arrays smooth fields.
std::vector<Direction> directions_of(const Scene& scene, const std::vector<Parameter>& parameters) {
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
    for (const auto& field : smooth_fields()) {
      Direction direction{p, std::vector<double>(count)};
      for (size_t i = 0; i < count; ++i) {
        const Vec3d value = field(places[std::min(i / each, places.size() - 1)]);
        direction.weights[i] = parameter.natural_step * value[static_cast<int>(i % each % 3)];
      }
      directions.push_back(std::move(direction));
    }
  }
  return directions;
}

// What one sample of a term comes to.
struct ReverseFigures {
  std::vector<double> variances = {};  // along every direction
  // What it costs; the part of it that further samples at the same vertex do not take again.
  double cost = 0, first = 0;
  bool at_vertices = false;

  // Of the variances, what so many samples leave.
  double left_by(double samples) const {
    return at_vertices && samples > 1 ? kKept + (1 - kKept) / samples : 1 / samples;
  }
  double cost_of(double samples) const {
    return cost * samples - first * std::max(samples - 1, 0.0);
  }
};

class Probe {
 public:
  Probe(const ReverseEstimator& estimator, const RunSettings& settings, const Stopwatch& watch)
      : settings_(settings),
        watch_(watch),
        pixels_(static_cast<double>(film_size(estimator.scene().film)) / 3),
        directions_(directions_of(estimator.scene(), estimator.parameters().parameters())) {
    settings_.progress = nullptr;
  }

  // Seconds of so many paths in each batch, with all terms and their usual numbers.
  double seconds(ReverseEstimator& estimator, int paths) const {
    const double before = watch_.seconds();
    estimator.probe(paths / pixels_, {});
    ProgressCounter progress(settings_, watch_, 1);
    parallel_for(kBatches, settings_.threads, [&](size_t b) {
      const int first = static_cast<int>(b);
      run_batch(estimator, {mix_bits(settings_.seed + kStream), first, first + 1}, 1, progress);
    });
    estimator.probe(1, {});
    return watch_.seconds() - before;
  }
  // Of the paths of a batch, or as many samples of the film as belong to them.
  ReverseFigures figures(ReverseEstimator& estimator, size_t slot) const {
    estimator.probe(kPaths / pixels_, slot);
    ProgressCounter progress(settings_, watch_, 1);
    std::vector<std::vector<double>> slopes(kBatches);
    std::vector<TermCost> costs(kBatches);
    std::vector<ListCount> lists(kBatches);
    parallel_for(kBatches, settings_.threads, [&](size_t b) {
      const int first = static_cast<int>(b);
      const Batch batch{mix_bits(settings_.seed + kStream), first, first + 1};
      const ListCount before = listed_by_thread();
      const BatchSums sums = run_batch(estimator, batch, 1, progress);
      const ListCount now = listed_by_thread();
      lists[b] = {now.lists - before.lists, 0, now.pieces - before.pieces};
      if (sums.costs.empty()) return;  // interrupted: a run without batches
      costs[b] = sums.costs[slot];
      slopes[b] = along_directions(sums.images);
    });
    TermCost cost;
    for (const TermCost& one : costs) cost.merge(one);
    double listing = 0;
    for (const ListCount& one : lists) listing += work_of(one);
    const size_t on_film = FilmBatch(estimator, slot, {0, 0, 1}).count;
    const double count = on_film > 0 ? on_film : kPaths * estimator.samples_of(slot);
    ReverseFigures figures;
    figures.variances = variances(slopes, count);
    figures.cost = (estimator.work(slot, cost) + listing) / (kBatches * count);
    figures.first = (estimator.first_work(slot, cost) + listing) / (kBatches * count);
    figures.at_vertices = estimator.draws_at_vertices(slot);
    estimator.probe(1, {});
    return figures;
  }

 private:
  std::vector<double> along_directions(const std::vector<std::vector<double>>& numbers) const {
    std::vector<double> slopes(directions_.size());
    for (size_t d = 0; d < slopes.size(); ++d) {
      const std::vector<double>& of = numbers[directions_[d].parameter];
      for (size_t i = 0; i < of.size(); ++i) slopes[d] += directions_[d].weights[i] * of[i];
    }
    return slopes;
  }
  // Of a sample, along every direction: slopes are those of batches of `count`.
  std::vector<double> variances(const std::vector<std::vector<double>>& slopes,
                                double count) const {
    std::vector<double> result(directions_.size());
    for (size_t d = 0; d < result.size(); ++d) {
      double first = 0, second = 0;
      for (const auto& batch : slopes) {
        if (batch.empty()) return std::vector<double>(directions_.size());
        first += batch[d];
        second += batch[d] * batch[d];
      }
      result[d] = count * std::max(0.0, second - first * first / kBatches) / (kBatches - 1);
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
  double product;               // squared error x work, in units of the usual one
};

// One of the methods, with figures of its terms.
struct Candidate {
  std::unique_ptr<ReverseEstimator> estimator;
  std::vector<ReverseFigures> figures = {};

  bool has_choice() const {
    for (size_t slot = 0; slot < estimator->slots(); ++slot)
      if (estimator->possible_samples(slot).size() > 1) return true;
    return false;
  }
  // Along every direction, with so many samples.
  std::vector<double> errors(const std::vector<double>& samples) const {
    std::vector<double> errors;
    for (size_t slot = 0; slot < figures.size(); ++slot) {
      if (samples[slot] == 0) continue;  // where the adjoint is continuous
      const std::vector<double>& variances = figures[slot].variances;
      errors.resize(std::max(errors.size(), variances.size()));
      for (size_t d = 0; d < variances.size(); ++d)
        errors[d] += variances[d] * figures[slot].left_by(samples[slot]);
    }
    return errors;
  }
  double work(const std::vector<double>& samples) const {
    double work = 0;
    for (size_t slot = 0; slot < figures.size(); ++slot)
      if (samples[slot] > 0) work += figures[slot].cost_of(samples[slot]);
    return work;
  }
  // units: of the squared error along every direction; all directions count alike.
  double product(const std::vector<double>& samples, const std::vector<double>& units) const {
    double error = 0;
    const std::vector<double> list = errors(samples);
    for (size_t d = 0; d < list.size(); ++d)
      if (units[d] > 0) error += list[d] / units[d];
    return error * work(samples);
  }
  std::vector<double> usual() const {
    std::vector<double> samples;
    for (size_t slot = 0; slot < figures.size(); ++slot)
      samples.push_back(estimator->samples_of(slot));
    return samples;
  }
  // The numbers of one term after the other, until none would change.
  Choice best(const std::vector<double>& units) const {
    Choice best{usual(), product(usual(), units)};
    for (bool changed = true; changed;) {
      changed = false;
      for (size_t slot = 0; slot < figures.size(); ++slot) {
        for (const double count : estimator->possible_samples(slot)) {
          std::vector<double> samples = best.samples;
          samples[slot] = count;
          const double now = product(samples, units);
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
  // settings: of a run with a limit of time, those between which it has a pilot or has none.
  Pilot(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
        RunSettings& settings, const Stopwatch& watch)
      : watch_(watch), pixels_(static_cast<double>(film_size(scene.film)) / 3) {
    const auto add = [&](const char* method) {
      candidates_.push_back({std::make_unique<ReverseEstimator>(
          scene, adjoint, with_method(options, method), settings.threads)});
    };
    // The method of runs that are too short for a pilot: `silhouettes` has 0.02 to 2 times the
    // squared error x time of `forest` in 13 scenes, 0.44 in the geometric mean.
    const bool lists = LightRegions::any_in(scene);
    add(lists ? "silhouettes" : "forest");
    if (!candidates_[0].has_choice()) return;
    least_ = least_samples();
    if (settings.spp < least_) return;
    probe_ = std::make_unique<Probe>(*candidates_[0].estimator, settings, watch);
    looks_ = fits(settings);
    const bool draws = candidates_[0].estimator->draws_at_vertices();
    if (!looks_ || !draws || !lists) return;
    add("forest");
    std::swap(candidates_[0], candidates_[1]);
  }

  ReversePlan plan(RunSettings& settings) {
    if (!looks_) return without();
    for (Candidate& candidate : candidates_) measure(candidate);
    if (candidates_.size() > 1) raise_unseen();
    const std::vector<double> units = candidates_[0].errors(candidates_[0].usual());
    const Choice usual{candidates_[0].usual(),
                       candidates_[0].product(candidates_[0].usual(), units)};
    Candidate* chosen = &candidates_[0];
    // What `forest` would run with.
    Choice best = chosen->best(units);
    bool gains = best.product < kConvincing * usual.product;
    if (!gains) best = usual;
    if (candidates_.size() > 1) {
      const Choice listed = candidates_[1].best(units);
      if (lists_silhouettes(listed.product, best.product)) {
        best = listed;
        chosen = &candidates_[1];
        gains = true;
      }
    }
    if (settings.seconds > 0) {
      const double timed = candidates_.back().work(candidates_.back().usual());
      const double ratio = timed > 0 ? chosen->work(best.samples) / timed : 1;
      if (!leaves_time(settings, ratio)) {
        stay_below(settings);
        return without();
      }
      settings.least_spp = std::max(settings.least_spp, least_);
    }
    ReversePlan plan{std::move(chosen->estimator), ""};
    if (gains) plan.estimator->set_samples(best.samples);
    plan.decision = fmt::format(
        "pilot of {} paths per term: {} with {} sample counts; expected squared error x work "
        "{:.3g} "
        "of that of forest with the usual counts, its edges' variance taken {:g} times as measured",
        kBatches * kPaths, plan.estimator->method_name(), gains ? "these" : "the usual",
        usual.product > 0 ? best.product / usual.product : 1.0, kUnseen);
    return plan;
  }

 private:
  ReversePlan without() { return {std::move(candidates_.back().estimator), ""}; }
  // Of a run of which pilots are no more than their share.
  int least_samples() const {
    double numbers = 0;
    for (const size_t count : candidates_[0].estimator->sizes())
      numbers += static_cast<double>(count);
    for (const Shape& shape : candidates_[0].estimator->scene().shapes)
      numbers += static_cast<double>(shape.mesh.faces.size());
    const double paths = kBatches * kPaths * kCostOfProbe + kCostOfNumber * numbers;
    constexpr double kLeast = 3;  // runs below have two, for standard errors
    return static_cast<int>(std::max(kLeast, std::ceil(paths / (kShare * pixels_))));
  }
  // Whether a run of the least samples fits into its time. From then on it comes to these, or stays
  // below.
  bool fits(RunSettings& settings) {
    if (settings.seconds == 0) return true;
    ReverseEstimator& estimator = *candidates_[0].estimator;
    gathering_ = probe_->seconds(estimator, 1);
    const double more = probe_->seconds(estimator, kPaths) - gathering_;
    path_ = std::max(more, 0.0) / (kBatches * (kPaths - 1));
    if (leaves_time(settings, 1)) return true;
    stay_below(settings);
    return false;
  }
  // work: of the samples at a path, over that of the usual ones.
  bool leaves_time(const RunSettings& settings, double work) const {
    const double needed = path_ * work * least_ * pixels_ + gathering_;
    return needed <= settings.seconds - watch_.seconds();
  }
  void stay_below(RunSettings& settings) const { settings.spp = least_ - 1; }
  // Terms that no vertex has part in are the same in all.
  void measure(Candidate& candidate) {
    const bool misses = &candidate == &candidates_[0];
    ReverseEstimator& estimator = *candidate.estimator;
    for (size_t slot = 0; slot < estimator.slots(); ++slot) {
      candidate.figures.emplace_back();
      if (!estimator.computes(slot) || estimator.samples_of(slot) == 0) continue;
      const auto known = alike_.find(estimator.slot_name(slot));
      candidate.figures.back() =
          known != alike_.end() ? known->second : probe_->figures(estimator, slot);
      if (misses && estimator.draws_at_vertices(slot))
        for (double& v : candidate.figures.back().variances) v *= kUnseen;
      if (!estimator.draws_at_vertices(slot))
        alike_[estimator.slot_name(slot)] = candidate.figures.back();
    }
  }

  // All draws together vary at least as much as what lists have in their place: between slats and a
  // lamp 1,024 paths may meet none of the draws that matter. Terms share what is missing evenly.
  void raise_unseen() {
    const std::vector<double> drawn = at_vertices(candidates_[0]);
    const std::vector<double> listed = at_vertices(candidates_[1]);
    const auto terms = static_cast<double>(std::ranges::count_if(
        candidates_[0].figures, [](const ReverseFigures& f) { return f.at_vertices; }));
    for (ReverseFigures& figures : candidates_[0].figures) {
      if (!figures.at_vertices) continue;
      for (size_t d = 0; d < std::min(figures.variances.size(), listed.size()); ++d)
        figures.variances[d] += std::max(0.0, kUnseen * listed[d] - drawn[d]) / terms;
    }
  }
  // Of all terms at vertices.
  static std::vector<double> at_vertices(const Candidate& candidate) {
    std::vector<double> sums;
    for (const ReverseFigures& figures : candidate.figures) {
      if (!figures.at_vertices) continue;
      sums.resize(std::max(sums.size(), figures.variances.size()));
      for (size_t d = 0; d < figures.variances.size(); ++d) sums[d] += figures.variances[d];
    }
    return sums;
  }

  const Stopwatch& watch_;
  const double pixels_;
  int least_ = 0;
  double gathering_ = 0, path_ = 0;  // seconds of a run's batches without paths; of one path
  std::vector<Candidate> candidates_;
  std::unique_ptr<Probe> probe_;
  bool looks_ = false;
  std::map<std::string, ReverseFigures> alike_;
};

}  // namespace

bool lists_silhouettes(double listed, double drawn) { return listed < kBetter * drawn; }

BackwardOptions without_pilot(const BackwardOptions& options) {
  if (!options.method->reverse->chooses) return options;
  return with_method(options, asks_for_regions(options) ? "silhouettes" : "forest");
}

ReversePlan planned(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
                    RunSettings& settings, const Stopwatch& watch, KeptEdges* kept) {
  const auto plain = [&](const BackwardOptions& own) {
    return ReversePlan{std::make_unique<ReverseEstimator>(scene, adjoint, own, settings.threads,
                                                          std::nullopt, kept),
                       ""};
  };
  const bool chooses = options.method->reverse->chooses;
  const bool free = chooses && options.terms.empty() && leaves_numbers(options) &&
                    !options.uniform_pixels &&
                    !needs_times(scene, reverse_parameters(scene, options));
  if (!free) {
    ReversePlan plan = plain(without_pilot(options));
    if (chooses && !leaves_numbers(options)) {
      plan.decision =
          fmt::format("no pilot, since sample counts are given: {}", plan.estimator->method_name());
    }
    return plan;
  }
  return Pilot(scene, adjoint, options, settings, watch).plan(settings);
}

}  // namespace limn
