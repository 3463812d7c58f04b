// `adaptive` or finite differences: the one that pilots expect to be nearer after equal time.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "integrators/methods/difference_method.h"
#include "integrators/methods/term_job.h"
#include "limn/integrators/parts.h"

namespace limn {
namespace {

// Rays of images over rays of terms, by their time; see Term::work. Median of twelve scenes.
constexpr double kRayWork = 0.25;
// The most that ray tracers of the pilot of differences may take of the time that is left. Not
// tuned.
constexpr double kTracerShare = 0.25;
// The squared error of terms over what is expected of it, as a mean over twelve scenes: pilots do
// not see their rare large samples.
constexpr double kUnseen = 1.5;

// The squared error that is expected of differences over that of terms: of several parameters the
// mean, as plans of terms have it. Nothing where a pilot has seen nothing of one.
std::optional<double> expected_ratio(const TermForecast& terms, const DifferencePlan& differences,
                                     const RunSettings& left) {
  double error = 0;
  for (size_t k = 0; k < terms.units.size(); ++k) {
    const DifferencePlan::Step& step = differences.steps[k];
    const double of_step = step.forecast.squared_error();
    if (!(of_step > 0 && terms.units[k] > 0)) return std::nullopt;
    error += 3 * of_step / terms.units[k];
  }
  const double samples = left.seconds > 0 ? left.seconds / terms.seconds : left.spp;
  const double of_terms = kUnseen * terms.error / std::max(samples, 1.0);
  return of_terms > 0 ? std::optional(error / of_terms) : std::nullopt;
}

RunSettings left_of(const RunSettings& settings, const Stopwatch& watch) {
  RunSettings left = settings;
  if (settings.seconds > 0) left.seconds = std::max(settings.seconds - watch.seconds(), 1e-9);
  return left;
}

void warn_of_bias(const GradientOptions& options, const DifferencePlan& plan,
                  std::vector<std::string>& warnings) {
  for (size_t k = 0; k < plan.steps.size(); ++k) {
    warnings.push_back(
        fmt::format("finite differences were chosen: the derivative of \"{}\" is biased, as a root "
                    "mean square over pixels by an estimated {:.2g} at most",
                    options.parameters[k], std::sqrt(plan.steps[k].forecast.most_squared_bias)));
  }
}

}  // namespace

GradientResult run_fastest(const TermMethod& method, const Scene& scene,
                           const GradientOptions& options, const RunSettings& settings) {
  const Stopwatch watch;
  GradientOptions of_differences = options;
  of_differences.step = 0;
  std::vector<MethodSetting> notes = {{"chosen", "adaptive: no pilot"}};
  const Rival differences = [&](const TermForecast& terms) -> std::optional<GradientResult> {
    RunSettings left = left_of(settings, watch);
    notes = {{"chosen", "adaptive: a pilot of fd would take too long"}};
    if (left.seconds > 0 && kPilotImages * terms.tracer_seconds > kTracerShare * left.seconds)
      return std::nullopt;
    const double pixels = static_cast<double>(film_size(scene.film)) / 3;
    const double rays = settings.seconds > 0 ? 0 : settings.spp * terms.work * pixels / kRayWork;
    const DifferencePlan plan = plan_differences(scene, of_differences, left, rays);
    left = left_of(settings, watch);
    const std::optional<double> ratio = expected_ratio(terms, plan, left);
    notes = {{"chosen", "adaptive: the pilots have seen too little"}};
    if (!ratio) return std::nullopt;
    const bool chosen = *ratio < 1;
    notes = {{"chosen", chosen ? "fd (biased)" : "adaptive"},
             {"expected squared error of fd over adaptive's", *ratio}};
    if (settings.store) {
      std::string choice = fmt::format("{}", chosen);
      for (const DifferencePlan::Step& step : plan.steps)
        choice += fmt::format(" {} {}", step.forecast.step, step.samples);
      settings.store->identify("choice of fastest", choice);
    }
    if (!chosen) return std::nullopt;
    if (rays > 0) left.spp = static_cast<int>(std::min(plan.steps[0].samples, 1e9));
    const double before = watch.seconds();
    GradientResult result = run_planned("differences", scene, of_differences, left, plan, {});
    result.seconds += before;
    result.setup_seconds += before - plan.seconds;  // the plan's are in it
    result.planned_spp = left.spp;
    warn_of_bias(options, plan, result.warnings);
    return result;
  };
  GradientResult result = run_terms(method, scene, options, settings, differences);
  result.settings.insert(result.settings.begin(), notes.begin(), notes.end());
  return result;
}

}  // namespace limn
