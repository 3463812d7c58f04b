// A gradient against differences: scores of windows, image and terms, what they could have seen,
// and whom to suspect.
#include "limn/integrators/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "integrators/compare/check_scores.h"
#include "integrators/compare/check_step.h"
#include "integrators/terms/term.h"
#include "limn/core/blur_tracer.h"
#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/options.h"

namespace limn {
namespace {

constexpr int kWindowsAlong = 8;  // the longer side, but for small films
constexpr int kLeastSpacing = 4;  // pixels: a tent of fewer has steps that are too high
constexpr int kFineParts = 4;     // blocks along a window's spacing
constexpr int kStepsReduced = 3;  // times that a run may ask for a smaller step
// What is to be found must exceed what accuses by this many standard errors: 96 %, and the second
// run, whose errors are less, finds 99 % of it.
constexpr double kFound = 1.75;
// The noise goes with (n h)^-1/2 and the step with n^-1/5, so that the bias keeps below the noise.
constexpr double kSamplesPower = 2.5;

struct Runs {
  GradientResult gradient;
  DifferenceResult differences;
  double step = 0;
  double seconds = 0;  // of both, with set-up and the search for the step
};

// What accuses, and what its score must exceed.
struct ProbeScore {
  std::string name;
  Probe probe;
  Score score;
  double limit = 0;  // |z|
};

// All probes of one run. Half of the level is the windows', half that of the image and the terms.
struct ProbeScores {
  std::vector<ProbeScore> list;
  size_t windows = 0;  // the first of the list
  double p = 1;
  size_t smallest = 0;
};

// The |z| at which a two-sided test has this level.
double limit_of_level(double level) {
  double low = 0, high = 40;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (normal_p_value(middle) > level ? low : high) = middle;
  }
  return high;
}

// One of n tests, all of which together have the level.
double share_of_level(double level, size_t n) {
  return n == 0 ? level : -std::expm1(std::log1p(-level) / static_cast<double>(n));
}

bool is_zero(const Probe& probe) {
  const auto zero = [](double w) { return w == 0; };
  return std::all_of(probe[0].begin(), probe[0].end(), zero) &&
         std::all_of(probe[1].begin(), probe[1].end(), zero);
}

void judge(ProbeScores& places) {
  const size_t windows = places.windows, others = places.list.size() - windows;
  const double limits[2] = {
      limit_of_level(share_of_level(0.5 * kCheckStageLevel, windows)),
      limit_of_level(share_of_level(0.5 * kCheckStageLevel, others)),
  };
  for (size_t i = 0; i < places.list.size(); ++i) {
    ProbeScore& place = places.list[i];
    place.limit = limits[i < windows ? 0 : 1];
    const double one = normal_p_value(place.score.z);
    const double n = static_cast<double>(i < windows ? windows : others);
    // A NaN must not pass for agreement: min() returns it where it comes first.
    const double p = std::min(-2 * std::expm1(n * std::log1p(-one)), 1.0);
    if (p >= places.p) continue;
    places.p = std::isnan(p) ? 0 : p;
    places.smallest = i;
  }
}

ProbeScores score_places(const Residual& residual, const Windows& windows,
                         const GradientResult& run) {
  ProbeScores places;
  const auto scores = residual.window_scores();
  for (size_t k = 0; k < scores.size(); ++k) {
    if (scores[k].value == 0 && scores[k].error == 0) continue;
    Probe probe{std::vector<double>(windows.size()), {}};
    probe[0][k] = 1;
    probe[1] = probe[0];
    places.list.push_back({"a part of the image", probe, scores[k]});
  }
  places.windows = places.list.size();
  const std::vector<double> ones(windows.size(), 1.0);
  places.list.push_back({"the whole image", {ones, ones}, residual.score({ones, ones})});
  for (size_t t = 0; t < run.terms.size(); ++t) {
    if (!run.terms[t].computed) continue;
    const Probe probe = residual.term_probe(run.parameters[0].term_blocks[t]);
    if (is_zero(probe)) continue;
    places.list.push_back({"the " + run.terms[t].name + " term", probe, residual.score(probe)});
  }
  judge(places);
  return places;
}

// The least part of an image (its means in the windows) that some probe finds, and that probe.
struct VisiblePart {
  double part = std::numeric_limits<double>::infinity();
  const ProbeScore* place = nullptr;
};
VisiblePart visible_part(const ProbeScores& places, const std::vector<double>& image,
                         double degrees) {
  VisiblePart visible;
  for (const ProbeScore& place : places.list) {
    double seen = 0;
    for (size_t k = 0; k < image.size(); ++k) {
      seen += 0.5 * (place.probe[0][k] + place.probe[1][k]) * image[k];
    }
    const double wanted = student_from_normal(place.limit, degrees) + kFound;
    const double part = wanted * place.score.error / std::fabs(seen);
    if (seen != 0 && (part < visible.part || !visible.place)) visible = {part, &place};
  }
  return visible;
}

// Returns the score behind the error that shows least.
Score find_power(const ProbeScores& places, const Residual& residual, const GradientResult& run,
                 CheckResult& result) {
  const ParameterGradient& g = run.parameters[0];
  const ProbeScore& whole = places.list[places.windows];
  std::vector<const ProbeScore*> behind;
  double sum = 0;
  const auto add = [&](const std::string& name, const Moments& blocks) {
    const VisiblePart visible = visible_part(places, residual.mean(blocks), residual.degrees());
    result.power.push_back({name, residual.magnitude(blocks), visible.part});
    behind.push_back(visible.place ? visible.place : &whole);
  };
  result.power.clear();
  add("", g.total_blocks);
  for (size_t t = 0; t < run.terms.size(); ++t) {
    if (!run.terms[t].computed) continue;
    add(run.terms[t].name, g.term_blocks[t]);
    sum += result.power.back().share;
  }
  const ProbeScore* worst = &whole;
  for (size_t i = 0; i < result.power.size(); ++i) {
    double& share = result.power[i].share;
    share = sum > 0 ? share / sum : 0;
    if (result.power[i].of_whole() <= result.within) continue;
    result.within = result.power[i].of_whole();
    worst = behind[i];
  }
  // Where all is noise, or nothing at all.
  if (sum == 0) {
    const bool noisy = whole.score.value != 0 || whole.score.gradient_variance > 0;
    result.within = noisy ? std::numeric_limits<double>::infinity() : 0;
  }
  result.needed_spp = static_cast<double>(run.spp) *
                      std::max(1.0, std::pow(result.within / kCheckWanted, kSamplesPower));
  return worst->score;
}

TotalComparison compare_totals(const Moments& gradient, const Moments& differences,
                               const Score& score) {
  TotalComparison total;
  total.gradient = gradient.mean(0);
  total.difference = differences.mean(0);
  total.gradient_error = std::sqrt(gradient.variance(0));
  total.difference_error = std::sqrt(differences.variance(0));
  total.z = -score.z;
  return total;
}

WidenedErrors widened_errors(const ProbeScores& places) {
  WidenedErrors widened;
  const auto factor = [](const Score& score) { return score.error / score.batch_error; };
  for (size_t k = 0; k < places.windows; ++k) {
    const Score& score = places.list[k].score;
    if (!score.widened()) continue;
    ++widened.windows;
    widened.most = std::max(widened.most, factor(score));
  }
  const Score& total = places.list[places.windows].score;
  if (total.widened()) widened.total = factor(total);
  return widened;
}

class Checker {
 public:
  Checker(const Scene& scene, const CheckOptions& options, const RunSettings& settings,
          const GradientRun& run)
      : scene_(scene),
        options_(options),
        settings_(settings),
        run_(run),
        block_(options.block > 0 ? options.block : block_of(scene.film)),
        fine_(std::max(1, block_ / kFineParts)),
        windows_(scene.film, block_, fine_) {
    const Parameter parameter = find_parameter(scene, options.parameter);
    natural_step_ = parameter.natural_step;
    edges_move_ = moved_in(scene, {&parameter, 1}).any() || find_smooth(scene);
    if (options.method->blurs) blur_ = resolved(options.method->blurred_by(options.blur), scene);
  }

  CheckResult check() {
    const Stopwatch watch;
    const bool timed = settings_.seconds > 0;
    samples_ = timed ? CheckSamples{kFirstCheckSamples, kFirstCheckSamples}
                     : CheckSamples{settings_.spp, settings_.spp};
    Runs runs;
    for (;;) {
      CheckResult result;
      result.block = block_;
      if (!take(runs)) return interrupted(std::move(runs), result);
      const Residual residual = residual_of(runs);
      const ProbeScores places = score_places(residual, windows_, runs.gradient);
      const Score worst = find_power(places, residual, runs.gradient, result);
      if (timed && result.within > kCheckWanted) {
        if (const auto more = next_samples(runs, worst, result.within, watch.seconds())) {
          samples_ = *more;
          ++round_;
          continue;
        }
      }
      // Images need not be smooth over long steps: what these accuse is checked with shorter ones.
      if (options_.step <= 0 && places.p < kCheckStageLevel && runs.step > natural_step_) {
        most_ = natural_step_;
        continue;
      }
      return judged(places, std::move(runs), std::move(result));
    }
  }

 private:
  static int block_of(const Film& film) {
    const int longer = std::max(film.crop_width, film.crop_height);
    return std::max(kLeastSpacing, (longer + kWindowsAlong - 1) / kWindowsAlong);
  }

  GradientOptions gradient_options() const {
    GradientOptions gradient_options;
    gradient_options.parameters = {options_.parameter};
    gradient_options.terms = options_.terms;
    gradient_options.method = options_.method;
    gradient_options.block = fine_;
    gradient_options.samples = options_.samples;
    gradient_options.warp = options_.warp;
    if (blur_) gradient_options.blur = *blur_;
    return gradient_options;
  }

  // Seeds of their own for every stage, and for gradient and differences.
  RunSettings settings_of(int64_t spp, int stage, int part) const {
    RunSettings settings = settings_;
    settings.spp = static_cast<int>(std::min<int64_t>(spp, 1 << 30));
    settings.seconds = 0;
    settings.seed = settings_.seed + static_cast<uint64_t>(3 * round_ + stage) * 0xc0ffee +
                    static_cast<uint64_t>(part) * 0x5eed;
    if (settings_.seconds > 0) {
      settings.progress = nullptr;
    } else if (settings_.progress) {
      settings.progress = [this, part](double done) {
        settings_.progress(0.5 * (std::min(part, 1) + done));
      };
    }
    return settings;
  }

  // Those of the next round, if there is time for one.
  std::optional<CheckSamples> next_samples(const Runs& runs, const Score& worst, double within,
                                           double elapsed) const {
    const double own = runs.gradient.seconds - runs.gradient.setup_seconds;
    // The search for the step takes as long as half of the differences, and runs at smaller steps
    // are few.
    const double theirs = 1.5 * (runs.differences.seconds - runs.differences.setup_seconds);
    const double set_up = std::max(0.0, runs.seconds - own - theirs);
    return more_samples({runs.gradient.spp, own, worst.gradient_variance},
                        {runs.differences.spp, theirs, worst.difference_variance},
                        kCheckWanted / within, settings_.seconds - elapsed - set_up);
  }

  // Both runs of a round, or the differences with shorter steps alone. False if interrupted.
  bool take(Runs& runs) {
    const Stopwatch watch;
    if (gradient_round_ != round_) {
      runs.gradient = run_(scene_, gradient_options(), settings_of(samples_.gradient, 0, 0));
      gradient_round_ = round_;
    }
    runs.step = options_.step;
    if (runs.step <= 0) {
      // A longer run's step is no larger but by chance.
      const double most = round_ == 0 ? most_ : std::min(most_, 4 * last_step_);
      runs.step = find_check_step(scene_, options_.parameter, windows_, most,
                                  settings_of(samples_.differences, 0, 0), blur_);
    }
    run_at_small_step(runs);
    runs.seconds = watch.seconds();
    last_step_ = runs.step;
    return complete(runs, samples_);
  }

  // Differences of a round's first run, at smaller steps until their bias is small.
  void run_at_small_step(Runs& runs) const {
    const int64_t spp = samples_.differences;
    for (int reduced = 0;; ++reduced) {
      runs.differences = finite_differences(scene_, options_.parameter, runs.step, fine_,
                                            settings_of(spp, 0, 1 + reduced), blur_);
      if (options_.step > 0 || reduced == kStepsReduced || runs.differences.spp < spp) return;
      const double smaller = reduced_step(runs.differences, runs.step, windows_);
      if (smaller == runs.step) return;
      runs.step = smaller;
    }
  }

  static bool complete(const Runs& runs, const CheckSamples& samples) {
    return runs.gradient.spp >= samples.gradient && runs.differences.spp >= samples.differences;
  }

  CheckResult judged(const ProbeScores& places, Runs runs, CheckResult result) const {
    result.step = runs.step;
    result.spp = runs.gradient.spp;
    result.difference_spp = runs.differences.spp;
    std::vector<double> z;
    for (size_t k = 0; k < places.windows; ++k) z.push_back(-places.list[k].score.z);
    result.windows = summarize(z);
    result.total =
        compare_totals(runs.gradient.parameters[0].image_sum,
                       runs.differences.extrapolated.image_sum, places.list[places.windows].score);
    result.widened = widened_errors(places);
    result.p = places.p;
    const ProbeScore& found = places.list[places.smallest];
    result.found = found.name;
    if (result.p < kCheckStageLevel) {
      if (!confirm(found, runs, result)) return interrupted(std::move(runs), result);
    }
    if (result.confirmation && result.confirmation->p < kCheckStageLevel) {
      if (!result.bends) result.verdict = Verdict::kDisagree;
    } else if (result.within <= kCheckWanted) {
      result.verdict = runs.gradient.incomplete ? Verdict::kNotComplete : Verdict::kAgree;
    }
    result.gradient = std::move(runs.gradient);
    result.differences = std::move(runs.differences);
    return result;
  }

  static CheckResult interrupted(Runs runs, CheckResult result) {
    result.interrupted = true;
    result.gradient = std::move(runs.gradient);
    result.differences = std::move(runs.differences);
    return result;
  }

  Residual residual_of(const Runs& runs) const {
    const Moments& radiance = runs.gradient.radiance;
    const auto blocks = [&](const std::vector<double>& image) {
      return sum_blocks(image, scene_.film.crop_width, scene_.film.crop_height, fine_);
    };
    std::vector<double> magnitudes = means(radiance), largest;
    const std::vector<double> sums = blocks(magnitudes);
    if (edges_move_) {
      // In blocks where differences have met events, as a pixel's light. Elsewhere, where m is the
      // mean and q the mean square of a sample, those that are not black, few as they may be, are
      // q / |m| large (filters may be negative): of three channels at once. In a block that got no
      // light they may be as large as elsewhere on the film.
      std::vector<double> squares = variances(radiance);
      for (size_t i = 0; i < squares.size(); ++i) {
        squares[i] = squares[i] * radiance.samples() + magnitudes[i] * magnitudes[i];
        magnitudes[i] = std::fabs(magnitudes[i]);
      }
      largest = blocks(squares);
      const std::vector<double> shares = blocks(magnitudes);
      const double share = mean_of(shares);
      const double elsewhere = share > 0 ? mean_of(largest) / share : 0;
      const Moments& met = runs.differences.extrapolated.blocks;
      const double pixels = static_cast<double>(fine_) * fine_;
      for (size_t i = 0; i < largest.size(); ++i) {
        const double unmet = 3 * (shares[i] > 0 ? largest[i] / shares[i] : elsewhere);
        largest[i] = met.variance(i) > 0 ? sums[i] / pixels : unmet;
      }
    }
    return {windows_, runs.gradient, runs.differences.extrapolated, sums, largest, runs.step};
  }

  // The second run, which takes the first one's place. False if it was interrupted.
  bool confirm(const ProbeScore& found, Runs& runs, CheckResult& result) const {
    if (options_.step <= 0) runs.step *= 0.5;
    const CheckSamples twice{2 * samples_.gradient, 2 * samples_.differences};
    const int64_t spp = twice.gradient;
    NonFinite bad[2] = {runs.gradient.non_finite, runs.differences.non_finite};
    runs.gradient = run_(scene_, gradient_options(), settings_of(spp, 1, 0));
    runs.differences = finite_differences(scene_, options_.parameter, runs.step, fine_,
                                          settings_of(twice.differences, 1, 1), blur_);
    runs.gradient.non_finite.merge(bad[0]);
    runs.differences.non_finite.merge(bad[1]);
    if (!complete(runs, twice)) return false;
    const Residual residual = residual_of(runs);
    // Weights from one half of the batches need not be kept from the other any more.
    Probe probe = found.probe;
    for (size_t k = 0; k < probe[0].size(); ++k) {
      probe[0][k] = probe[1][k] = 0.5 * (found.probe[0][k] + found.probe[1][k]);
    }
    const Score score = residual.score(probe);
    const double z = score.z;
    const bool same_side = z * found.score.z >= 0;
    const double half = 0.5 * normal_p_value(z);
    result.confirmation = {spp, runs.step, same_side ? half : 1 - half};
    if (std::isnan(z)) result.confirmation->p = 0;
    if (result.confirmation->p >= kCheckStageLevel) return true;
    const auto bends = explained_by_bend(probe, score, runs, twice.differences);
    if (!bends) return false;
    result.bends = *bends;
    if (!result.bends) suspect_terms(residual, runs, result);
    return true;
  }

  // Whether the image bends in the place of the probe, and by so much that half of it, by which a
  // slope of one side is off the mean of both, explains what the score found. A quarter of the
  // samples tells most cases. None if the run was interrupted.
  std::optional<bool> explained_by_bend(const Probe& probe, const Score& score, const Runs& runs,
                                        int64_t spp) const {
    const bool at_kink = runs.gradient.at_kink;
    const double surely = limit_of_level(kCheckLevel);
    for (const bool last : {false, true}) {
      const auto bend = find_bend(scene_, options_.parameter, runs.step, windows_, probe[0],
                                  settings_of(last ? spp : (spp + 3) / 4, 1, last ? 3 : 2), blur_);
      if (!bend) return std::nullopt;
      const auto explains = [&](double most, double error) {
        const double excess = std::fabs(score.value) - 0.5 * most;
        return normal_p_value(std::max(0.0, excess / error)) >= kCheckStageLevel;
      };
      const Score& sum = bend->sum;
      const bool explained =
          explains(std::fabs(sum.value), std::hypot(score.error, 0.5 * sum.error));
      // What is no bend passes for one, and so forgives an error, with the level of the check.
      if (explained && std::fabs(sum.z) >= surely) return true;
      double most = std::fabs(sum.value) + surely * sum.error;
      if (at_kink) most = std::max(most, bend->most + surely * bend->most_error);
      if (!explains(most, score.error)) return false;
    }
    // Where there is a kink, it need not be shown again, but must not be too small.
    return at_kink;
  }

  // Sets the suspicions, and the suspects among them, from the second run.
  void suspect_terms(const Residual& residual, const Runs& runs, CheckResult& result) const {
    const std::vector<TermRun>& terms = runs.gradient.terms;
    // A term that was left out may be the one that is missing.
    std::optional<GradientResult> others;
    for (size_t t = 0; t < terms.size(); ++t) {
      if (!terms[t].computed && !others) others = other_terms(runs.gradient);
      const GradientResult& from = terms[t].computed ? runs.gradient : *others;
      const Suspicion suspicion = suspect(residual, from.parameters[0].term_blocks[t]);
      result.suspicions.push_back(suspicion);
    }
    std::vector<size_t> order(terms.size());
    std::iota(order.begin(), order.end(), size_t{0});
    const auto squared = [&](size_t t) { return result.suspicions[t].z * result.suspicions[t].z; };
    std::ranges::stable_sort(order, std::greater{}, squared);
    // A defect that is no part of any term's image must not be blamed on the nearest.
    const double level = share_of_level(kCheckStageLevel, terms.size());
    if (normal_p_value(std::sqrt(squared(order[0]))) >= level) return;
    for (const size_t t : order) {
      if (squared(order[0]) - squared(t) > 2 * std::log(20)) break;
      result.suspects.push_back(terms[t].name);
    }
  }

  static Suspicion suspect(const Residual& residual, const Moments& term) {
    const Probe probe = residual.term_probe(term);
    const std::vector<double> image = residual.mean(term);
    double whole = 0;
    for (size_t k = 0; k < image.size(); ++k) {
      whole += 0.5 * (probe[0][k] + probe[1][k]) * image[k];
    }
    if (whole == 0) return {};
    const Score score = residual.score(probe);
    return {score.value / whole, score.z};
  }

  GradientResult other_terms(const GradientResult& result) const {
    GradientOptions options = gradient_options();
    options.terms.clear();
    for (const TermRun& term : result.terms) {
      if (!term.computed) options.terms.push_back(term.name);
    }
    RunSettings settings = settings_of(result.spp, 2, 0);
    settings.progress = nullptr;
    return gradient(scene_, options, settings);
  }

  const Scene& scene_;
  const CheckOptions& options_;
  const RunSettings& settings_;
  const GradientRun& run_;
  int block_, fine_;
  Windows windows_;
  bool edges_move_ = true;
  CheckSamples samples_;
  int round_ = 0, gradient_round_ = -1;
  double natural_step_ = 0, last_step_ = 0;
  double most_ = std::numeric_limits<double>::infinity();  // of steps
  std::optional<Blur> blur_;                               // none: images are sharp
};

}  // namespace

CheckResult check(const Scene& scene, const CheckOptions& options, const RunSettings& settings,
                  const GradientRun& run) {
  const Method& method = options.method;
  check_options(options);
  if (settings.seconds == 0 && settings.spp > kMostCheckSamples) {
    throw FieldError("spp",
                     fmt::format("a check takes {} at most: its second run takes twice as many",
                                 kMostCheckSamples));
  }
  // Before the search for a step.
  check_task(method, Task::kGradient);
  refuse_differences(method);
  if (method->check) method->check(scene);
  check_warp(options.warp, {method});
  check_blur(options.blur, {method});
  const Parameter parameter = find_parameter(scene, options.parameter);
  const double step = std::max(options.step, parameter.natural_step);
  const std::optional<Scene> inside = with_texels_inside(scene, parameter, step);
  CheckResult result = Checker(inside ? *inside : scene, options, settings, run).check();
  if (inside) {
    result.gradient.warnings.push_back(options.parameter +
                                       ": texels at the ends of their range are checked inside it");
  }
  return result;
}

const char* verdict_name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kAgree:
      return "agree";
    case Verdict::kDisagree:
      return "disagree";
    case Verdict::kNotComplete:
      return "not complete";
    case Verdict::kCannotTell:
      break;
  }
  return "cannot tell";
}

}  // namespace limn
