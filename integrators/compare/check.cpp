// A gradient against differences: scores of windows, image and terms, what they could have seen,
// and whom to suspect.
#include "limn/integrators/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "integrators/compare/check_bend.h"
#include "integrators/compare/check_scores.h"
#include "integrators/compare/check_step.h"
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
    const double p = std::min(1.0, -2 * std::expm1(n * std::log1p(-one)));
    // A NaN must not pass for agreement.
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

// The least part of an image (its means in the windows) that some probe finds.
double visible_part(const ProbeScores& places, const std::vector<double>& image, double degrees) {
  double visible = std::numeric_limits<double>::infinity();
  for (const ProbeScore& place : places.list) {
    double seen = 0;
    for (size_t k = 0; k < image.size(); ++k) {
      seen += 0.5 * (place.probe[0][k] + place.probe[1][k]) * image[k];
    }
    const double wanted = student_from_normal(place.limit, degrees) + kFound;
    if (seen != 0) visible = std::min(visible, wanted * place.score.error / std::fabs(seen));
  }
  return visible;
}

double magnitude(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += std::fabs(v);
  return sum;
}

void find_power(const ProbeScores& places, const Residual& residual, const GradientResult& run,
                CheckResult& result) {
  const ParameterGradient& g = run.parameters[0];
  result.power = {{"", 1, visible_part(places, residual.mean(g.total_blocks), residual.degrees())}};
  double sum = 0;
  for (size_t t = 0; t < run.terms.size(); ++t) {
    if (!run.terms[t].computed) continue;
    const std::vector<double> image = residual.mean(g.term_blocks[t]);
    result.power.push_back(
        {run.terms[t].name, magnitude(image), visible_part(places, image, residual.degrees())});
    sum += result.power.back().share;
  }
  double worst = 0;
  for (size_t i = 0; i < result.power.size(); ++i) {
    CheckPower& power = result.power[i];
    if (i > 0) power.share = sum > 0 ? power.share / sum : 0;
    if (sum > 0 && !power.negligible()) worst = std::max(worst, power.visible);
  }
  result.needed_spp =
      static_cast<double>(run.spp) * std::max(1.0, std::pow(worst / kCheckWanted, kSamplesPower));
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
      : scene_(scene), options_(options), settings_(settings), run_(run) {
    const int longer = std::max(scene.film.crop_width, scene.film.crop_height);
    block_ = options.block > 0
                 ? options.block
                 : std::max(kLeastSpacing, (longer + kWindowsAlong - 1) / kWindowsAlong);
    fine_ = std::max(1, block_ / kFineParts);
  }

  CheckResult check() {
    CheckResult result;
    const Windows windows(scene_.film, block_, fine_);
    result.block = block_;
    result.step = options_.step;
    if (result.step <= 0) {
      result.step = find_check_step(scene_, options_.parameter, windows, settings_);
    }
    Runs runs;
    runs.gradient = run_(scene_, gradient_options(), settings_of(settings_.spp, 0, 0));
    result.step = run_at_small_step(windows, result.step, runs);
    if (!complete(runs, settings_.spp)) return interrupted(std::move(runs), result);
    const Residual residual = residual_of(windows, runs, result.step);
    const ProbeScores places = score_places(residual, windows, runs.gradient);
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
    find_power(places, residual, runs.gradient, result);
    if (result.p < kCheckStageLevel) {
      if (!confirm(windows, found, runs, result)) return interrupted(std::move(runs), result);
    }
    if (result.confirmation && result.confirmation->p < kCheckStageLevel) {
      if (!result.bends) result.verdict = Verdict::kDisagree;
    } else if (result.needed_spp <= static_cast<double>(settings_.spp)) {
      result.verdict = runs.gradient.incomplete ? Verdict::kNotComplete : Verdict::kAgree;
    }
    result.gradient = std::move(runs.gradient);
    result.differences = std::move(runs.differences);
    return result;
  }

 private:
  GradientOptions gradient_options() const {
    GradientOptions gradient_options;
    gradient_options.parameters = {options_.parameter};
    gradient_options.terms = options_.terms;
    gradient_options.method = options_.method;
    gradient_options.block = fine_;
    gradient_options.samples = options_.samples;
    gradient_options.warp = options_.warp;
    gradient_options.exact_film = options_.exact_film;
    return gradient_options;
  }

  // Seeds of their own for every stage, and for gradient and differences.
  RunSettings settings_of(int64_t spp, int stage, int part) const {
    RunSettings settings = settings_;
    settings.spp = static_cast<int>(std::min<int64_t>(spp, 1 << 30));
    settings.seed = settings_.seed + static_cast<uint64_t>(stage) * 0xc0ffee +
                    static_cast<uint64_t>(part) * 0x5eed;
    if (settings_.progress) {
      settings.progress = [this, part](double done) {
        settings_.progress(0.5 * (std::min(part, 1) + done));
      };
    }
    return settings;
  }

  // Differences of the first run, at smaller steps until their bias is small; returns the step.
  double run_at_small_step(const Windows& windows, double step, Runs& runs) const {
    for (int reduced = 0;; ++reduced) {
      runs.differences = finite_differences(scene_, options_.parameter, step, fine_,
                                            settings_of(settings_.spp, 0, 1 + reduced));
      if (options_.step > 0 || reduced == kStepsReduced) return step;
      if (runs.differences.spp < settings_.spp) return step;
      const double smaller = reduced_step(runs.differences, step, windows);
      if (smaller == step) return step;
      step = smaller;
    }
  }

  static bool complete(const Runs& runs, int64_t spp) {
    return runs.gradient.spp >= spp && runs.differences.spp >= spp;
  }

  static CheckResult interrupted(Runs runs, CheckResult result) {
    result.interrupted = true;
    result.gradient = std::move(runs.gradient);
    result.differences = std::move(runs.differences);
    return result;
  }

  Residual residual_of(const Windows& windows, const Runs& runs, double step) const {
    const Film& film = scene_.film;
    const auto radiance =
        sum_blocks(means(runs.gradient.radiance), film.crop_width, film.crop_height, fine_);
    return {windows, runs.gradient, runs.differences.extrapolated, radiance, step};
  }

  // The second run, which takes the first one's place. False if it was interrupted.
  bool confirm(const Windows& windows, const ProbeScore& found, Runs& runs, CheckResult& result) {
    const double step = options_.step > 0 ? options_.step : 0.5 * result.step;
    const int64_t spp = 2 * static_cast<int64_t>(settings_.spp);
    NonFinite bad[2] = {runs.gradient.non_finite, runs.differences.non_finite};
    runs.gradient = run_(scene_, gradient_options(), settings_of(spp, 1, 0));
    runs.differences =
        finite_differences(scene_, options_.parameter, step, fine_, settings_of(spp, 1, 1));
    runs.gradient.non_finite.merge(bad[0]);
    runs.differences.non_finite.merge(bad[1]);
    if (!complete(runs, spp)) return false;
    const Residual residual = residual_of(windows, runs, step);
    // Weights from one half of the batches need not be kept from the other any more.
    Probe probe = found.probe;
    for (size_t k = 0; k < probe[0].size(); ++k) {
      probe[0][k] = probe[1][k] = 0.5 * (found.probe[0][k] + found.probe[1][k]);
    }
    const Score score = residual.score(probe);
    const double z = score.z;
    const bool same_side = z * found.score.z >= 0;
    const double half = 0.5 * normal_p_value(z);
    result.confirmation = {spp, step, same_side ? half : 1 - half};
    if (std::isnan(z)) result.confirmation->p = 0;
    if (result.confirmation->p >= kCheckStageLevel) return true;
    const auto bends = explained_by_bend(windows, probe, score, step, spp, runs.gradient.at_kink);
    if (!bends) return false;
    result.bends = *bends;
    if (!result.bends) suspect_terms(residual, runs, result);
    return true;
  }

  // Whether the image bends in the place of the probe, and by so much that half of it, by which a
  // slope of one side is off the mean of both, explains what the score found. A quarter of the
  // samples tells most cases. None if the run was interrupted.
  std::optional<bool> explained_by_bend(const Windows& windows, const Probe& probe,
                                        const Score& score, double step, int64_t spp,
                                        bool at_kink) const {
    const double surely = limit_of_level(kCheckLevel);
    for (const bool last : {false, true}) {
      const auto bend = find_bend(scene_, options_.parameter, step, windows, probe[0],
                                  settings_of(last ? spp : (spp + 3) / 4, 1, last ? 3 : 2));
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

  // Sets the suspicions, and the suspect among them, from the second run.
  void suspect_terms(const Residual& residual, const Runs& runs, CheckResult& result) const {
    const std::vector<TermRun>& terms = runs.gradient.terms;
    // A term that was left out may be the one that is missing.
    std::optional<GradientResult> others;
    double largest = -1;
    for (size_t t = 0; t < terms.size(); ++t) {
      if (!terms[t].computed && !others) others = other_terms(runs.gradient);
      const GradientResult& from = terms[t].computed ? runs.gradient : *others;
      const Suspicion suspicion = suspect(residual, from.parameters[0].term_blocks[t]);
      result.suspicions.push_back(suspicion);
      if (std::fabs(suspicion.z) > largest) {
        largest = std::fabs(suspicion.z);
        result.suspect = terms[t].name;
      }
    }
    // A defect that is no part of any term's image must not be blamed on the nearest.
    const double level = share_of_level(kCheckStageLevel, terms.size());
    if (normal_p_value(largest) >= level) result.suspect.clear();
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
  int block_ = 0, fine_ = 0;
};

}  // namespace

CheckResult check(const Scene& scene, const CheckOptions& options, const RunSettings& settings,
                  const GradientRun& run) {
  const Method& method = options.method;
  check_options(options);
  // Before the search for a step.
  check_task(method, Task::kGradient);
  if (method->check) method->check(scene);
  if (options.exact_film) check_exact_film(scene, method);
  check_warp(options.warp, {method});
  return Checker(scene, options, settings, run).check();
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
