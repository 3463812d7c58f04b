// A gradient without noise against differences of its own image.
#include <algorithm>
#include <cmath>
#include <optional>

#include "integrators/compare/check_step.h"
#include "integrators/methods/move_rounding.h"
#include "limn/core/parameter.h"
#include "limn/integrators/check.h"
#include "limn/integrators/options.h"
#include "limn/integrators/render.h"

namespace limn {
namespace {

// Steps, each a quarter of the one before: the first is the user's, or the natural one.
constexpr int kSteps = 6;
constexpr double kShrink = 0.25;

// What is said to be exact is confirmed only by differences that are known this well. Not tuned.
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

GradientOptions gradient_options(const CheckOptions& options) {
  GradientOptions gradient;
  gradient.parameters = {options.parameter};
  gradient.method = options.method;
  gradient.terms = options.terms;
  gradient.points = FilmPoints::kFaces;
  return gradient;
}

bool interrupted(const RunSettings& settings) {
  return settings.interrupted && settings.interrupted->load();
}

struct Differences {
  std::vector<double> best;
  double step = 0;          // by which these were found
  double least = INFINITY;  // how much they changed, or their rounding
};

// Differences at two steps tell what either misses: those change least that know most. Nothing if
// interrupted.
std::optional<Differences> find_differences(const Scene& scene, const Parameter& parameter,
                                            double step, double size, const RunSettings& settings,
                                            NonFinite& non_finite) {
  RunSettings own = settings;
  own.progress = nullptr;
  const auto image_at = [&](double way) {
    const RenderResult image = render(parameter.moved(scene, way), own,
                                      {.method = "analytic", .points = FilmPoints::kFaces});
    non_finite.merge(image.non_finite);
    return means(image.radiance);
  };
  Differences found;
  std::vector<double> before;
  for (int i = 0; i < kSteps; ++i, step *= kShrink) {
    std::vector<double> differences = image_at(step);
    // Steps at which nothing moves any more do not change either.
    const double rounding = kImageRounding * size_of(differences) / step +
                            rounding_of_moves(scene, parameter, step) * size;
    differences = minus(std::move(differences), image_at(-step));
    for (double& d : differences) d /= 2 * step;
    if (interrupted(settings)) return std::nullopt;
    if (settings.progress) settings.progress((i + 1.0) / kSteps);
    const double change =
        before.empty() ? INFINITY : std::max(size_of(minus(differences, before)), rounding);
    if (found.best.empty() || change < found.least) found = {differences, step, change};
    before = std::move(differences);
  }
  return found;
}

}  // namespace

FacesCheck check_faces(const Scene& scene, const CheckOptions& options, const RunSettings& settings,
                       const GradientRun& run) {
  check_options(options);
  const Parameter parameter = find_parameter(scene, options.parameter);
  RunSettings own = settings;
  own.progress = nullptr;
  FacesCheck result;
  result.gradient = run(scene, gradient_options(options), own);
  result.non_finite = result.gradient.non_finite;
  result.interrupted = result.gradient.spp == 0 || interrupted(settings);
  if (result.interrupted) return result;
  const std::vector<double> gradient = means(result.gradient.parameters[0].total);
  const auto found =
      find_differences(scene, parameter, options.step > 0 ? options.step : parameter.natural_step,
                       size_of(gradient), settings, result.non_finite);
  result.interrupted = !found;
  if (!found) return result;
  result.step = found->step;
  result.gradient_sum = sum_of(gradient);
  result.difference_sum = sum_of(found->best);
  const double size = std::max(size_of(gradient), size_of(found->best));
  const double scale = size > 0 ? 1 / size : 0;
  result.error = scale * size_of(minus(gradient, found->best));
  result.known = scale * found->least;
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
