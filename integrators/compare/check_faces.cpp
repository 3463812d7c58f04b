// A gradient without noise against differences of its own image.
#include <algorithm>
#include <cmath>

#include "integrators/compare/check_step.h"
#include "limn/core/parameter.h"
#include "limn/integrators/check.h"
#include "limn/integrators/render.h"

namespace limn {
namespace {

// Steps, each a quarter of the one before: the first is the user's, or the natural one.
constexpr int kSteps = 6;
constexpr double kShrink = 0.25;

// What is told as exact is confirmed only by differences that are known this well. Not tuned.
constexpr double kWanted = 1e-3;

// Of images, over what they hold: some hundred units in the last place.
constexpr double kImageRounding = 0x1p-44;

double size_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v * v;
  return std::sqrt(sum);
}

std::vector<double> minus(std::vector<double> a, const std::vector<double>& b) {
  for (size_t i = 0; i < a.size(); ++i) a[i] -= b[i];
  return a;
}

double sum_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum;
}

}  // namespace

// Differences at two steps tell what either misses: those change least that know most.
FacesCheck check_faces(const Scene& scene, const CheckOptions& options, const RunSettings& settings,
                       const GradientRun& run) {
  check_given_step(options.step);
  const Parameter parameter = find_parameter(scene, options.parameter);
  RunSettings own = settings;
  own.progress = nullptr;
  FacesCheck result;
  const auto image_at = [&](double step) {
    const RenderResult image = render(parameter.moved(scene, step), own,
                                      {.method = "analytic", .points = FilmPoints::kFaces});
    result.non_finite.merge(image.non_finite);
    return means(image.radiance);
  };
  GradientOptions gradient_options;
  gradient_options.parameters = {options.parameter};
  gradient_options.method = options.method;
  gradient_options.terms = options.terms;
  gradient_options.exact_film = options.exact_film;
  gradient_options.points = FilmPoints::kFaces;
  result.gradient = run(scene, gradient_options, own);
  result.non_finite = result.gradient.non_finite;
  const auto interrupted = [&] { return settings.interrupted && settings.interrupted->load(); };
  if (result.gradient.spp == 0 || interrupted()) {
    result.interrupted = true;
    return result;
  }
  const std::vector<double> told = means(result.gradient.parameters[0].total);
  double step = options.step > 0 ? options.step : parameter.natural_step;
  std::vector<double> before, best;
  double least = INFINITY;
  for (int i = 0; i < kSteps; ++i, step *= kShrink) {
    std::vector<double> differences = image_at(step);
    // Steps at which nothing moves any more do not change either.
    const double rounding = kImageRounding * size_of(differences) / step +
                            rounding_of_moves(scene, parameter, step) * size_of(told);
    differences = minus(std::move(differences), image_at(-step));
    for (double& d : differences) d /= 2 * step;
    if (interrupted()) {
      result.interrupted = true;
      return result;
    }
    if (settings.progress) settings.progress((i + 1.0) / kSteps);
    const double change =
        before.empty() ? INFINITY : std::max(size_of(minus(differences, before)), rounding);
    if (best.empty() || change < least) {
      least = change;
      best = differences;
      result.step = step;
    }
    before = std::move(differences);
  }
  result.gradient_sum = sum_of(told);
  result.difference_sum = sum_of(best);
  const double size = std::max(size_of(told), size_of(best));
  const double scale = size > 0 ? 1 / size : 0;
  result.error = scale * size_of(minus(told, best));
  result.known = scale * least;
  // Of the last two steps the smaller one has a fifteenth of the change as its error where the
  // image is smooth, all of it where rounding rules.
  if (result.error <= 2 * result.known) {
    result.verdict = result.known < kWanted ? Verdict::kAgree : Verdict::kCannotTell;
  } else {
    result.verdict = Verdict::kDisagree;
  }
  return result;
}

}  // namespace limn
