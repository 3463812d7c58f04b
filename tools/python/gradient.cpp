// Derivative images in forward mode.
#include "limn/integrators/gradient.h"

#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/integrators/methods.h"
#include "tools/python/arguments.h"

namespace limn::python {

std::vector<std::string> to_list(const Names& names) {
  const std::string* one = std::get_if<std::string>(&names);
  return one ? std::vector<std::string>{*one} : std::get<std::vector<std::string>>(names);
}

void add_samples(Arguments& arguments, std::optional<SampleCounts>& counts, bool* uniform) {
  counts.reset();
  arguments.add(
      {"samples", "str | collections.abc.Sequence[float]", "'auto'",
       "\"auto\" (a pilot allocates them), \"uniform\" (alike in all pixels), or the samples of "
       "each term per pixel sample.",
       [=, &counts](nb::handle given) {
         if (!nb::isinstance<nb::str>(given)) {
           counts = SampleCounts(nb::cast<std::vector<double>>(given));
           return;
         }
         const auto word = nb::cast<std::string>(given);
         if (word != "auto" && word != "uniform") {
           throw InputError(unknown_name("kind of samples", word, {"auto", "uniform"}) +
                            "; counts are a list, one for each term");
         }
         if (uniform) *uniform = word == "uniform";
       }});
}

namespace {

struct GradientCall : RunCall {
  Names names;
  GradientOptions options;

  void take(Arguments& a) {
    add_scene(a, scene);
    a.add("names", kNamesType, "", names,
          "of numbers; a vertex is \"object.vertex_positions.7.x\", a field of vectors "
          "\"object.vertex_positions:FILE\".");
    add_run(a, request, progress, true);
    visit_options(options, a);
    add_samples(a, options.samples, &options.uniform_samples);
    add_store(a, request);
  }

  nb::dict run(const Arguments& given) {
    given.refuse_samples(options.points, {"spp", "seconds", "samples"});
    options.parameters = to_list(names);
    const GradientResult result = result_of([&](const Scene& of, const RunSettings& settings) {
      return gradient(of, options, settings);
    });
    nb::dict estimates;
    for (const ParameterGradient& g : result.parameters) {
      Estimate estimate = to_estimate(g.total, film(), result.spp, result.seconds);
      estimate.warnings = result.warnings;
      estimate.is_derivative = true;
      estimates[nb::cast(g.name)] = nb::cast(std::move(estimate));
    }
    check_finite(result.non_finite, estimates);
    warn_all(result.warnings);
    return estimates;
  }
};

}  // namespace

void bind_gradient(nb::module_& m) {
  def<GradientCall>(
      m, "gradient", "dict[str, Estimate]",
      "Derivative images, (H, W, 3) radiance per unit of each parameter, all from the same "
      "samples.\n\n"
      "With points \"faces\" that of the image that limn.render makes with them, exactly. Raises "
      "limn.UnknownParameterError (a KeyError), limn.InputError, limn.NonFiniteError.");
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
