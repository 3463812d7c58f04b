// Several methods at equal time against one reference.
#include "limn/integrators/compare.h"

#include <cmath>

#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/core/parameter.h"
#include "tools/python/bindings.h"

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
          {}};
}

struct CompareArguments {
  std::string name;
  std::vector<Method> methods;
  std::vector<double> times;
  int repeats = 4;
  double reference_seconds = 0;
  WarpOptions warp;
  bool exact_film = false;
};

void check_arguments(const Scene& scene, const CompareArguments& arguments) {
  find_parameter(scene, arguments.name);
  for (const Method& method : arguments.methods) check_task(method, Task::kGradient);
  if (arguments.methods.empty()) throw InputError("compare needs a method or more");
  check_warp(arguments.warp, arguments.methods);
  if (arguments.exact_film) check_exact_films(scene, arguments.methods);
  if (arguments.repeats < 1) throw InputError("repeats must be 1 or more");
  double before = 0;
  for (const double time : arguments.times) {
    if (!(time > before)) throw InputError("times must be positive and ascending");
    before = time;
  }
  if (arguments.times.empty()) throw InputError("compare needs a time or more");
}

NonFinite non_finite(const Reference& reference, const std::vector<ComparedMethod>& methods) {
  NonFinite all = reference.non_finite;
  for (const ComparedMethod& method : methods) {
    for (const ComparedRun& run : method.runs) all.merge(run.run.non_finite);
  }
  return all;
}

Comparison compare_of(const SceneHandle& handle, const CompareArguments& arguments,
                      const RunArguments& run, const nb::object& progress) {
  const auto scene = handle.share();
  check_arguments(*scene, arguments);
  const int width = scene->film.crop_width, height = scene->film.crop_height;
  const int block = std::max(1, (std::max(width, height) + 7) / 8);
  const MethodInput input{*scene,         arguments.name,      {}, 0, block, std::nullopt,
                          arguments.warp, arguments.exact_film};
  Reference reference;
  std::vector<ComparedMethod> compared;
  run_job(make_settings(*scene, run), progress, [&](const RunSettings& settings) {
    RunSettings first = settings;
    first.spp = 1 << 30;
    first.seconds = arguments.reference_seconds;
    first.seed = derived_seed(settings.seed, "reference");
    first.progress = nullptr;
    reference = make_reference(input, first);
    if (reference.spp < 2) return;
    std::vector<std::unique_ptr<DerivativeMethod>> methods;
    for (const Method& method : arguments.methods) methods.push_back(make_method(input, method));
    compared = compare({arguments.times, arguments.repeats}, reference, methods, settings);
  });
  Comparison result{to_estimate(reference, width, height), compared, width, height};
  check_finite(non_finite(reference, compared), nb::cast(result));
  return result;
}

std::optional<std::pair<double, double>> to_pair(const std::optional<Uncertain>& value) {
  if (!value) return std::nullopt;
  return std::pair(value->value, value->error);
}

void bind_rung(nb::module_& m) {
  nb::class_<RungSummary>(m, "Rung", "Over the repeats of a method in one time.")
      .def_ro("seconds", &RungSummary::seconds, "Of a run, set-up included: a mean.")
      .def_ro("spp", &RungSummary::spp, "Samples per pixel: a mean.")
      .def_prop_ro(
          "mse", [](const RungSummary& r) { return std::pair(r.mse.value, r.mse.error); },
          "Mean squared error over pixels and channels, and its standard error.")
      .def_prop_ro(
          "relative_mse",
          [](const RungSummary& r) {
            return std::pair(r.relative_mse.value, r.relative_mse.error);
          },
          "The same over the mean square of the reference.")
      .def_prop_ro(
          "bias_p", [](const RungSummary& r) { return p_value(r.bias); },
          "p-value of the hypothesis that the method has no bias.");
}

}  // namespace

void bind_compare(nb::module_& m) {
  bind_rung(m);
  nb::class_<MethodView>(m, "ComparedMethod", "A method in a comparison.")
      .def_prop_ro(
          "name", [](const MethodView& v) { return v.method.name; }, "Its name.")
      .def_prop_ro(
          "message", [](const MethodView& v) { return v.method.message; },
          "Why it is missing or not complete; \"\".")
      .def_prop_ro(
          "rungs", [](const MethodView& v) { return v.method.summary; },
          "One limn.Rung for each time.")
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
          "One limn.ComparedMethod each, in the order asked for.");
  m.def(
      "compare",
      [](const SceneHandle& scene, const std::string& name, const std::vector<std::string>& methods,
         const std::vector<double>& times, int repeats, std::optional<double> reference_seconds,
         int aux, double kappa, std::optional<uint64_t> seed, int threads,
         const nb::object& progress, const std::string& film) {
        double runs = 0;
        for (const double time : times) runs += time * repeats;
        return compare_of(scene,
                          {name,
                           {methods.begin(), methods.end()},
                           times,
                           repeats,
                           reference_seconds.value_or(4 * runs),
                           {aux, kappa},
                           is_exact(film)},
                          {{}, seed, 0, threads}, progress);
      },
      nb::arg("scene"), nb::arg("name"), nb::arg("methods"), nb::arg("times"),
      nb::arg("repeats") = 4, nb::arg("reference_seconds") = nb::none(),
      nb::arg("aux") = WarpOptions{}.rays, nb::arg("kappa") = WarpOptions{}.kappa,
      nb::arg("seed") = nb::none(), nb::arg("threads") = 0, nb::arg("progress") = nb::none(),
      nb::arg("film") = "rays",
      nb::sig(
          "def compare(scene: Scene, name: str, methods: collections.abc.Sequence[str], times: "
          "collections.abc.Sequence[float], repeats: int = 4, reference_seconds: float | None = "
          "None, aux: int = 8, kappa: float = 1e4, seed: int | None = None, threads: int = 0, "
          "progress: "
          "collections.abc.Callable[[float], object] | None = None, film: str = 'rays') -> "
          "Comparison"),
      "Derivative images of several methods at equal time against one long run.\n\n"
      "methods: the first is the measure of the others. times: seconds of a run, ascending.\n"
      "reference_seconds: None for four times all runs of one method. aux, kappa, film: as "
      "limn.gradient, of the methods that take them; references have their film by rays.");
}

}  // namespace limn::python
