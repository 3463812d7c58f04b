// Derivative images in forward mode.
#include "limn/integrators/gradient.h"

#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/integrators/methods.h"
#include "tools/python/bindings.h"

namespace limn::python {

std::vector<std::string> to_list(const Names& names) {
  const std::string* one = std::get_if<std::string>(&names);
  return one ? std::vector<std::string>{*one} : std::get<std::vector<std::string>>(names);
}

Method to_method(const std::string& name, Task task) {
  const Method method(name);
  check_task(method, task);
  return method;
}

void refuse_sampler(const nb::object& sampler, const char* instead) {
  if (sampler.is_none()) return;
  throw InputError(std::string("sampler: this argument is now ") + instead);
}

bool is_auto(const Samples& samples) {
  const std::string* word = std::get_if<std::string>(&samples);
  return word && *word == "auto";
}

void set_samples(const Samples& samples, std::optional<SampleCounts>& counts) {
  const std::string* word = std::get_if<std::string>(&samples);
  if (word && *word != "auto" && *word != "uniform") {
    throw InputError(unknown_name("kind of samples", *word, {"auto", "uniform"}) +
                     "; counts are a list, one for each term");
  }
  counts.reset();
  if (!word) counts = SampleCounts(std::get<std::vector<double>>(samples));
}

namespace {

using Gradients = nb::typed<nb::dict, std::string, Estimate>;

struct GradientArguments {
  Names names;
  Method method;
  std::vector<std::string> terms;
  Samples samples;
  double step;
  WarpOptions warp;
  std::string film;
  FilmPoints points;
};

GradientOptions to_options(const GradientArguments& arguments) {
  GradientOptions options;
  options.parameters = to_list(arguments.names);
  options.method = arguments.method;
  options.terms = arguments.terms;
  options.step = arguments.step;
  options.warp = arguments.warp;
  options.exact_film = is_exact(arguments.film);
  options.points = arguments.points;
  set_samples(arguments.samples, options.samples);
  const std::string* word = std::get_if<std::string>(&arguments.samples);
  options.uniform_samples = word && *word == "uniform";
  return options;
}

nb::dict gradient_of(const SceneHandle& handle, const GradientArguments& arguments,
                     const RunArguments& run, const nb::object& progress) {
  const auto scene = handle.share();
  const GradientOptions options = to_options(arguments);
  GradientResult result;
  run_job(make_settings(*scene, run), progress,
          [&](const RunSettings& settings) { result = gradient(*scene, options, settings); });
  nb::dict estimates;
  for (const ParameterGradient& g : result.parameters) {
    Estimate estimate = to_estimate(g.total, scene->film, result.spp, result.seconds);
    estimate.warnings = result.warnings;
    estimates[nb::cast(g.name)] = nb::cast(std::move(estimate));
  }
  check_finite(result.non_finite, estimates);
  warn_all(result.warnings);
  return estimates;
}

}  // namespace

void bind_gradient(nb::module_& m) {
  m.def(
      "gradient",
      [](const SceneHandle& scene, const Names& names, std::optional<int> spp,
         std::optional<uint64_t> seed, const std::string& method,
         const std::vector<std::string>& terms, const Samples& samples, double step, int aux,
         double kappa, double seconds, int threads, const nb::object& progress,
         const std::string& film, const std::string& points, BatchStore* store) {
        const FilmPoints over = to_points(
            points,
            {{"spp", spp.has_value()}, {"seconds", seconds != 0}, {"samples", !is_auto(samples)}});
        return gradient_of(scene,
                           {names,
                            to_method(method, Task::kGradient),
                            terms,
                            samples,
                            step,
                            {aux, kappa},
                            film,
                            over},
                           {spp, seed, seconds, threads, store}, progress);
      },
      nb::arg("scene"), nb::arg("names"), nb::arg("spp") = nb::none(), nb::arg("seed") = nb::none(),
      nb::arg("method") = Method(Task::kGradient).name(), nb::arg("terms") = nb::make_tuple(),
      nb::arg("samples") = "auto", nb::arg("step") = 0.0, nb::arg("aux") = WarpOptions{}.rays,
      nb::arg("kappa") = WarpOptions{}.kappa, nb::arg("seconds") = 0.0, nb::arg("threads") = 0,
      nb::arg("progress") = nb::none(), nb::arg("film") = "rays", nb::arg("points") = "random",
      nb::arg("_store").none() = nb::none(),
      nb::sig(
          "def gradient(scene: Scene, names: str | collections.abc.Sequence[str], spp: int | None "
          "= None, seed: int | None = None, method: str = 'adaptive', terms: "
          "collections.abc.Sequence[str] = (), samples: str | collections.abc.Sequence[float] = "
          "'auto', step: float = 0, aux: int = 8, kappa: float = 1e4, seconds: float = 0, threads: "
          "int = 0, progress: "
          "collections.abc.Callable[[float], object] | None = None, film: str = 'rays', "
          "points: str = 'random') -> dict[str, Estimate]"),
      "Derivative images, (H, W, 3) radiance per unit of each parameter, all from the same "
      "samples.\n\n"
      "names: of numbers; a vertex is \"object.vertex_positions.7.x\", a field of vectors "
      "\"object.vertex_positions:FILE\".\n"
      "spp, seed: of the scene's file if None. seconds: as many samples as fit, at most spp.\n"
      "method: see limn.methods(); its settings follow a colon, as in \"forest:width=4\". terms: "
      "of "
      "those, by name; () for all.\n"
      "samples: \"auto\" (a pilot chooses), \"uniform\" (alike in all pixels), or what a sample of "
      "a "
      "pixel holds of each term. step: of finite differences; 0: found by a pilot.\n"
      "aux, kappa: auxiliary rays of a direction and the concentration of their kernel (method "
      "was).\n"
      "film: \"rays\", or \"exact\": edges on the film are drawn from what is seen of them alone "
      "(box "
      "filter).\n"
      "points: \"faces\", with the method analytic: of the image that limn.render makes with these "
      "points, exactly, without samples.\n"
      "Raises limn.UnknownParameterError (a KeyError), limn.InputError, limn.NonFiniteError.");
  m.def(
      "methods",
      [] {
        nb::dict methods;
        for (const MethodType& type : method_types()) {
          methods[nb::cast(type.name)] = nb::cast(type.description);
        }
        return nb::typed<nb::dict, std::string, std::string>(methods);
      },
      "All methods: names and what they are (limn methods says which of them compute images, "
      "derivatives, reverse mode and fits, and lists their settings).");
}

}  // namespace limn::python
