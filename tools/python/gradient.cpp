// Derivative images in forward mode.
#include "limn/integrators/gradient.h"

#include <fmt/format.h>

#include <cmath>

#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/integrators/methods.h"
#include "tools/python/arguments.h"

namespace limn::python {

std::vector<std::string> to_list(const Names& names) {
  const std::string* one = std::get_if<std::string>(&names);
  return one ? std::vector<std::string>{*one} : std::get<std::vector<std::string>>(names);
}

Estimate to_estimate(const ParameterGradient& g, const GradientResult& result, const Film& film) {
  Estimate estimate = to_estimate(g.total, film, result.spp, result.seconds);
  estimate.warnings = result.warnings;
  estimate.is_derivative = true;
  estimate.settings = result.settings;
  return estimate;
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

Estimate scaled(Estimate estimate, double factor) {
  if (factor == 1) return estimate;
  const auto by = [](const Array& array, double x) {
    const nb::module_ numpy = nb::module_::import_("numpy");
    return nb::cast<Array>(numpy.attr("multiply")(array, x, nb::arg("dtype") = "float32"));
  };
  estimate.value = by(estimate.value, factor);
  estimate.error = by(estimate.error, std::fabs(factor));
  return estimate;
}

struct GradientCall : RunCall {
  Names names;
  std::vector<std::pair<std::string, nb::object>> directions;  // of names, in their place
  std::vector<double> factors;                                 // of results
  GradientOptions options;

  void take(Arguments& a) {
    add_scene(a, scene);
    a.add({"names", std::string(kNamesType) + " | collections.abc.Mapping[str, " + kArrayType + "]",
           "",
           "of numbers; a vertex is \"object.vertex_positions.7.x\", a field of vectors "
           "\"object.vertex_positions:FILE\". {name: direction}: derivatives along directions, of "
           "the shape of limn.Parameter, as (V, 3); of a number it is a factor.",
           [this](nb::handle given) {
             if (!nb::hasattr(given, "items")) return void(names = nb::cast<Names>(given));
             const nb::object copied = nb::module_::import_("builtins").attr("dict")(given);
             for (const auto& [name, direction] : nb::cast<nb::dict>(copied))
               directions.emplace_back(nb::cast<std::string>(name), nb::borrow(direction));
             names = std::vector<std::string>();
           }});
    add_run(a, request, progress, true);
    visit_options(options, a);
    add_samples(a, options.samples, &options.uniform_samples);
    add_store(a, request);
  }

  void find_directions() {
    const Scene& of = scene->get();
    for (const auto& [name, value] : directions) {
      const Parameter whole = find_parameter_or_array(of, name);
      const std::vector<double> numbers = to_numbers(of, whole, whole.shape(), value);
      const bool is_number = whole.numbers() == 1;
      if (is_number && !(numbers.size() == 1 && std::isfinite(numbers[0]))) {
        throw InputError({of.file}, fmt::format("the direction of parameter \"{}\" is one finite "
                                                "number",
                                                whole.name));
      }
      options.parameters.push_back(whole.name);
      options.found.push_back(is_number ? whole : along(of, whole, numbers));
      factors.push_back(is_number ? numbers[0] : 1);
    }
  }

  nb::dict run(const Arguments& given) {
    given.refuse_samples(options.points, {"spp", "seconds", "samples"});
    options.parameters = to_list(names);
    factors.resize(options.parameters.size(), 1);
    find_directions();
    const GradientResult result = result_of([&](const Scene& of, const RunSettings& settings) {
      return gradient(of, options, settings);
    });
    nb::dict estimates;
    for (size_t k = 0; k < result.parameters.size(); ++k) {
      const ParameterGradient& g = result.parameters[k];
      estimates[nb::cast(g.name)] = nb::cast(scaled(to_estimate(g, result, film()), factors[k]));
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
