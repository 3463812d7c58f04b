// The reverse pass: batches of paths and of points on the film, each a gradient of its own.
#include "limn/integrators/backward.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <stdexcept>

#include "integrators/backward/contributions.h"
#include "integrators/backward/faces_pass.h"
#include "integrators/backward/parameter_slots.h"
#include "integrators/backward/path_adjoint.h"
#include "integrators/backward/pixel_choice.h"
#include "integrators/edges/scene_edges.h"
#include "integrators/estimates/batch_record.h"
#include "integrators/methods/hair_gaps.h"
#include "integrators/methods/selection.h"
#include "integrators/paths/traced_scene.h"
#include "integrators/terms/term.h"
#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/core/parallel.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/parts.h"

namespace limn {

const ParameterAdjoint& BackwardResult::of(const std::string& name) const {
  for (const ParameterAdjoint& parameter : parameters)
    if (parameter.name == name) return parameter;
  throw std::logic_error("no parameter \"" + name + "\" in this result");
}

namespace {

constexpr size_t kTile = 256;  // paths, or points on the film; not tuned

// What tiles, or batches, cost and found beside sums, joined in their order.
struct Figures {
  AdjointCosts costs;
  NonFinite bad;
  size_t tape_bytes = 0;

  void merge(const Figures& other) {
    for (size_t slot = 0; slot < costs.size(); ++slot) costs[slot].merge(other.costs[slot]);
    bad.merge(other.bad);
    tape_bytes = std::max(tape_bytes, other.tape_bytes);
  }
};

// What a batch came to.
struct BatchResult {
  std::vector<std::vector<double>> sums;  // of each parameter
  Figures figures;
  uint64_t contributions = 0;
};

BatchRecord to_record(const PathBatch& batch, const BatchResult& result) {
  BatchRecord record{batch.first, batch.last, {}, {}};
  RecordWriter to(record);
  for (const auto& sums : result.sums) to.add(sums);
  for (const TermCost& cost : result.figures.costs) to.add(cost);
  to.add(result.figures.bad);
  to.add(static_cast<int64_t>(result.figures.tape_bytes));
  to.add(static_cast<int64_t>(result.contributions));
  return record;
}

BatchResult to_result(const BatchRecord& record, const std::vector<Parameter>& parameters) {
  RecordReader from(record);
  BatchResult result;
  for (const Parameter& parameter : parameters) {
    result.sums.push_back(from.numbers(parameter.numbers()));
  }
  for (TermCost& cost : result.figures.costs) cost = from.cost();
  result.figures.bad = from.non_finite();
  result.figures.tape_bytes = static_cast<size_t>(from.count());
  result.contributions = static_cast<uint64_t>(from.count());
  from.end();
  return result;
}

constexpr int kMostSamples = 1 << 16;  // so that their products with paths are numbers

void check_samples(const BackwardOptions& options) {
  if (options.edge_samples < 1 || options.edge_samples > kMostSamples) {
    throw InputError(fmt::format("{} edges at a vertex of a path: there may be 1 to {}",
                                 options.edge_samples, kMostSamples));
  }
  const double camera = options.camera_samples == 0 ? 1 : options.camera_samples;
  for (const double samples : {camera, options.shadow_samples}) {
    if (samples > 0 && samples <= kMostSamples) continue;
    throw InputError(fmt::format("{:g} points on the film for a path: more than 0, {} at most",
                                 samples, kMostSamples));
  }
}

class BackwardPass {
 public:
  BackwardPass(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
               const RunSettings& settings)
      : options_(options),
        settings_(settings),
        film_(scene.film, adjoint_pixels(scene, adjoint)),
        choice_(film_.pixels(), options.uniform_pixels),
        parameters_(scene, reverse_parameters(scene, options)),
        method_(*options.method->reverse),
        traced_(parameters_.scene(), settings.threads, {.closed = method_.closed, .edges = true}),
        path_(traced_.context()),
        input_(path_, 3, {1, 1, 1, 1}, method_.sampler, settings.threads),
        types_(terms_of(parameters_.scene(), method_.sampler, method_.closed)),
        context_{path_, EdgeMotion(parameters_.slots(), input_.edges()),
                 FilterTable(scene.film.filter)} {
    input_.free = &parameters_.free();
    select();
  }

  BackwardResult run() {
    result_.setup_seconds = watch_.seconds();
    if (settings_.store) start(*settings_.store);
    if (settings_.seconds > 0) {
      run_in_time();
    } else {
      run_all();
    }
    finish();
    return std::move(result_);
  }

 private:
  void select();
  double camera_samples() const {
    if (options_.camera_samples > 0) return options_.camera_samples;
    return method_.closed ? 1 : 0.25;  // where nothing else is noisy, these points are what is
  }
  // Of a term with points on the film: how many, for each path.
  double film_samples(size_t slot) const {
    return types_[slot]->on_film_alone() ? camera_samples() : options_.shadow_samples;
  }
  size_t points_per_sample(size_t slot) const {
    return static_cast<size_t>(
        std::ceil(film_samples(slot) * static_cast<double>(film_.pixels().size())));
  }
  static size_t tiles_of(size_t samples) { return (samples + kTile - 1) / kTile; }
  std::vector<PathBatch> batches() const;
  size_t steps() const;
  void start(BatchStore& store) const;
  BatchStore::Task task(const PathBatch& batch) const {
    return settings_.store ? settings_.store->task(batch.first) : BatchStore::Task::kMake;
  }
  void run_all();
  void run_in_time();
  // None if stopped meanwhile.
  std::optional<BatchResult> run_batch(const PathBatch& batch, ProgressCounter& progress);
  void collect(const PathBatch& batch, const BatchResult& made);
  void run_paths(const PathBatch& batch, ProgressCounter& progress, ContributionSum& sum);
  void run_film(size_t slot, const PathBatch& batch, ProgressCounter& progress,
                ContributionSum& sum);
  // make(sample, tape, figures, list): adds one sample; false if it was not finite. place: of a
  // sample.
  template <class Make, class Place>
  void run_tiles(size_t samples, ProgressCounter& progress, ContributionSum& sum, size_t booked,
                 const Make& make, const Place& place);
  void finish();

  Stopwatch watch_;
  const BackwardOptions& options_;
  const RunSettings& settings_;
  FilmAdjoint film_;
  PixelChoice choice_;
  ParameterSlots parameters_;
  ReverseMethod method_;
  TracedScene traced_;
  const PathContext& path_;
  TermInput input_;
  std::vector<const TermType*> types_;  // of each slot
  AdjointContext context_;
  bool paths_ = false;  // whether some term uses them
  std::array<bool, kMostTerms> on_film_{};
  Figures batch_;  // of the batch in progress
  Figures all_;
  BackwardResult result_;
};

void BackwardPass::select() {
  std::vector<std::string> names;
  for (const TermType* type : types_) names.emplace_back(type->name);
  const auto chosen = selected_terms(names, options_.terms, parameters_.scene().file);
  check_samples(options_);
  for (size_t slot = 0; slot < types_.size(); ++slot) {
    const TermType& type = *types_[slot];
    const bool computed = std::find(chosen.begin(), chosen.end(), type.name) != chosen.end();
    result_.terms.push_back({type.name, computed, type.edges, 1, {}, {}});
    if (type.traces_paths) context_.pixel_slot = slot;
    const auto& term = context_.terms.emplace_back(computed ? type.make(input_) : nullptr);
    if (!term) continue;
    on_film_[slot] = term->uses_film();
    paths_ = paths_ || term->uses_paths() || term->uses_vertices();
    term->describe(result_.stats);
  }
  context_.edge_samples = options_.edge_samples;
  result_.stats.setup.emplace_back("edges", input_.edges_seconds());
  if (parameters_.scene().shading == ShadingModel::kMitsuba) {
    result_.warnings.push_back(
        "shading 'mitsuba' is discontinuous where no edge is: the derivative of interpolated "
        "normals is incomplete");
  }
  warn_of_contacts(parameters_.scene(), input_.made_edges(), result_.warnings);
  warn_of_faces_edge_on(parameters_.scene(), *path_.viewpoints, result_.warnings);
  const auto& all = parameters_.parameters();
  if (!std::all_of(all.begin(), all.end(), [](const auto& p) { return p.colour; })) {
    warn_of_shadows_on_lifted_points(parameters_.scene(), result_.warnings);
  }
  for (const Parameter& p : parameters_.parameters()) {
    result_.parameters.push_back({p.name, p.unit, p.shape(), Moments(p.numbers())});
  }
}

std::vector<PathBatch> BackwardPass::batches() const {
  const int count = std::clamp(settings_.spp, 1, std::max(1, options_.batches));
  const auto at = [&](int i) { return static_cast<int>(int64_t{settings_.spp} * i / count); };
  std::vector<PathBatch> list;
  for (int b = 0; b < count; ++b) list.push_back({settings_.seed, at(b), at(b + 1)});
  return list;
}

size_t BackwardPass::steps() const {
  size_t steps = 1;
  for (const PathBatch& batch : batches()) {
    if (task(batch) != BatchStore::Task::kMake) continue;
    steps += tiles_of(choice_.paths(batch));
    for (size_t slot = 0; slot < types_.size(); ++slot) {
      if (on_film_[slot]) steps += tiles_of(points_per_sample(slot) * batch.count());
    }
  }
  return steps;
}

void BackwardPass::start(BatchStore& store) const {
  if (settings_.seconds > 0) {
    throw InputError("a run in parts is given by its samples: it takes no limit of time");
  }
  std::vector<double> pixels;
  for (const Rgb<double>& a : film_.pixels()) pixels.insert(pixels.end(), {a.r, a.g, a.b});
  store.identify("method", "backward");
  store.identify("sampling", options_.method.name());
  store.identify("samples per pixel", std::to_string(settings_.spp));
  store.identify("seed", std::to_string(settings_.seed));
  store.identify("adjoint", fingerprint(pixels));
  store.identify("scene", fingerprint(parameters_.scene()));
  store.identify("parameters", join(names_of(parameters_.parameters())));
  store.identify("velocities", fingerprint(parameters_.scene(), parameters_.parameters()));
  std::vector<std::string> terms;
  for (const TermRun& term : result_.terms)
    if (term.computed) terms.push_back(term.name);
  store.identify("terms", join(terms));
  store.identify("samples",
                 fmt::format("{} pixels, {} edges, {} on the film, {} of shadows, {} batches",
                             options_.uniform_pixels ? "uniform" : "adjoint", options_.edge_samples,
                             camera_samples(), options_.shadow_samples, options_.batches));
  store.start(settings_.spp);
}

void BackwardPass::run_all() {
  ProgressCounter progress(settings_, watch_, steps());
  for (const PathBatch& batch : batches()) {
    if (task(batch) == BatchStore::Task::kLeave) continue;
    if (progress.stopped()) break;
    if (task(batch) == BatchStore::Task::kRead) {
      collect(batch, to_result(settings_.store->read(batch.first), parameters_.parameters()));
      continue;
    }
    const auto made = run_batch(batch, progress);
    if (!made) break;
    if (settings_.store) settings_.store->write(to_record(batch, *made));
    collect(batch, *made);
  }
}

// Batches of one size, so that a run with as many samples and batches repeats the bits. The first
// one tells the time of a sample; where more than one fits into a batch it is thrown away. Standard
// errors need two batches, so that each takes half of the time at most.
void BackwardPass::run_in_time() {
  ProgressCounter progress(settings_, watch_, SIZE_MAX);
  PathBatch batch{settings_.seed, 0, std::min(settings_.spp, 1)};
  const Stopwatch first;
  auto made = run_batch(batch, progress);
  if (!made) return;
  const double left = settings_.seconds - watch_.seconds();
  const int most = std::max(2, std::min(options_.batches, settings_.spp));
  const double fitting = left / std::max(first.seconds(), 1e-9) / most;
  const int size =
      static_cast<int>(std::clamp(fitting, 1.0, std::max(1.0, double(settings_.spp) / most)));
  if (size == 1) collect(batch, *made);
  const Stopwatch since;
  for (int done = 0, next = size == 1 ? 1 : 0; next + size <= settings_.spp; next += size, ++done) {
    const double each = done > 0 ? since.seconds() / done : size * first.seconds();
    const bool needed = next < settings_.least_spp || result_.batches < 2;
    if (!needed && watch_.seconds() + each > settings_.seconds) break;
    batch = {settings_.seed, next, next + size};
    made = run_batch(batch, progress);
    if (!made) break;
    collect(batch, *made);
  }
}

std::optional<BatchResult> BackwardPass::run_batch(const PathBatch& batch,
                                                   ProgressCounter& progress) {
  ContributionSum sum(parameters_.slots().count);
  batch_ = {};
  if (paths_) run_paths(batch, progress, sum);
  for (size_t slot = 0; slot < types_.size(); ++slot) {
    if (on_film_[slot]) run_film(slot, batch, progress, sum);
  }
  if (progress.stopped()) return std::nullopt;
  BatchResult made{parameters_.gather(sum.sums()), batch_, sum.added()};
  for (auto& sums : made.sums) {
    for (double& v : sums) v *= batch.count();
  }
  return made;
}

void BackwardPass::collect(const PathBatch& batch, const BatchResult& made) {
  for (size_t i = 0; i < made.sums.size(); ++i) {
    result_.parameters[i].moments.add_batch(made.sums[i], batch.count());
  }
  if (options_.each_batch) options_.each_batch(batch.count(), made.sums);
  all_.merge(made.figures);
  result_.contributions += made.contributions;
  result_.spp += batch.count();
  ++result_.batches;
}

template <class Make, class Place>
void BackwardPass::run_tiles(size_t samples, ProgressCounter& progress, ContributionSum& sum,
                             size_t booked, const Make& make, const Place& place) {
  const size_t tiles = tiles_of(samples);
  size_t first = 0;  // of the wave
  std::vector<Figures> figures;
  const auto make_tile = [&](size_t tile, std::vector<Contribution>& list) {
    if (progress.stopped()) return;
    const Stopwatch watch;
    Tape tape(&parameters_.slots());
    const TapeScope scope(tape);
    Figures& own = figures[tile - first];
    for (size_t i = tile * kTile; i < std::min(samples, (tile + 1) * kTile); ++i) {
      if (!make(i, tape, own, list)) own.bad.add(place(i));
      own.tape_bytes = std::max(own.tape_bytes, tape.bytes());
    }
    // A point that sees an emitter past a mesh hangs on hundreds of numbers, most of which its
    // neighbours hang on, too.
    if (method_.closed) join_slots(list);
    double inside = 0;
    for (const TermCost& cost : own.costs) inside += cost.seconds;
    own.costs[booked].seconds += watch.seconds() - inside;
    progress.step();
  };
  for (; first < tiles && !progress.stopped(); first += ContributionSum::kWave) {
    const size_t last = std::min(tiles, first + ContributionSum::kWave);
    figures.assign(last - first, {});
    sum.add_wave(first, last, settings_.threads, make_tile);
    for (const Figures& own : figures) batch_.merge(own);
  }
}

void BackwardPass::run_paths(const PathBatch& batch, ProgressCounter& progress,
                             ContributionSum& sum) {
  const Film& film = parameters_.scene().film;
  const uint64_t width = parameters_.scene().camera.width;
  const auto position = [&](size_t pixel) {
    return std::pair<int, int>(film.crop_x + static_cast<int>(pixel % film.crop_width),
                               film.crop_y + static_cast<int>(pixel / film.crop_width));
  };
  run_tiles(
      choice_.paths(batch), progress, sum, context_.pixel_slot,
      [&](size_t i, Tape& tape, Figures& own, std::vector<Contribution>& list) {
        const PixelPath path = choice_.path(batch, i);
        const Rgb<double> adjoint = film_.pixels()[path.pixel] * (1 / path.expected);
        if (is_black(adjoint)) return true;
        const auto [x, y] = position(path.pixel);
        const Rng key(batch.seed, y * width + x, path.sample);
        return add_path_adjoint(context_, x, y, key, adjoint, tape, own.costs, list);
      },
      [&](size_t i) {
        const PixelPath path = choice_.path(batch, i);
        const auto [x, y] = position(path.pixel);
        return NonFinite::SampleId{x, y, static_cast<int64_t>(path.sample),
                                   types_[context_.pixel_slot]->name};
      });
}

void BackwardPass::run_film(size_t slot, const PathBatch& batch, ProgressCounter& progress,
                            ContributionSum& sum) {
  const size_t count = points_per_sample(slot) * batch.count();
  const size_t first = points_per_sample(slot) * batch.first;
  const double share = 1 / static_cast<double>(count);
  run_tiles(
      count, progress, sum, slot,
      [&](size_t i, Tape& tape, Figures& own, std::vector<Contribution>& list) {
        const Rng key = Rng(batch.seed, UINT64_MAX, first + i)
                            .copy(Purpose::kFilmCopy, types_[slot]->film_stream);
        const double u = (i + key.at(Purpose::kCamera, 0).uniform()) / count;
        try {
          return add_film_adjoint(context_, film_, {slot, u, key, share}, tape, own.costs[slot],
                                  list);
        } catch (const UntraceableRay&) {
          return false;
        }
      },
      [&](size_t i) {
        return NonFinite::SampleId{-1, -1, static_cast<int64_t>(first + i), types_[slot]->name};
      });
}

void BackwardPass::finish() {
  for (size_t slot = 0; slot < types_.size(); ++slot) {
    TermRun& term = result_.terms[slot];
    term.cost = all_.costs[slot];
    if (on_film_[slot] || types_[slot]->on_film_alone()) {
      term.samples = film_samples(slot);
    } else if (slot != context_.pixel_slot) {
      term.samples = options_.edge_samples;
    }
  }
  result_.non_finite = all_.bad;
  result_.tape_bytes = all_.tape_bytes;
  if (result_.spp > 0 && options_.find_gaps) {
    warn_of_hair_gaps(parameters_.scene(), static_cast<double>(result_.spp), settings_.threads,
                      result_.warnings);
  }
  result_.seconds = watch_.seconds();
}

}  // namespace

BackwardResult backward(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
                        const RunSettings& settings) {
  check_task(options.method, Task::kBackward);
  check_points(options.points, options.method->closed_light, options.method.name());
  if (options.points == FilmPoints::kFaces) {
    return backward_over_faces(scene, adjoint, options, settings_for(options.points, settings));
  }
  return BackwardPass(scene, adjoint, options, settings).run();
}

}  // namespace limn
