#include "integrators/methods/difference_method.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "integrators/compare/method_images.h"
#include "limn/core/parameter.h"
#include "limn/integrators/render.h"

namespace limn {
namespace {

constexpr double kPilotShare = 0.1;  // of the time of a run
constexpr int kPilotSamples = 4;     // per pixel, at least
// The steps that the pilot tries: down from the natural one, which is for pictures that change a
// lot.
constexpr int kTrials = 5;
constexpr double kFactor = 4;

struct Pilot {
  double step = 0;
  double seconds = 0;
  std::string how;
};

double mean_variance(const Moments& moments) { return mean_of(variances(moments)); }

class DifferenceMethod final : public DerivativeMethod {
 public:
  explicit DifferenceMethod(const MethodInput& input)
      : input_(input), natural_(find_parameter(input.scene, input.parameter).natural_step) {}

  std::string name() const override { return kDifferences; }
  std::string description() const override {
    return "central finite differences with common random numbers";
  }

  MethodRun run(const RunSettings& settings) override {
    const Pilot& pilot = pilot_for(settings);
    RunSettings rest = settings;
    rest.seconds = std::max(settings.seconds - pilot.seconds, kPilotShare * settings.seconds);
    step_ = pilot.step;
    how_ = pilot.how;
    const CentralDifferences result = central_differences(input_.scene, input_.parameter,
                                                          {pilot.step}, {{1}}, input_.block, rest);
    MethodRun run;
    run.image = means(result.estimates[0].total);
    run.blocks = block_sums(result.estimates[0].blocks, result.estimates[0].events);
    run.seconds = result.seconds + pilot.seconds;
    run.setup_seconds = result.setup_seconds + pilot.seconds;
    run.spp = result.spp;
    run.rays = result.rays;
    run.non_finite = result.non_finite;
    return run;
  }

  std::vector<MethodSetting> settings() const override {
    return {{"step", step_}, {"step_found_by", how_}};
  }

 private:
  // One pilot for all runs of the same time; each run is charged for it.
  const Pilot& pilot_for(const RunSettings& settings) {
    const auto [place, is_new] = pilots_.try_emplace(settings.seconds);
    if (is_new) place->second = input_.step > 0 ? Pilot{input_.step, 0, "--step"} : find(settings);
    return place->second;
  }

  Pilot find(const RunSettings& run) const {
    RunSettings settings = run;
    settings.seconds = kPilotShare * run.seconds;
    settings.progress = nullptr;
    settings.least_spp = kPilotSamples;
    settings.seed = run.seed + 1;  // not the samples that the run will take
    std::vector<double> steps;
    for (int k = kTrials - 1; k >= 0; --k) steps.push_back(natural_ * std::pow(kFactor, -k));
    const CentralDifferences r = central_differences(input_.scene, input_.parameter, steps,
                                                     steps_and_changes(), input_.block, settings);
    if (r.spp < kPilotSamples) return {natural_, r.seconds, "interrupted"};
    std::vector<StepTrial> trials;
    for (int k = 0; k < kTrials; ++k) {
      const Moments& change = r.estimates[kTrials + std::max(k - 1, 0)].total;
      trials.push_back({steps[k], mean_variance(r.estimates[k].total) * static_cast<double>(r.spp),
                        mean_square(means(change)) - mean_variance(change)});
    }
    // A run makes two images a sample, the pilot 2 kTrials.
    const double samples_per_second =
        kTrials * static_cast<double>(r.spp) / std::max(r.seconds - r.setup_seconds, 1e-9);
    const double left = run.seconds - r.seconds - r.setup_seconds / kTrials;
    return {best_step(trials, samples_per_second * left), r.seconds,
            fmt::format("a pilot of {} samples per pixel at {} steps from {:.3g} to {:.3g}: least "
                        "sum of squared bias and variance for a run of {:.3g} s",
                        r.spp, kTrials, steps.front(), steps.back(), run.seconds)};
  }

  // The differences at every step, and what changes from each to the next.
  static std::vector<std::vector<double>> steps_and_changes() {
    std::vector<std::vector<double>> combinations(2 * kTrials - 1, std::vector<double>(kTrials));
    for (int k = 0; k < kTrials; ++k) combinations[k][k] = 1;
    for (int k = 0; k + 1 < kTrials; ++k) {
      combinations[kTrials + k][k] = -1;
      combinations[kTrials + k][k + 1] = 1;
    }
    return combinations;
  }

  const MethodInput& input_;
  double natural_;
  std::map<double, Pilot> pilots_;
  double step_ = 0;
  std::string how_;
};

}  // namespace

double best_step(std::span<const StepTrial> trials, double samples) {
  const double factor = trials[1].step / trials[0].step, square = factor * factor;
  std::vector<double> biases, errors;  // squared
  for (size_t k = 0; k < trials.size(); ++k) {
    // b (h^2 - (h / factor)^2) changes, b h^2 is the bias.
    const double change = std::max(0.0, trials[std::max<size_t>(k, 1)].squared_change);
    const double scale = square / (square - 1) / (k == 0 ? square : 1);
    biases.push_back(change * scale * scale);
    errors.push_back(biases[k] + trials[k].variance / std::max(1.0, samples));
  }
  const auto least = std::min_element(errors.begin(), errors.end());
  const auto k = static_cast<size_t>(least - errors.begin());
  if (k == 0 || k + 1 == trials.size()) return trials[k].step;
  // With x the step over trial k's: minimum of bias x^4 + noise x^-power.
  const double bias = biases[k] > 0 ? biases[k] : biases[k + 1] / (square * square);
  const double noise = errors[k] - biases[k];
  const double power = std::log(trials[k - 1].variance / trials[k + 1].variance) / std::log(square);
  if (!(bias > 0 && power > 0)) return trials[k].step;
  const double x = std::pow(power * noise / (4 * bias), 1 / (4 + power));
  return std::clamp(x, 1 / factor, factor) * trials[k].step;
}

std::unique_ptr<DerivativeMethod> make_difference_method(const MethodInput& input) {
  return std::make_unique<DifferenceMethod>(input);
}

}  // namespace limn
