// Several methods at equal time against one reference.
#include "limn/integrators/compare.h"

#include <cmath>

#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "tools/python/arguments.h"

namespace limn::python {

namespace {

struct Comparison {
  Estimate reference;
  std::vector<ComparedMethod> methods;
  int width, height;
};

// One method of a comparison.
struct MethodView {
  ComparedMethod method;
  int width, height;
};

Pixels to_pixels(const std::vector<double>& values, int width, int height) {
  Image image(width, height, 3);
  for (size_t i = 0; i < values.size(); ++i) image.data[i] = static_cast<float>(values[i]);
  return to_array(std::move(image));
}

Estimate to_estimate(const Reference& reference, int width, int height) {
  std::vector<double> errors;
  for (const double v : reference.variance) errors.push_back(std::sqrt(v));
  return {Array(to_pixels(reference.image, width, height)),
          Array(to_pixels(errors, width, height)),
          reference.spp,
          reference.seconds,
          {},
          true};
}

struct CompareCall : RunCall {
  std::string name;
  std::vector<std::string> methods;
  std::vector<double> times;
  int repeats = 4;
  std::optional<double> reference_seconds;
  GradientOptions options;  // but for parameters and method

  void take(Arguments& a);
  Comparison run(const Arguments& given) const;
};

void CompareCall::take(Arguments& a) {
  add_scene(a, scene);
  a.add("name", "str", "", name, "of the parameter.");
  a.add("methods", "collections.abc.Sequence[str]", "", methods,
        "the first is the measure of the others.");
  a.add("times", "collections.abc.Sequence[float]", "", times, "seconds of a run, ascending.");
  a.end_positional();
  a.add("repeats", "int", "4", repeats, "runs of each method and time.");
  a.add("reference_seconds", "float | None", "None", reference_seconds,
        "None: four times all runs of one method.");
  visit_options(request, all_but({"spp", "seconds"}, a));
  a.add("progress", "collections.abc.Callable[[float], object] | None", "None", progress);
  visit_options(options, all_but({"method", "terms", "step", "points"}, a));
}

void check_call(const Scene& scene, const CompareCall& call, const std::vector<Method>& methods) {
  find_parameter(scene, call.name);
  for (const Method& method : methods) check_task(method, Task::kGradient);
  if (methods.empty()) throw InputError("compare needs a method or more");
  check_warp(call.options.warp, methods);
  check_blur(call.options.blur, methods);
  if (call.repeats < 1) throw InputError("repeats must be 1 or more");
  double before = 0;
  for (const double time : call.times) {
    if (!(time > before)) throw InputError("times must be positive and ascending");
    before = time;
  }
  if (call.times.empty()) throw InputError("compare needs a time or more");
}

Comparison CompareCall::run(const Arguments& /*given*/) const {
  const auto shared = scene->share();
  const std::vector<Method> chosen(methods.begin(), methods.end());
  check_call(*shared, *this, chosen);
  const int width = shared->film.crop_width, height = shared->film.crop_height;
  const MethodInput input{*shared,      name,         {},          0, block_size(shared->film),
                          std::nullopt, options.warp, options.blur};
  double all = 0;
  for (const double time : times) all += time * repeats;
  Reference reference;
  std::vector<ComparedMethod> compared;
  run_job(settings_of(request, *shared), progress, [&](const RunSettings& settings) {
    RunSettings first = settings;
    first.spp = 1 << 30;
    first.seconds = reference_seconds.value_or(4 * all);
    first.seed = derived_seed(settings.seed, "reference");
    first.progress = nullptr;
    reference = make_reference(input, first);
    if (reference.spp < 2) return;
    std::vector<std::unique_ptr<TimedMethod>> list;
    for (const Method& method : chosen) list.push_back(make_method(input, method));
    compared = compare({times, repeats}, reference, list, settings);
  });
  Comparison result{to_estimate(reference, width, height), compared, width, height};
  check_finite(non_finite_of(reference, compared), nb::cast(result));
  return result;
}

std::optional<std::pair<double, double>> to_pair(const std::optional<Uncertain>& value) {
  if (!value) return std::nullopt;
  return std::pair(value->value, value->error);
}

void bind_budget(nb::module_& m) {
  nb::class_<BudgetSummary>(m, "TimeBudget", "Over the repeats of a method in one time.")
      .def_ro("seconds", &BudgetSummary::seconds, "Of a run, set-up included: a mean.")
      .def_ro("spp", &BudgetSummary::spp, "Samples per pixel: a mean.")
      .def_prop_ro(
          "mse", [](const BudgetSummary& r) { return std::pair(r.mse.value, r.mse.error); },
          "Mean squared error over pixels and channels, and its standard error.")
      .def_prop_ro(
          "relative_mse",
          [](const BudgetSummary& r) {
            return std::pair(r.relative_mse.value, r.relative_mse.error);
          },
          "The same over the mean square of the reference.")
      .def_prop_ro(
          "bias_p", [](const BudgetSummary& r) { return p_value(r.bias); },
          "p-value of the hypothesis that the method has no bias.");
}

}  // namespace

void bind_compare(nb::module_& m) {
  bind_budget(m);
  nb::class_<MethodView>(m, "ComparedMethod", "A method in a comparison.")
      .def_prop_ro(
          "name", [](const MethodView& v) { return v.method.name; }, "Its name.")
      .def_prop_ro(
          "message", [](const MethodView& v) { return v.method.message; },
          "Why it is missing or not complete; \"\".")
      .def_prop_ro(
          "budgets", [](const MethodView& v) { return v.method.summary; },
          "One limn.TimeBudget for each time.")
      .def_prop_ro(
          "time_ratio", [](const MethodView& v) { return to_pair(v.method.time_ratio); },
          "Time for the error that the first method has after equal time, over this "
          "method's, with its standard error; None where it cannot be known.")
      .def_prop_ro(
          "image", [](const MethodView& v) { return to_pixels(v.method.image, v.width, v.height); },
          nb::rv_policy::reference, "Of its first run in the longest time: float32, (H, W, 3).");
  nb::class_<Comparison>(m, "Comparison", "What limn.compare found.")
      .def_ro("reference", &Comparison::reference, "The derivative that all are measured against.")
      .def_prop_ro(
          "methods",
          [](const Comparison& c) {
            std::vector<MethodView> views;
            for (const ComparedMethod& method : c.methods) {
              views.push_back({method, c.width, c.height});
            }
            return views;
          },
          "One limn.ComparedMethod each, in the order requested.");
  def<CompareCall>(m, "compare", "Comparison",
                   "Derivative images of several methods at equal time against one long run.\n\n"
                   "aux, kappa and film are for the methods that take them; references have their "
                   "film by rays.");
}

}  // namespace limn::python
