// A gradient against finite differences.
#include "limn/integrators/check.h"

#include <fmt/format.h>

#include "limn/core/error.h"
#include "tools/python/arguments.h"

namespace limn::python {

namespace {

struct Check {
  CheckResult result;
  Estimate gradient, differences;
};

Check check_of(const SceneHandle& handle, const CheckOptions& options, const RunRequest& request,
               const nb::object& progress) {
  const auto scene = handle.share();
  const RunSettings requested = settings_of(request, *scene);
  if (requested.spp < 2) throw InputError("check needs spp of at least 2, for standard errors");
  Check check;
  run_job(requested, progress, [&](const RunSettings& settings) {
    check.result = limn::check(*scene, options, settings);
  });
  CheckResult& r = check.result;
  check.gradient = to_estimate(r.gradient.parameters.at(0), r.gradient, scene->film);
  check.differences = to_estimate(r.differences.extrapolated.total, scene->film, r.differences.spp,
                                  r.differences.seconds);
  check.differences.is_derivative = true;
  NonFinite bad = r.gradient.non_finite;
  bad.merge(r.differences.non_finite);
  warn_all(r.gradient.warnings);
  check_finite(bad, nb::cast(check));
  return check;
}

// The same of faces, which no chance is in.
struct ExactCheck {
  FacesCheck result;
  Estimate gradient;
};

ExactCheck check_exactly(const SceneHandle& handle, const CheckOptions& options,
                         const RunRequest& request, const nb::object& progress) {
  const auto scene = handle.share();
  ExactCheck check;
  run_job(settings_of(request, *scene), progress, [&](const RunSettings& settings) {
    check.result = check_faces(*scene, options, settings);
  });
  const GradientResult& gradient = check.result.gradient;
  check.gradient = to_estimate(gradient.parameters.at(0), gradient, scene->film);
  warn_all(gradient.warnings);
  check_finite(check.result.non_finite, nb::cast(check));
  return check;
}

// A field of the result, by value.
template <class Field>
auto field(Field CheckResult::*member) {
  return [member](const Check& c) { return c.result.*member; };
}
template <class Field>
auto total(Field TotalComparison::*member) {
  return [member](const Check& c) { return c.result.total.*member; };
}

void bind_result(nb::module_& m) {
  nb::class_<Check>(m, "Check", "What limn.check found.")
      .def_prop_ro(
          "verdict", [](const Check& c) { return verdict_name(c.result.verdict); },
          "\"agree\", \"disagree\", \"cannot tell\" or \"not complete\".")
      .def_prop_ro("p", field(&CheckResult::p),
                   "Of the first run: windows, image and terms together.")
      .def_prop_ro("found", field(&CheckResult::found), "Where the first run's p is smallest.")
      .def_prop_ro("suspects", field(&CheckResult::suspects),
                   "The terms that the residual looks like, most likely first; empty if none is "
                   "suspected.")
      .def_prop_ro("step", field(&CheckResult::step),
                   "Of the differences, in the parameter's unit.")
      .def_prop_ro("needed_spp", field(&CheckResult::needed_spp),
                   "To see an error of a tenth of the derivative.")
      .def_prop_ro("within", field(&CheckResult::within),
                   "The error that would have shown with 95 %, over the sum of all terms' "
                   "magnitudes.")
      .def_prop_ro("bends", field(&CheckResult::bends),
                   "Whether the image bends where gradient and differences disagree: the gradient "
                   "is the slope on one side.")
      .def_prop_ro("gradient_sum", total(&TotalComparison::gradient),
                   "Sum over the image's pixels and channels.")
      .def_prop_ro("gradient_sum_stderr", total(&TotalComparison::gradient_error))
      .def_prop_ro("difference_sum", total(&TotalComparison::difference))
      .def_prop_ro("difference_sum_stderr", total(&TotalComparison::difference_error))
      .def_prop_ro("z_sum", total(&TotalComparison::z), "(gradient - differences) / error of both.")
      .def_ro("gradient", &Check::gradient, "The gradient: an image, (H, W, 3).")
      .def_ro("differences", &Check::differences, "The finite differences: an image, (H, W, 3).")
      .def("__repr__", [](const Check& c) {
        return fmt::format("<limn.Check: {}, p = {:.2g}>", verdict_name(c.result.verdict),
                           c.result.p);
      });
}

template <class Field>
auto exact(Field FacesCheck::*member) {
  return [member](const ExactCheck& c) { return c.result.*member; };
}

void bind_exact_result(nb::module_& m) {
  nb::class_<ExactCheck>(m, "FacesCheck", "What limn.check found of points \"faces\".")
      .def_prop_ro(
          "verdict", [](const ExactCheck& c) { return verdict_name(c.result.verdict); },
          "\"agree\", \"disagree\" or \"cannot tell\".")
      .def_prop_ro("error", exact(&FacesCheck::error),
                   "By how much of the derivative the gradient and the differences differ.")
      .def_prop_ro("known", exact(&FacesCheck::known),
                   "By how much of it the differences of two steps differ.")
      .def_prop_ro("step", exact(&FacesCheck::step), "Of the differences, in the parameter's unit.")
      .def_prop_ro("gradient_sum", exact(&FacesCheck::gradient_sum),
                   "Sum over the image's pixels and channels.")
      .def_prop_ro("difference_sum", exact(&FacesCheck::difference_sum))
      .def_ro("gradient", &ExactCheck::gradient, "The gradient: an image, (H, W, 3).")
      .def("__repr__", [](const ExactCheck& c) {
        return fmt::format("<limn.FacesCheck: {}, error = {:.2g}>", verdict_name(c.result.verdict),
                           c.result.error);
      });
}

struct CheckCall {
  const SceneHandle* scene = nullptr;
  CheckOptions options;
  RunRequest request;
  nb::object progress = nb::none();

  void take(Arguments& a) {
    add_scene(a, scene);
    a.add("name", "str", "", options.parameter, "of the parameter.");
    add_run(a, request, progress, true);
    visit_options(options, a);
    add_samples(a, options.samples);
  }

  nb::object run(const Arguments& given) const {
    given.refuse_samples(options.points, {"spp", "seconds", "samples"});
    if (options.points == FilmPoints::kFaces) {
      return nb::cast(check_exactly(*scene, options, request, progress));
    }
    return nb::cast(check_of(*scene, options, request, progress));
  }
};

}  // namespace

void bind_check(nb::module_& m) {
  bind_result(m);
  bind_exact_result(m);
  def<CheckCall>(
      m, "check", "Check | FacesCheck",
      "Compares a gradient with finite differences, both with their errors.\n\n"
      "A right gradient is accused once in ten thousand times. With points \"faces\" the exact "
      "gradient of that image is compared with differences of it, and a FacesCheck comes back. "
      "limn.InputError for the methods \"fd\" and \"fastest\", which take differences themselves.");
}

}  // namespace limn::python
