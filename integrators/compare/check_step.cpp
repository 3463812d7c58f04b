// The step and the samples with which a gradient is checked, by pilots, and slopes on both sides of
// a parameter's value.
#include "integrators/compare/check_step.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "integrators/compare/edge_events.h"
#include "integrators/methods/move_rounding.h"
#include "limn/core/parameter.h"
#include "limn/integrators/differences.h"
#include "limn/integrators/statistics.h"

namespace limn {
namespace {

// Steps of a ladder from the largest one down, each kFactor times the one before. It must reach
// well below what moves in the image: where everything has moved away, no further change shows.
constexpr int kTrials = 9;
constexpr double kFactor = 4;
// The largest step of what moves, in natural ones: edges in differences have a variance that goes
// with 1 / step, and a natural step is less than a pixel in small images.
constexpr double kMovedSteps = 16;
constexpr int kLadders = 2;       // one below the other
constexpr int kPilotSamples = 8;  // per pixel, at least: variances need some
constexpr int kPilotPart = 8;     // of the samples of the run
// The bias of D_h that is allowed, in standard errors of the extrapolated differences, whose own
// bias is less. With 1/4 and with 1, none of 276 and 400 right gradients was accused, and p < 0.05
// came in 0.7 % of the runs (tests/statistical/check_levels.py).
constexpr double kAllowedBias = 1;
// Var(4 D_h - D_2h) / 9 over Var(D_h) for events at moving edges: those that h sees, 2h sees too.
constexpr double kExtrapolated = 12.5 / 9;

// The differences at every step of a ladder, and what changes from each to the next.
std::vector<std::vector<double>> steps_and_changes(size_t steps) {
  std::vector<std::vector<double>> combinations(2 * steps - 1, std::vector<double>(steps));
  for (size_t k = 0; k < steps; ++k) combinations[k][k] = 1;
  for (size_t k = 1; k < steps; ++k) {
    combinations[steps + k - 1][k] = 1;
    combinations[steps + k - 1][k - 1] = -1;
  }
  return combinations;
}

// What shows, in standard errors of the pilot: at the largest step and below steps where the bias
// shows; and elsewhere, where a few rare events may look like it. Not tuned.
constexpr double kShows = 2, kShowsAlone = 10;

// What a change between two steps shows of the bias of the larger one's differences.
struct Change {
  double whole;     // the bias over the change, if it grows with h^2
  double variance;  // of the change over that of the differences, for events at moving edges
};
constexpr Change kNextStep = {kFactor * kFactor / (kFactor * kFactor - 1), kFactor - 1};
// Of D_h minus the extrapolation: (D_2h - D_h) / 3, which is the bias of D_h.
constexpr Change kExtrapolation = {1, 0.5 / 9};

// The bias at a step in standard errors of a run of `samples`, as a mean over the values; 0 if it
// does not show, in so many standard errors of its own. event: mean size of one, for places where
// none has come.
double bias_ratio(const Moments& at_step, const Moments& changes, const Change& change,
                  double event, double samples, double shows) {
  const auto own_samples = static_cast<double>(at_step.samples());
  std::vector<double> noise(at_step.size());
  for (size_t i = 0; i < noise.size(); ++i) {
    noise[i] = std::max(at_step.variance(i), std::fabs(at_step.mean(i)) * event / own_samples);
  }
  // Places with hardly any noise are still seen through the noise of the others.
  const double least = 0.01 * mean_of(noise);
  double bias = 0, error = 0;
  int places = 0;
  for (size_t i = 0; i < noise.size(); ++i) {
    const double own = std::max(changes.variance(i), change.variance / 6 * noise[i]);
    const double scale =
        std::max({noise[i], least, own / change.variance}) * kExtrapolated * own_samples / samples;
    if (scale == 0) continue;
    bias += (changes.mean(i) * changes.mean(i) - own) / scale;
    error += 2 * (own / scale) * (own / scale);
    ++places;
  }
  if (bias <= shows * std::sqrt(error)) return 0;
  return change.whole * std::sqrt(bias / places);
}

Moments in_windows(const Windows& windows, const Moments& blocks) {
  Moments moments(windows.size());
  for (const Moments::Batch& batch : blocks.kept()) {
    moments.add_batch(windows.gather(batch.sums), batch.samples);
  }
  return moments;
}

Moments sum_of(const Moments& windows_or_blocks) {
  Moments moments(1);
  for (const Moments::Batch& batch : windows_or_blocks.kept()) {
    double sum = 0;
    for (const double v : batch.sums) sum += v;
    moments.add_batch({sum}, batch.samples);
  }
  return moments;
}

// The larger ratio of the windows and of the whole image.
double larger_ratio(const Windows& windows, const DifferenceEstimate& at_step,
                    const Moments& changes, const Change& change, double samples, double shows) {
  const double event = event_sizes(at_step.blocks.kept()).mean;
  return std::max(bias_ratio(in_windows(windows, at_step.blocks), in_windows(windows, changes),
                             change, event, samples, shows),
                  bias_ratio(at_step.image_sum, sum_of(changes), change, event, samples, shows));
}

// The bias grows with h^2, the standard error of edges with h^-1/2.
double step_for_ratio(double step, double ratio) {
  return step * std::pow(kAllowedBias / ratio, 0.4);
}

// The step that a ladder finds, and whether a lower ladder may know better.
struct Found {
  double step;
  bool below;
};

Found choose_step(const std::vector<DifferenceEstimate>& estimates,
                  const std::vector<double>& steps, const Windows& windows, double samples) {
  double step = steps.back();
  bool showed = true;
  for (size_t k = steps.size() - 1; k >= 1; --k) {
    const double ratio = larger_ratio(windows, estimates[k], estimates[steps.size() + k - 1].blocks,
                                      kNextStep, samples, showed ? kShows : kShowsAlone);
    showed = ratio > kAllowedBias;
    if (showed) step = step_for_ratio(steps[k], ratio);
  }
  return {std::max(step, steps[0] / kFactor), step < steps[0]};
}

// Differences take twice the step: neither may leave the parameter's range, where the natural one
// does not.
double largest_step(const Scene& scene, const Parameter& parameter) {
  if (!moved_by({&parameter, 1}).any()) return parameter.natural_step;
  double step = kMovedSteps * parameter.natural_step;
  for (const double now : parameter.value(scene)) {
    step = std::min({step, 0.5 * (now - parameter.least), 0.5 * (parameter.most - now)});
  }
  return std::max(step, parameter.natural_step);
}

// (I(reach) - I(0)) / reach in batches, with negative reach on the side before: a central
// difference around half the way. No batches if the run was interrupted.
std::vector<Moments::Batch> slope_of_blocks(const Scene& scene, const std::string& name,
                                            double reach, int block, const RunSettings& settings,
                                            const std::optional<Blur>& blur) {
  const Scene middle = find_parameter(scene, name).moved(scene, 0.5 * reach);
  const DifferenceJob job{find_parameter(middle, name), {0.5 * std::fabs(reach)}, {{1}}};
  const CentralDifferences run = central_differences(middle, {job}, block, settings, false, blur);
  if (run.spp < settings.spp) return {};
  return run.estimates[0][0].blocks.kept();
}

// With X(r) the slope over the way r after the value minus that over r before it, X is K + c r for
// small r where the image bends by K, and 2 X(r) - X(2 r) = K. All from the same samples. No
// batches if the run was interrupted.
std::vector<Moments::Batch> bend_of_blocks(const Scene& scene, const std::string& name, double step,
                                           int block, const RunSettings& settings,
                                           const std::optional<Blur>& blur) {
  std::vector<Moments::Batch> batches;
  RunSettings own = settings;
  int done = 0;
  if (settings.progress) {
    own.progress = [&](double part) { settings.progress(0.25 * (done + part)); };
  }
  for (const auto& [reach, factor] : {std::pair{step, 2.0}, {2 * step, -1.0}}) {
    for (const double side : {1.0, -1.0}) {
      auto more = slope_of_blocks(scene, name, side * reach, block, own, blur);
      if (more.empty() || (done > 0 && batches.size() != more.size())) return {};
      if (done++ == 0) {
        batches = more;
        for (Moments::Batch& batch : batches) batch.sums.assign(batch.sums.size(), 0.0);
      }
      for (size_t b = 0; b < batches.size(); ++b)
        for (size_t i = 0; i < batches[b].sums.size(); ++i)
          batches[b].sums[i] += side * factor * more[b].sums[i];
    }
  }
  return batches;
}

// A short run does not know its variances well: the next one takes so many times its time at most.
// Not tuned.
constexpr double kMostGrowth = 16;
// The error aimed at, over the one requested: variances are known to some ten per cent. Not tuned.
constexpr double kMargin = 0.85;
constexpr double kLeastShare = 0.125;  // of the time. Not tuned.
// With steps that shrink as n^-1/5 the variance of edges in differences goes with n^-4/5.
constexpr double kVariancePower = 1.25;

}  // namespace

double find_check_step(const Scene& scene, const std::string& parameter, const Windows& windows,
                       double most, const RunSettings& settings, const std::optional<Blur>& blur) {
  RunSettings pilot = settings;
  pilot.progress = nullptr;
  pilot.spp = std::max(kPilotSamples, settings.spp / kPilotPart);
  pilot.seed = settings.seed + 1;  // not the samples that the run will take
  const Parameter moved = find_parameter(scene, parameter);
  const double least = least_step(scene, moved);
  most = std::min(most, largest_step(scene, moved));
  double step = most, largest = step;
  for (int ladder = 0; ladder < kLadders; ++ladder) {
    DifferenceJob job{moved, {}, {}};
    for (int k = kTrials - 1; k >= 0; --k) {
      const double trial = largest * std::pow(kFactor, -k);
      if (trial >= least || k == 0) job.steps.push_back(trial);
    }
    job.combinations = steps_and_changes(job.steps.size());
    const CentralDifferences run =
        central_differences(scene, {job}, windows.fine(), pilot, false, blur);
    if (run.spp < 2) break;
    const Found found = choose_step(run.estimates[0], job.steps, windows, settings.spp);
    step = found.step;
    if (!found.below || found.step < least) break;
    largest = job.steps.front();
  }
  return power_of_two_below(std::min(std::max(step, 2 * least), most));
}

std::optional<Scene> with_texels_inside(const Scene& scene, const Parameter& parameter,
                                        double step) {
  const Image velocities = parameter.texel_velocities(scene);
  if (velocities.data.empty()) return std::nullopt;
  const TexelMap& map = *parameter.texel_map(scene);
  const TexelMap::Map range = map.map();
  Image texels = map.texels();
  bool any = false;
  for (size_t i = 0; i < velocities.data.size(); ++i) {
    const double reach = 2 * step * std::fabs(double{velocities.data[i]});
    if (reach == 0 || 2 * reach > range.most - range.least) continue;
    const double inside =
        std::clamp(double{texels.data[i]}, range.least + reach, range.most - reach);
    any = any || inside != texels.data[i];
    texels.data[i] = static_cast<float>(inside);
  }
  if (!any) return std::nullopt;
  Scene copy = parameter.moved(scene, 0);
  parameter.texel_map(copy)->set_texels(texels);
  return copy;
}

double reduced_step(const DifferenceResult& differences, double step, const Windows& windows) {
  const auto& at_step = differences.at_step.blocks.kept();
  const auto& extrapolated = differences.extrapolated.blocks.kept();
  Moments changes(differences.at_step.blocks.size(), true);
  for (size_t b = 0; b < at_step.size(); ++b) {
    std::vector<double> sums = at_step[b].sums;
    for (size_t i = 0; i < sums.size(); ++i) sums[i] -= extrapolated[b].sums[i];
    changes.add_batch(sums, at_step[b].samples);
  }
  const double ratio = larger_ratio(windows, differences.at_step, changes, kExtrapolation,
                                    static_cast<double>(differences.spp), kShows);
  return ratio > kAllowedBias ? power_of_two_below(step_for_ratio(step, ratio)) : step;
}

std::optional<Bend> find_bend(const Scene& scene, const std::string& name, double step,
                              const Windows& windows, const std::vector<double>& weights,
                              const RunSettings& settings, const std::optional<Blur>& blur) {
  const auto batches = bend_of_blocks(scene, name, step, windows.fine(), settings, blur);
  const std::vector<double> of_blocks = windows.spread(weights);
  Moments moments(1), single(windows.size());
  for (const Moments::Batch& batch : batches) {
    double sum = 0;
    for (size_t i = 0; i < of_blocks.size(); ++i) sum += of_blocks[i] * batch.sums[i];
    moments.add_batch({sum}, batch.samples);
    single.add_batch(windows.gather(batch.sums), batch.samples);
  }
  if (moments.batches() < 2) return std::nullopt;
  Bend bend;
  bend.sum.value = moments.mean(0);
  bend.sum.error = std::sqrt(moments.variance(0));
  if (bend.sum.value != 0)
    bend.sum.z = normal_from_student(bend.sum.value / bend.sum.error, moments.degrees());
  double variance = 0;
  for (size_t k = 0; k < weights.size(); ++k) {
    const double error = std::sqrt(single.variance(k));
    bend.most += std::fabs(weights[k]) * magnitude_without_noise(single.mean(k), error);
    variance += weights[k] * weights[k] * error * error;
  }
  bend.most_error = std::sqrt(variance);
  return bend;
}

// With variances a / n and b / m and costs n s + m t, the least cost for the sum of variances has
// n and m in proportion to sqrt(a / s) and sqrt(b / t).
std::optional<CheckSamples> more_samples(const CheckCost& gradient, const CheckCost& differences,
                                         double factor, double seconds) {
  const CheckCost* const runs[2] = {&gradient, &differences};
  double cost[2], spent[2], sum = 0, before = 0;
  for (int i = 0; i < 2; ++i) {
    const auto n = static_cast<double>(runs[i]->samples);
    cost[i] = std::max(runs[i]->seconds, 1e-9) / n;
    spent[i] = std::sqrt(runs[i]->variance * n * cost[i]);
    sum += spent[i];
    before += runs[i]->seconds;
  }
  const double most = std::min(seconds, kMostGrowth * before);
  if (most <= before || !(sum > 0)) return std::nullopt;
  for (double& part : spent) part = std::max(part, kLeastShare * sum);
  const double wanted =
      (gradient.variance + differences.variance) * std::pow(kMargin * factor, 2 * kVariancePower);
  const double scale = std::min(sum / wanted, most / (spent[0] + spent[1]));
  const auto samples = [&](int i) {
    return static_cast<int64_t>(std::clamp(scale * spent[i] / cost[i], double{kFirstCheckSamples},
                                           double{kMostCheckSamples}));
  };
  return CheckSamples{samples(0), samples(1)};
}

}  // namespace limn
