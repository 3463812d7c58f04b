// Derivatives by any method: what options and results have in common.
#include "limn/integrators/gradient.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "integrators/methods/hair_gaps.h"
#include "integrators/methods/term_job.h"
#include "integrators/terms/term.h"
#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/core/parameter.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/options.h"
#include "limn/integrators/parts.h"

namespace limn {
namespace {

void check_shading(const Scene& scene, GradientResult& result) {
  if (scene.shading != ShadingModel::kMitsuba) return;
  result.warnings.push_back(
      "shading 'mitsuba' is discontinuous where no edge is: the derivative of interpolated normals "
      "is incomplete");
}

void check_selection(const Scene& scene, const GradientOptions& options) {
  const Method& method = options.method;
  check_task(method, Task::kGradient);
  if (options.parameters.empty()) throw InputError("names: at least one parameter must be named");
  check_options(options);
  if (method->check) method->check(scene);
  check_warp(options.warp, {method});
  check_blur(options.blur, {method});
  check_points(options.points, method->closed_light, method.name());
  if (options.terms.empty() || method->terms_can_be_left_out) return;
  throw InputError("terms: the method \"" + method.name() + "\" has all terms in one");
}

void identify(const Scene& scene, const GradientOptions& options, BatchStore& store) {
  const std::vector<Parameter> parameters = parameters_of(scene, options);
  std::string names = join(options.parameters);
  for (const Parameter& found : options.found) names += " " + found.unit;
  store.identify("method", options.method.name());
  store.identify("parameters", names);
  store.identify("velocities", fingerprint(scene, parameters));
  store.identify("terms", join(options.terms));
  store.identify("samples", !options.samples ? (options.uniform_samples ? "uniform" : "auto")
                                             : to_string(*options.samples));
  store.identify("warp", fmt::format("{} rays, kappa {}", options.warp.rays, options.warp.kappa));
  store.identify("blur", fmt::format("{}, {}", options.blur.sigma, options.blur.gamma));
  store.identify("step", fmt::format("{}", options.step));
}

}  // namespace

std::vector<Parameter> parameters_of(const Scene& scene, const GradientOptions& options) {
  if (!options.found.empty()) return options.found;
  std::vector<Parameter> parameters;
  for (const std::string& name : options.parameters) {
    parameters.push_back(find_parameter(scene, name));
  }
  return parameters;
}

bool SampleCounts::operator==(const SampleCounts& other) const {
  for (size_t t = 0; t < std::max(size(), other.size()); ++t) {
    if ((*this)[t] != other[t]) return false;
  }
  return true;
}

std::string to_string(const SampleCounts& samples) {
  std::string text;
  for (size_t t = 0; t < samples.size(); ++t) {
    text += fmt::format("{}{:.4g}", t > 0 ? "," : "", samples[t]);
  }
  return text.empty() ? "1" : text;
}

SampleCounts GradientResult::samples() const {
  std::vector<double> counts;
  for (const TermRun& term : terms) counts.push_back(term.samples);
  return SampleCounts(counts);
}

size_t GradientResult::term(const std::string& name) const {
  const auto found = std::find_if(terms.begin(), terms.end(),
                                  [&](const TermRun& term) { return term.name == name; });
  if (found == terms.end()) throw std::logic_error("no term \"" + name + "\" in this result");
  return static_cast<size_t>(found - terms.begin());
}

double edge_magnitude(const GradientResult& result, const ParameterGradient& g, size_t block) {
  double sum = 0;
  for (size_t t = 0; t < result.terms.size(); ++t) {
    if (result.terms[t].edges && result.terms[t].computed) {
      sum += std::fabs(g.term_blocks[t].mean(block));
    }
  }
  return sum;
}

GradientResult gradient(const Scene& scene, const GradientOptions& options,
                        const RunSettings& settings) {
  const MethodType& method = *options.method;
  check_selection(scene, options);
  if (settings.store) identify(scene, options, *settings.store);
  GradientResult result = method.run(method, scene, options, settings);
  result.method = method.name;
  check_shading(scene, result);
  if (options.points == FilmPoints::kFaces || !moved_in(scene, parameters_of(scene, options)).any())
    return result;
  warn_of_hair_gaps(scene, static_cast<double>(result.spp), settings.threads, result.warnings);
  return result;
}

std::vector<std::string> trace_sample(const Scene& scene, const GradientOptions& options,
                                      const RunSettings& settings,
                                      const NonFinite::SampleId& place) {
  const MethodType& method = *options.method;
  check_selection(scene, options);
  if (!method.trace) {
    throw InputError("the method \"" + method.name + "\" cannot trace single samples");
  }
  return method.trace(method, scene, options, settings, place);
}

std::vector<std::string> selected_terms(const std::vector<std::string>& known,
                                        const std::vector<std::string>& chosen,
                                        const std::string& file) {
  for (const std::string& name : chosen) {
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    throw InputError({file},
                     "no term \"" + name + "\" here (terms of this scene: " + join(known) + ")");
  }
  return chosen.empty() ? known : chosen;
}

}  // namespace limn
