#include "difference_method.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "limn/core/parameter.h"
#include "limn/integrators/render.h"
#include "method_images.h"

namespace limn {
namespace {

constexpr double kPilotShare = 0.1;  // of the time of a run
constexpr int kPilotSamples = 4;     // per pixel, at least
// The steps that the pilot tries, in natural steps: that one is for pictures that change a lot.
constexpr double kNear = 1.0 / 8;
constexpr double kFactor = 16;

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
    const double near = kNear * natural_;
    const CentralDifferences r =
        central_differences(input_.scene, input_.parameter, {near, kFactor * near},
                            {{1, 0}, {0, 1}, {-1, 1}}, input_.block, settings);
    if (r.spp < kPilotSamples) return {natural_, r.seconds, "interrupted"};
    PilotFigures figures;
    figures.step = near;
    figures.factor = kFactor;
    figures.variance = mean_variance(r.estimates[0].total) * static_cast<double>(r.spp);
    figures.variance_far = mean_variance(r.estimates[1].total) * static_cast<double>(r.spp);
    figures.squared_change =
        mean_square(means(r.estimates[2].total)) - mean_variance(r.estimates[2].total);
    // Four images take twice the time of two.
    figures.samples_per_second =
        2 * static_cast<double>(r.spp) / std::max(r.seconds - r.setup_seconds, 1e-9);
    const double left = run.seconds - r.seconds - 0.5 * r.setup_seconds;
    return {best_step(figures, left), r.seconds,
            fmt::format("a pilot of {} samples per pixel at steps {:.3g} and {:.3g}: least sum of "
                        "squared bias and variance for a run of {:.3g} s",
                        r.spp, near, kFactor * near, run.seconds)};
  }

  const MethodInput& input_;
  double natural_;
  std::map<double, Pilot> pilots_;
  double step_ = 0;
  std::string how_;
};

}  // namespace

double best_step(const PilotFigures& pilot, double seconds) {
  const double far = pilot.factor * pilot.step;
  const double samples = std::max(1.0, pilot.samples_per_second * seconds);
  if (!(pilot.variance_far > 0)) return far;
  // A bias that drowns in the noise of the smaller step may still be too large at the larger one.
  if (!(pilot.squared_change > 0)) return std::sqrt(pilot.step * far);
  if (!(pilot.variance > 0)) return pilot.step;
  const double bias = pilot.squared_change / std::pow(pilot.factor * pilot.factor - 1, 2);  // B h^4
  const double power = std::log(pilot.variance / pilot.variance_far) / std::log(pilot.factor);
  if (!(power > 0)) return pilot.step;
  // With x the step over h: minimum of bias x^4 + (variance / samples) x^-power.
  const double x = std::pow(power * pilot.variance / samples / (4 * bias), 1 / (4 + power));
  return std::clamp(x, 1.0, pilot.factor) * pilot.step;
}

std::unique_ptr<DerivativeMethod> make_difference_method(const MethodInput& input) {
  return std::make_unique<DifferenceMethod>(input);
}

}  // namespace limn
