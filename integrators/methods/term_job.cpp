// Derivatives term by term: passes over the parameters, a pilot that shares the work among the
// terms, and what batches add up to.
#include "integrators/methods/term_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "integrators/edges/scene_edges.h"
#include "integrators/edges/texture_discontinuities.h"
#include "integrators/estimates/batches.h"
#include "integrators/methods/run_notes.h"
#include "integrators/methods/term_sums.h"
#include "integrators/paths/chain_light.h"
#include "integrators/pilot/allocation.h"
#include "integrators/pilot/field_fit.h"
#include "integrators/pilot/film_fit.h"
#include "integrators/pilot/film_flow.h"
#include "integrators/pilot/pilot.h"
#include "integrators/pilot/probed.h"
#include "integrators/pilot/term_estimator.h"
#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/parameter.h"
#include "limn/edgetree/edge_sampler_types.h"
#include "limn/integrators/parts.h"

namespace limn {
namespace {

// What a pilot chose: other machines must have chosen the same.
void identify_plan(const std::vector<TermRun>& terms, BatchStore& store) {
  std::vector<double> counts;
  for (const TermRun& term : terms) {
    counts.push_back(term.samples);
    counts.insert(counts.end(), term.pixel_samples.begin(), term.pixel_samples.end());
  }
  store.identify("choice of the pilot", fingerprint(counts));
}

// Positions on the film move if, by pilots, that leaves less than this share of squared error times
// work. Not tuned.
constexpr double kFilmConvincing = 0.97;
// Their motion is tried if a fit of it leaves less than the first share, and, of what turns of
// directions leave, not much more: together they may leave less. In view, where either leaves 0.3,
// both leave 0.2; in a chandelier, where turns leave 0.05 and motion 0.2, both leave 0.05 to 0.1.
// Turns that leave less than the last share leave too little to look for.
constexpr double kFilmPromising = 0.99, kFilmAgainstTurns = 1.25, kTurnsAlone = 0.2;
// Of a pilot, before positions on the film are looked at; it goes on behind that. Not tuned.
constexpr int kFirstLook = 8;
// What pilots may take of a limit of time.
constexpr double kPilotShare = 1.0 / 8;
// The most work of the pilot that looks at them, as a share of the run's. Not tuned.
constexpr double kFilmShare = 1.0 / 4;

// Of runs long enough for more estimators: samples, and a set-up's share of the time; not tuned.
constexpr int kLongRun = 256;
constexpr double kSetupShare = 1.0 / 32;

// When a pilot looks at a scene that moves: at the reference time velocities change nothing.
constexpr double kPilotTime = 0.75;  // not tuned

// A whole run of one method.
class TermJob {
 public:
  TermJob(const Scene& scene, const GradientOptions& options, const TermMethod& method,
          const RunSettings& settings)
      : scene_(scene),
        options_(options),
        method_(method),
        parameters_(limn::parameters_of(scene, options)),
        moving_(needs_times(scene, parameters_)),
        // What a pilot finds of turns and of positions on the film holds for its own time alone.
        moves_film_(method.moves_film && scene.camera.is_pinhole() && !moving_),
        types_(terms_of(scene, method.sampler, method.closed, moves_film_)) {
    const std::vector<std::string> chosen = selected_terms(term_names(), options.terms, scene.file);
    if (options.samples) check_samples(*options.samples);
    moved_ = moved_in(scene, parameters_);
    keep_changed(chosen);
    if (moving_) {
      method_.moves_directions = method_.random_directions = false;
      start_ = scene;
      share_between_times(*start_, settings.threads);
    }
    passes_ = passes_at(moving_ ? std::optional(kPilotTime) : std::nullopt, settings.threads);
  }

  GradientResult run(const RunSettings& settings, const Stopwatch& watch, const Rival& rival) {
    check_memory(passes_);
    GradientResult result = empty_result();
    const size_t warned = result.warnings.size();
    for (size_t p = 0; p < passes_.size(); ++p) {
      pass(p).describe(result.stats);
      pass(p).warn_of_kinks(result.warnings);
    }
    result.at_kink = result.warnings.size() > warned;
    warn_of_views(result);
    plan(settings, watch, result);
    if (rival && forecasts_ == passes_.size()) {
      for (const auto& [part, seconds] : result.stats.setup)
        if (part == "ray tracer") forecast_.tracer_seconds = seconds;
      if (std::optional<GradientResult> other = rival(forecast_)) return std::move(*other);
    }
    if (settings.store) identify_plan(result.terms, *settings.store);
    result.setup_seconds = watch.seconds();
    const EstimatorsAt at = [&](double u) {
      EstimatorsAtTime now{{}, passes_at(u, settings.threads)};
      for (size_t p = 0; p < passes_.size(); ++p) {
        static_cast<TermEstimator&>(*now.list[p]).set_plan(pass(p).plan());
      }
      return now;
    };
    const auto take = [&](const Batch& batch, const auto& sums) {
      add_batch(batch.count(), sums, result);
    };
    run_batches(passes_, settings, watch, take, moving_ ? at : EstimatorsAt());
    result.seconds = watch.seconds();
    if (method_.warps) describe_warping(options_.warp, result);
    return result;
  }

  std::vector<std::string> trace(const RunSettings& settings, const NonFinite::SampleId& place) {
    check_still(scene_, "the trace of one sample (debug-sample)", parameters_);
    GradientResult unused = empty_result();
    const Stopwatch watch;
    plan(settings, watch, unused);
    SampleLog log;
    for (size_t p = 0; p < passes_.size(); ++p) {
      for (size_t k = 0; k < static_cast<size_t>(pass(p).lanes()); ++k) {
        log.push_back(fmt::format("parameter {}: {}", k + 1, options_.parameters[p * kLanes + k]));
      }
      if (place.x >= 0) {
        check_pixel(scene_.film, place);
        run_pixel_sample(pass(p), settings.seed, {place.x, place.y, place.sample}, log);
      } else {
        run_film_sample(pass(p), settings, place, log);
      }
    }
    return log;
  }

 private:
  size_t pass_count() const { return (parameters_.size() + kLanes - 1) / kLanes; }
  std::span<const Parameter> parameters_of(size_t p) const {
    const auto rest = std::span(parameters_).subspan(p * kLanes);
    return rest.first(std::min<size_t>(kLanes, rest.size()));
  }
  // time: of the shutter; none: the reference time.
  std::unique_ptr<TermEstimator> pass_at(size_t p, const std::optional<double>& time, int threads) {
    const Warping warping{options_.warp, method_.unbiased};
    TermExtras extras{.warping = method_.warps ? &warping : nullptr,
                      .closed = method_.closed,
                      .moved_film = moves_film_,
                      .time = time};
    kept_.resize(pass_count());
    if (time) extras.kept = &kept_[p];
    return std::make_unique<TermEstimator>(start_ ? *start_ : scene_, parameters_of(p), types_,
                                           computed_, method_.sampler, threads, extras);
  }
  std::vector<std::unique_ptr<SampleEstimator>> passes_at(const std::optional<double>& time,
                                                          int threads) {
    std::vector<std::unique_ptr<SampleEstimator>> passes;
    for (size_t p = 0; p < pass_count(); ++p) passes.push_back(pass_at(p, time, threads));
    return passes;
  }
  // Each sample of a pilot has its own time, as those of the run: what differs between times is
  // left by any number of samples at one, and is worth no more of them.
  TermsAt pilots_at(size_t p, const RunSettings& settings) {
    if (!moving_) return {};
    constexpr uint64_t kStream = 0x70696c6f;  // any number
    constexpr double kGolden = 0.6180339887498949;
    const double first = Rng(settings.seed, kStream, 0).uniform();
    return [this, p, first, threads = settings.threads](int sample) {
      const double u = first + kGolden * sample;
      return pass_at(p, u - std::floor(u), threads);
    };
  }
  // The rows of terms that can differ from zero, with their samples.
  void keep_changed(const std::vector<std::string>& chosen) {
    const std::vector<const TermType*> all = types_;
    types_.clear();
    std::vector<double> samples;
    for (size_t t = 0; t < all.size(); ++t) {
      if (!all[t]->changes(moved_)) continue;
      types_.push_back(all[t]);
      computed_.push_back(std::find(chosen.begin(), chosen.end(), all[t]->name) != chosen.end());
      if (options_.samples) samples.push_back((*options_.samples)[t]);
    }
    if (options_.samples) samples_ = SampleCounts(samples);
  }

  void warn_of_views(GradientResult& result) const {
    const std::string missing = missing_by_chains(pass(0).context(), scene_, parameters_);
    result.incomplete = !missing.empty();
    if (result.incomplete) result.warnings.push_back(missing);
    if (moved_.any()) check_texture_edges(scene_, result.warnings);
    bool reported = false;
    for (size_t p = 0; p < passes_.size(); ++p) {
      const Viewpoints* viewpoints = pass(p).viewpoints();
      if (!viewpoints) continue;
      if (!reported) warn_of_faces_edge_on(scene_, *viewpoints, result.warnings);
      reported = true;
      result.at_kink = result.at_kink || viewpoints->cross_planes();
    }
  }

  // What moving directions change in one term they take back in the others, and at every
  // discontinuity of radiance there must be an edge: of what smooth lobes show there may be none.
  bool has_all_edges() const {
    if (!has_all_edges_) {
      has_all_edges_ = scene_.shading == ShadingModel::kContinuous &&
                       find_chain_light(pass(0).context(), 0).shapes.empty();
    }
    return *has_all_edges_;
  }
  // Of edges that vertices see by way of mirrors no term takes back what turned directions change.
  bool sees_no_mirrors() const {
    const FlatMirrors* const mirrors = pass(0).context().flat_mirrors;
    return !mirrors || mirrors->mirrors().empty();
  }
  bool can_move_directions() const {
    for (size_t t = 0; t < types_.size(); ++t) {
      if (types_[t]->moved_with_directions && !computed_[t]) return false;
    }
    return has_all_edges() && sees_no_mirrors();
  }
  // The same of positions on the film, which change all terms.
  bool can_move_film() const {
    return moves_film_ && has_all_edges() &&
           std::find(computed_.begin(), computed_.end(), false) == computed_.end();
  }
  int64_t terms_computed() const { return std::count(computed_.begin(), computed_.end(), true); }
  TermEstimator& pass(size_t p) const { return static_cast<TermEstimator&>(*passes_[p]); }

  std::vector<std::string> term_names() const {
    std::vector<std::string> names;
    for (const TermType* type : types_) names.emplace_back(type->name);
    return names;
  }

  void check_samples(const SampleCounts& samples) const {
    constexpr double kMostSamples = 1024;  // as the program's --samples
    bool good = samples.size() <= types_.size();
    for (size_t t = 0; t < types_.size(); ++t) {
      const bool whole = types_[t]->least_samples == 1;
      good = good && samples[t] > 0 && samples[t] <= kMostSamples &&
             (!whole || samples[t] == std::floor(samples[t]));
    }
    if (good) return;
    std::string wanted;
    for (const TermType* type : types_) {
      wanted += fmt::format("{}{}{}", wanted.empty() ? "" : ", ", type->name,
                            type->least_samples == 1 ? "" : " (may be less than 1)");
    }
    throw FieldError("samples",
                     fmt::format("\"{}\": counts must be positive, at most {:g}, and whole where "
                                 "paths are concerned, as in 3,0.5,1; the terms are {}",
                                 to_string(samples), kMostSamples, wanted));
  }

  // Plans every pass, by a pilot or as the options say.
  void plan(const RunSettings& settings, const Stopwatch& watch, GradientResult& result) {
    const Stopwatch pilot_watch;
    const bool is_long = settings.seconds > 0 ? watch.seconds() < kSetupShare * settings.seconds
                                              : settings.spp >= kLongRun;
    std::vector<double> means(types_.size());
    for (size_t p = 0; p < passes_.size(); ++p) {
      SamplePlan plan;
      plan.uniform = samples_.value_or(SampleCounts{});
      if (!options_.samples)
        plan = plan_by_pilot(p, budget_of(p, settings, watch, is_long), result);
      if (method_.random_directions && !pass(p).motion_rates().still()) {
        const bool turns = can_move_directions(), film = can_move_film();
        if (turns || film) plan.grid = PlanGrid(scene_.film, film_size(scene_.film));
        if (turns) plan.fields = random_fields(plan.grid.size(), pass(p), settings.seed);
        if (film) plan.film = random_motions(plan.grid.size(), pass(p), settings.seed);
      }
      plan.numbers = method_.numbers;
      for (size_t t = 0; t < types_.size(); ++t) {
        means[t] += plan.uniform[t] / static_cast<double>(passes_.size());
      }
      if (!options_.samples && !plan.film.empty()) describe_film(plan.film, result);
      pass(p).set_plan(plan);
      add_pixel_samples(pass(p), pass(p).plan(), result);
    }
    for (size_t t = 0; t < types_.size(); ++t) result.terms[t].samples = means[t];
    if (result.pilot_spp > 0) result.stats.setup.emplace_back("pilot", pilot_watch.seconds());
  }

  GradientResult empty_result() const {
    const Film& film = scene_.film;
    const int block = options_.block;
    const Moments blocks(block > 0 ? block_count(film.crop_width, film.crop_height, block) : 0,
                         true);
    GradientResult result;
    for (size_t t = 0; t < types_.size(); ++t) {
      result.terms.push_back({types_[t]->name, computed_[t], types_[t]->edges, 1, {}, {}});
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

  void add_pixel_samples(const TermEstimator& estimator, const SamplePlan& plan,
                         GradientResult& result) const {
    const Film& film = scene_.film;
    if (plan.counts.empty()) return;
    for (size_t t = 0; t < types_.size(); ++t) {
      if (!computed_[t] || !estimator.adds_to_pixels(t)) continue;
      std::vector<float>& samples = result.terms[t].pixel_samples;
      samples.resize(film_size(film) / 3);
      for (size_t i = 0; i < samples.size(); ++i) {
        const PixelSample at{film.crop_x + static_cast<int>(i) % film.crop_width,
                             film.crop_y + static_cast<int>(i) / film.crop_width, 0};
        samples[i] +=
            static_cast<float>(plan.counts_at(at)[t]) / static_cast<float>(passes_.size());
      }
    }
  }

  // What the pilots of a pass may take: its share of the time that is left, from now on.
  struct Budget {
    RunSettings settings;
    Stopwatch watch;
    bool is_long;  // against what it takes to set up an estimator

    bool timed() const { return settings.seconds > 0; }
  };
  Budget budget_of(size_t p, const RunSettings& settings, const Stopwatch& watch,
                   bool is_long) const {
    Budget budget{settings, {}, is_long};
    const auto passes = static_cast<double>(passes_.size() - p);
    if (budget.timed())
      budget.settings.seconds = std::max((settings.seconds - watch.seconds()) / passes, 1e-9);
    return budget;
  }

  SamplePlan plan_by_pilot(size_t p, const Budget& budget, GradientResult& result) {
    TermEstimator& estimator = pass(p);
    const auto& [settings, watch, is_long] = budget;
    SamplePlan plan;
    plan.splits = method_.spreads_samples && !options_.uniform_samples;
    const int spp = pilot_samples(settings.spp);
    if (spp == 0 || (!method_.spreads_samples && terms_computed() < 2)) return plan;
    const bool turns =
        method_.moves_directions && can_move_directions() && !estimator.motion_rates().still();
    SamplePlan probing;
    probing.splits = plan.splits;
    estimator.set_plan(probing);
    const bool film = film_pilot_samples(settings.spp) > 0 && can_move_film() &&
                      !method_.random_directions && !estimator.motion_rates().still();
    const double detail = film && budget.timed() ? edges_per_pixel(estimator) : 0;
    const PilotSize size =
        size_of_pilot(estimator, turns, film ? std::min(spp, kFirstLook) : spp, detail, budget);
    Probed probed;
    if (size.spp > 0)
      probed = probe(estimator, turns, size, settings, watch, pilots_at(p, settings));
    const bool looks =
        film && probed.pilot.spp > 0 &&
        (!budget.timed() || is_time_for_film({probed.pilot.spp, watch.seconds(), settings.seconds},
                                             slides(estimator), detail));
    if (looks) {
      look_at_film(p, turns, budget, size, probing, probed);
      if (!budget.timed() || watch.seconds() < kPilotShare * settings.seconds)
        extend(probed, estimator, turns, {size.pixels, spp}, settings, watch);
    }
    if (budget.timed()) describe_pilot(probed, looks, detail, result);
    if (probed.pilot.spp == 0) return plan;
    result.pilot_spp = probed.pilot.spp;
    plan.film = std::move(probing.film);
    share_out(estimator, probed, most_work_of(budget, probed.pilot), plan);
    if (!plan.film.empty()) refine(plan, probing.grid);
    return plan;
  }

  // Whether what is seen within surfaces may slide.
  static bool slides(const TermEstimator& estimator) {
    return estimator.motion_rates().moves_camera() || moves_textures(estimator.scene());
  }

  // In timed runs, of a share of the pixels where samples of all take too long.
  PilotSize size_of_pilot(const TermEstimator& estimator, bool turns, int spp, double detail,
                          const Budget& budget) const {
    const size_t pixels = std::min(film_size(scene_.film) / 3, kMostProbes);
    if (!budget.timed()) return {pixels, spp};
    const double each = seconds_of_pixel(estimator, turns, budget.settings, budget.watch);
    // Two more pilots may follow.
    const bool several = detail > 0 && (slides(estimator) || detail >= kFilmDetail);
    const double share = several ? kPilotShare / 3 : kPilotShare;
    return pilot_size(each, pixels, spp, share * budget.settings.seconds,
                      budget.settings.seconds - budget.watch.seconds());
  }

  // Positions on the film move where pilots with them and without say so; what turns of directions
  // take out is taken out by either.
  void look_at_film(size_t p, bool turns, const Budget& budget, const PilotSize& size,
                    SamplePlan& plan, Probed& probed) const {
    TermEstimator& estimator = pass(p);
    const auto& [settings, watch, is_long] = budget;
    const int lanes = estimator.lanes();
    const double held = probed.error_times_work(lanes);
    const double not_turned = probed.error_times_work(lanes, false);
    if (!(held > kTurnsAlone * not_turned)) return;
    const double pixels = static_cast<double>(film_size(scene_.film)) / 3;
    const FilmLook look{
        film_pilot_samples(settings.spp),
        kFilmShare * settings.spp * probed.pilot.work_of_pixel() * pixels,
        probed.shared * std::min(kFilmPromising, kFilmAgainstTurns * held / not_turned),
        size.pixels};
    FilmFit film = fit_film_of(p, plan, look, budget);
    if (!film.motion.empty()) {
      SamplePlan moving = plan;
      moving.grid = film.grid;
      moving.film = std::move(film.motion);
      estimator.set_plan(moving);
      Probed other = probe(estimator, turns, {size.pixels, probed.pilot.spp}, settings, watch);
      const double left = other.pilot.spp > 0 ? other.error_times_work(lanes) : 0;
      if (left > 0 && left < kFilmConvincing * held) {
        probed = std::move(other);
        plan = std::move(moving);
        return;
      }
    }
    estimator.set_plan(plan);
  }

  // Positions are held where the result is empty. More parameters than the film leaves lanes for
  // are looked at two by two, by estimators of their own: only in runs that are long against what
  // it takes to set them up.
  FilmFit fit_film_of(size_t p, const SamplePlan& plan, FilmLook look, const Budget& budget) const {
    TermEstimator& estimator = pass(p);
    if (estimator.lanes() <= kMostFilmParameters) {
      return fit_film(estimator, plan, look, budget.settings, budget.watch);
    }
    FilmFit fit;
    if (!budget.is_long) return fit;
    const auto parameters = parameters_of(p);
    const double pairs = std::ceil(estimator.lanes() / double{kMostFilmParameters});
    RunSettings settings = budget.settings;
    settings.seconds /= pairs;
    look.work /= pairs;
    for (int first = 0; first < estimator.lanes(); first += kMostFilmParameters) {
      const auto some =
          parameters.subspan(first, std::min(kMostFilmParameters, estimator.lanes() - first));
      TermEstimator two(scene_, some, types_, computed_, method_.sampler, settings.threads,
                        {.moved_film = true});
      if (two.motion_rates().still()) continue;
      const FilmFit part = fit_film(two, plan, look, settings, budget.watch);
      if (part.motion.empty()) continue;
      fit.grid = part.grid;
      fit.motion.resize(part.motion.size());
      for (size_t cell = 0; cell < fit.motion.size(); ++cell) {
        for (size_t k = 0; k < some.size(); ++k) {
          fit.motion[cell].x[first + k] = part.motion[cell].x[k];
          fit.motion[cell].y[first + k] = part.motion[cell].y[k];
        }
      }
    }
    return fit;
  }

  // Into the mean over parameters, by their variances. figures: before this one's is added.
  static void add_shares(const DrawShares& shares, double variance, TermFigures& figures) {
    const double all = figures.variance + variance;
    const double weight = all > 0 ? variance / all : 0;
    figures.shares.kept += weight * (shares.kept - figures.shares.kept);
    figures.shares.power += weight * (shares.power - figures.shares.power);
  }

  // Each parameter counts alike: its variances are divided by their sum. units: these sums.
  std::vector<TermFigures> figures_of(const TermEstimator& estimator, const Probed& probed,
                                      std::vector<double>& units) const {
    const PilotFigures& pilot = probed.pilot;
    std::vector<TermFigures> figures(types_.size());
    for (size_t t = 0; t < figures.size(); ++t) {
      figures[t].cost = pilot.work[t];
      figures[t].first = pilot.first_work[t];
      figures[t].least = types_[t]->least_samples;
      if (method_.spreads_samples && t != estimator.pixel_slot()) figures[t].least = kLeastSamples;
      figures[t].on_film = !pilot.in_cells(t);
      if (!pilot.in_cells(t)) continue;
      figures[t].cells.resize(pilot.grid.size());
      figures[t].cells_squared.resize(pilot.grid.size());
    }
    for (int lane = 0; lane < estimator.lanes(); ++lane) {
      const Probed::Spread spread = probed.spread(lane);
      const std::vector<double>& means = spread.variances;
      const double sum = std::accumulate(means.begin(), means.end(), 0.0);
      units.push_back(sum);
      if (!(sum > 0)) continue;
      for (size_t t = 0; t < figures.size(); ++t) {
        add_shares(pilot.shares(t, lane), means[t] / sum, figures[t]);
        figures[t].variance += means[t] / sum;
        figures[t].squared_mean += spread.squared_means[t] / sum;
        for (size_t i = 0; i < spread.cells[t].size(); ++i) {
          figures[t].cells[i] += spread.cells[t][i] / sum;
          figures[t].cells_squared[i] += spread.cells_squared[t][i] / sum;
        }
      }
    }
    return figures;
  }

  // Of a sample of one pixel: a run makes the first `least_spp` of them, whatever they cost.
  double most_work_of(const Budget& budget, const PilotFigures& pilot) const {
    if (!budget.timed()) return kNoLimit;
    return most_work(budget.settings.seconds - budget.watch.seconds(), pilot.seconds_of_work,
                     budget.settings.least_spp, film_size(scene_.film) / 3);
  }

  // By what a pilot found. most: work of a sample of one pixel.
  void share_out(const TermEstimator& estimator, const Probed& probed, double most,
                 SamplePlan& plan) {
    const auto& [pilot, fit, shared] = probed;
    std::vector<double> units;
    const std::vector<TermFigures> figures = figures_of(estimator, probed, units);
    PlanTotals totals;
    if (method_.spreads_samples && !options_.uniform_samples) {
      totals = spread_samples(figures, pilot.grid, plan, most, method_.or_differences);
    } else {
      plan.uniform = best_samples(figures, most);
      totals = totals_of(figures, plan.uniform);
    }
    add_forecast(pilot, units, totals);
    for (double& unit : units) unit /= shared;  // of single samples
    if (method_.spreads_samples || method_.random_directions)
      plan.survival = survival_of(pilot.traced, totals.price(), units);
    plan.grid = pilot.grid;
    plan.fields = fit.fields;
  }

  void add_forecast(const PilotFigures& pilot, const std::vector<double>& units,
                    const PlanTotals& totals) {
    ++forecasts_;
    forecast_.units.insert(forecast_.units.end(), units.begin(), units.end());
    forecast_.error += totals.expected;
    forecast_.work += totals.cost;
    forecast_.seconds +=
        totals.cost * pilot.seconds_of_work * static_cast<double>(film_size(scene_.film)) / 3;
  }

  const Scene& scene_;
  const GradientOptions& options_;
  TermMethod method_;
  std::vector<Parameter> parameters_;
  bool moving_;      // whether samples have times
  bool moves_film_;  // whether positions on the film may move
  mutable std::optional<bool> has_all_edges_;
  Moved moved_;                          // by any of the parameters
  std::vector<const TermType*> types_;   // that can differ from zero
  std::vector<bool> computed_;           // of each term
  std::optional<SampleCounts> samples_;  // the options', of each term
  std::optional<Scene> start_;           // of scenes that move: the scene, with known overlaps
  std::vector<KeptEdges> kept_;          // the same, of each pass
  std::vector<std::unique_ptr<SampleEstimator>> passes_;
  TermForecast forecast_;
  size_t forecasts_ = 0;  // passes that are in it
};

}  // namespace

GradientResult run_terms(const TermMethod& method, const Scene& scene,
                         const GradientOptions& options, const RunSettings& settings,
                         const Rival& rival) {
  const Stopwatch watch;
  return TermJob(scene, options, method, settings).run(settings, watch, rival);
}

std::vector<std::string> trace_terms(const TermMethod& method, const Scene& scene,
                                     const GradientOptions& options, const RunSettings& settings,
                                     const NonFinite::SampleId& place) {
  return TermJob(scene, options, method, settings).trace(settings, place);
}

}  // namespace limn
