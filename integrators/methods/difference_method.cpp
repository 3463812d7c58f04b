// Finite differences as a method: one step for each parameter, the user's or the one that a pilot
// finds.
#include "integrators/methods/difference_method.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "integrators/methods/method_table.h"
#include "integrators/methods/move_rounding.h"
#include "limn/core/parameter.h"
#include "limn/integrators/differences.h"
#include "limn/integrators/statistics.h"

namespace limn {
namespace {

constexpr double kPilotShare = 0.1;  // of a run's time or samples; not tuned
constexpr int kPilotSamples = 4;     // per pixel, at least: variances need some
// The steps that the pilot tries: down from the natural one, which is for pictures that change a
// lot. Not tuned.
constexpr int kTrials = kPilotImages / 2;
constexpr double kFactor = 4;
// The share of its way by which rounding may change what moves. Not tuned.
constexpr double kMostRounding = 1.0 / 64;

using Step = DifferencePlan::Step;

double mean_variance(const Moments& moments) { return mean_of(variances(moments)); }

struct Change {
  double squared, error;  // as in StepTrial
};

// Pixels are taken for independent.
Change squared_change(const Moments& change) {
  double sum = 0, squares = 0, own = 0;
  const auto pixels = static_cast<double>(change.size()) / 3;
  for (size_t i = 0; i + 2 < change.size(); i += 3) {
    double of_pixel = 0, variance = 0;
    for (size_t c = i; c < i + 3; ++c) {
      of_pixel += (change.mean(c) * change.mean(c) - change.variance(c)) / 3;
      variance += change.variance(c) / 3;
    }
    sum += of_pixel;
    squares += of_pixel * of_pixel;
    own += 2 * variance * (variance + 2 * std::max(of_pixel, 0.0));
  }
  // At least that of normal variables, which is all of one pixel.
  const double mean = sum / pixels;
  const double between = std::max(squares / pixels - mean * mean, 0.0) / pixels;
  return {mean, std::sqrt(std::max(between, own / (pixels * pixels)))};
}

// The differences at every step, and what changes from each to the next.
std::vector<std::vector<double>> steps_and_changes(size_t steps) {
  std::vector<std::vector<double>> combinations(2 * steps - 1, std::vector<double>(steps));
  for (size_t k = 0; k < steps; ++k) combinations[k][k] = 1;
  for (size_t k = 0; k + 1 < steps; ++k) {
    combinations[steps + k][k] = -1;
    combinations[steps + k][k + 1] = 1;
  }
  return combinations;
}

// The steps that the pilot tries: rounding changes what they move by kMostRounding at most.
std::vector<double> steps_to_try(const Scene& scene, const Parameter& parameter) {
  std::vector<double> steps;
  for (int k = kTrials - 1; k >= 0; --k) {
    const double step = parameter.natural_step * std::pow(kFactor, -k);
    if (rounding_of_moves(scene, parameter, step) <= kMostRounding) steps.push_back(step);
  }
  return steps;
}

// Looks for a step for one parameter out of `parameters`, which share the time, or the rays. Its
// seconds are added to `seconds`.
Step find_step(const Scene& scene, const Parameter& parameter, size_t parameters, double rays,
               const RunSettings& run, double& seconds) {
  RunSettings settings = run;
  settings.progress = nullptr;
  settings.store = nullptr;
  settings.seconds = kPilotShare * run.seconds / parameters;
  // Without a limit of time, pilot and run differ by their samples.
  if (run.seconds == 0) {
    settings.spp = std::max(kPilotSamples, static_cast<int>(kPilotShare * run.spp));
  }
  settings.least_spp = kPilotSamples;
  settings.seed = run.seed + 1;  // not the samples that the run will take
  DifferenceJob job{parameter, steps_to_try(scene, parameter), {}};
  const size_t count = job.steps.size();
  if (count < 2) return {{resolved_step(scene, parameter)}, "what floats resolve"};
  job.combinations = steps_and_changes(count);
  const CentralDifferences r = central_differences(scene, {job}, 0, settings, true);
  seconds += r.seconds;
  if (r.spp < kPilotSamples) return {{parameter.natural_step}, "interrupted"};
  std::vector<StepTrial> trials;
  for (size_t k = 0; k < count; ++k) {
    const size_t next = count + std::max<size_t>(k, 1) - 1;
    const Change change = squared_change(r.estimates[0][next].total);
    trials.push_back({job.steps[k],
                      mean_variance(r.estimates[0][k].total) * static_cast<double>(r.spp),
                      change.squared, change.error});
  }
  extrapolate_variances(trials);
  // A run makes two images a sample and parameter, the pilot two for every step.
  const auto steps = static_cast<double>(count);
  const double per_second =
      steps * static_cast<double>(r.spp) / std::max(r.seconds - r.setup_seconds, 1e-9);
  const double left = (run.seconds - r.setup_seconds / steps) / parameters - r.seconds;
  double samples =
      run.seconds > 0 ? samples_behind_pilot(per_second, left, run.least_spp) : run.spp;
  if (rays > 0) {
    const double each = static_cast<double>(r.cost.rays) / (steps * static_cast<double>(r.spp));
    samples =
        std::max<double>(std::floor(rays / (each * static_cast<double>(parameters))), run.spp);
  }
  return {
      best_step(trials, samples),
      fmt::format("a pilot of {} spp at {} steps from {:.3g} to {:.3g}: least sum of squared bias "
                  "and variance for a run of {:.3g} spp",
                  r.spp, count, job.steps.front(), job.steps.back(), samples),
      samples};
}

void warn_of_rounding(const Scene& scene, const Parameter& parameter, double step,
                      std::vector<std::string>& warnings) {
  const double rounding = rounding_of_moves(scene, parameter, step);
  if (rounding <= kMostRounding) return;
  warnings.push_back(fmt::format(
      "finite differences of \"{}\" may be off by {:.2g} %: what a step of {:.3g} moves is rounded "
      "to float; a larger step, or a scene closer to the origin, lowers it",
      parameter.name, 100 * rounding, step));
}

ParameterGradient to_gradient(const std::string& name, DifferenceEstimate& estimate) {
  ParameterGradient g;
  g.name = name;
  g.terms = {estimate.total};
  g.total = std::move(estimate.total);
  if (estimate.blocks.size() > 0) g.term_blocks = {estimate.blocks};
  g.total_blocks = std::move(estimate.blocks);
  g.image_sum = std::move(estimate.image_sum);
  return g;
}

}  // namespace

DifferencePlan plan_differences(const Scene& scene, const GradientOptions& options,
                                const RunSettings& settings, double rays) {
  DifferencePlan plan;
  const std::vector<Parameter> parameters = parameters_of(scene, options);
  for (const Parameter& parameter : parameters) {
    plan.steps.push_back(options.step > 0 ? Step{{options.step}, "the user"}
                                          : find_step(scene, parameter, parameters.size(), rays,
                                                      settings, plan.seconds));
  }
  return plan;
}

GradientResult run_differences(const MethodType& method, const Scene& scene,
                               const GradientOptions& options, const RunSettings& settings) {
  const Stopwatch watch;
  const DifferencePlan plan = plan_differences(scene, options, settings);
  return run_planned(method.terms[0], scene, options, settings, plan, watch);
}

GradientResult run_planned(const std::string& term, const Scene& scene,
                           const GradientOptions& options, const RunSettings& settings,
                           const DifferencePlan& plan, const Stopwatch& watch) {
  std::vector<DifferenceJob> jobs;
  GradientResult result;
  const std::vector<Parameter> parameters = parameters_of(scene, options);
  for (size_t k = 0; k < plan.steps.size(); ++k) {
    const Parameter& parameter = parameters[k];
    const auto& [forecast, found_by, samples] = plan.steps[k];
    jobs.push_back({parameter, {forecast.step}, {{1}}});
    warn_of_rounding(scene, parameter, forecast.step, result.warnings);
    const std::string of = plan.steps.size() > 1 ? " of " + parameter.name : "";
    result.settings.push_back({"step" + of, forecast.step});
    result.settings.push_back({"step" + of + " found by", found_by});
    if (samples > 0) {
      result.settings.push_back(
          {"bias" + of + " (root mean square), at most", std::sqrt(forecast.most_squared_bias)});
    }
  }
  RunSettings rest = settings;
  if (settings.seconds > 0) {
    rest.seconds = std::max(settings.seconds - watch.seconds(), kPilotShare * settings.seconds);
  }
  CentralDifferences run = central_differences(scene, jobs, options.block, rest, true);
  for (size_t k = 0; k < jobs.size(); ++k) {
    result.parameters.push_back(to_gradient(jobs[k].parameter.name, run.estimates[k][0]));
  }
  result.radiance = std::move(run.radiance);
  result.terms = {{term, true, true, 1, {}, run.cost}};
  result.spp = run.spp;
  result.seconds = watch.seconds();
  result.setup_seconds = run.setup_seconds + plan.seconds;
  result.stats.setup = {{"pilot", plan.seconds}, {"moved scenes", run.setup_seconds}};
  result.non_finite = std::move(run.non_finite);
  return result;
}

double samples_behind_pilot(double per_second, double left, int least) {
  return std::max(per_second * left, static_cast<double>(least));
}

void extrapolate_variances(std::span<StepTrial> trials) {
  for (size_t k = trials.size() - 1; k-- > 0;) {
    const double factor = trials[k + 1].step / trials[k].step;
    const double own = trials[k].variance, next = trials[k + 1].variance;
    // Variance that only the larger step met is that of edges, and grows as 1 / h.
    trials[k].variance = own + factor * std::max(0.0, next - own);
    if (k + 2 == trials.size() || !(trials[k + 2].variance > 0)) continue;
    // Noise that is not common to the two images has a variance of 1 / h^2, and none has more.
    const double growth = std::clamp(next / trials[k + 2].variance, 1.0, factor * factor);
    trials[k].variance = std::max(trials[k].variance, next * growth);
  }
}

namespace {

// The squared bias at every step by its own change, less and with its standard error:
// b (h^2 - (h / factor)^2) changes, b h^2 is the bias.
struct OwnBiases {
  std::vector<double> least, most;
};
OwnBiases own_biases(std::span<const StepTrial> trials, double square) {
  OwnBiases own;
  for (size_t k = 0; k < trials.size(); ++k) {
    const StepTrial& trial = trials[std::max<size_t>(k, 1)];
    const double change = std::max(0.0, trial.squared_change);
    const double scale = square / (square - 1) / (k == 0 ? square : 1);
    const double found = k > 0 ? change - trial.change_error : 0;
    own.least.push_back(std::max(found, 0.0) * scale * scale);
    own.most.push_back((change + trial.change_error) * scale * scale);
  }
  return own;
}

// The most that a step can be biased: no larger step's bias is smaller, and below the next trial
// the squared bias falls with h at least.
double most_squared_bias(std::span<const StepTrial> trials, const std::vector<double>& most,
                         double step) {
  double least = std::numeric_limits<double>::infinity();
  for (size_t k = 0; k < trials.size(); ++k) {
    if (trials[k].step < 0.999 * step) continue;
    const bool next = least == std::numeric_limits<double>::infinity();
    least = std::min(least, most[k] * (next ? step / trials[k].step : 1));
  }
  return least;
}

}  // namespace

StepForecast best_step(std::span<const StepTrial> trials, double samples) {
  const double factor = trials[1].step / trials[0].step, square = factor * factor;
  OwnBiases own = own_biases(trials, square);
  // Steps beyond what moves change the image no further: what a smaller one shows is there.
  const auto is_found = [&](size_t k) {
    return trials[k].squared_change > 2 * trials[k].change_error;
  };
  for (size_t k = 1; k < trials.size(); ++k) {
    own.least[k] = std::max(is_found(k) ? own.least[k] : 0.0, own.least[k - 1]);
    own.most[k] = std::max(own.most[k], own.least[k]);
  }
  std::vector<double> biases = own.most, errors;  // squared
  // Edges on the film that cross the borders of pixels within the step bias their derivatives as a
  // whole: then the mean of the squares falls with h, and no slower; else with h^2 at least.
  double fall = square;
  for (size_t k = trials.size() - 1; k-- > 0;) {
    const double ratio = trials[k + 1].squared_change / trials[k].squared_change;
    if (k > 0 && is_found(k) && is_found(k + 1)) fall = std::clamp(ratio, factor, square);
    const double fallen = biases[k + 1] / fall;
    biases[k] = std::min(biases[k], std::max(fallen, own.least[k]));
  }
  for (size_t k = 0; k < trials.size(); ++k)
    errors.push_back(biases[k] + trials[k].variance / std::max(1.0, samples));
  const auto least = std::min_element(errors.begin(), errors.end());
  const auto k = static_cast<size_t>(least - errors.begin());
  const double noise = errors[k] - biases[k];
  // With x the step over trial k's: minimum of bias x^4 + noise x^-power.
  const auto forecast_at = [&](double x, double power) {
    const double step = x * trials[k].step;
    return StepForecast{step, biases[k] * std::pow(x, 4), noise * std::pow(x, -power),
                        most_squared_bias(trials, own.most, step)};
  };
  if (k == 0 || k + 1 == trials.size()) return forecast_at(1, 0);
  const double bias = biases[k] > 0 ? biases[k] : biases[k + 1] / (square * square);
  const double power = std::log(trials[k - 1].variance / trials[k + 1].variance) / std::log(square);
  if (!(bias > 0 && power > 0)) return forecast_at(1, 0);
  const double x = std::pow(power * noise / (4 * bias), 1 / (4 + power));
  return forecast_at(std::clamp(x, 1 / factor, factor), power);
}

}  // namespace limn
