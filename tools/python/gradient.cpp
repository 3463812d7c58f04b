// Derivative images in forward mode.
#include "limn/integrators/gradient.h"

#include <fmt/format.h>

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

struct GradientCall : RunCall {
  Names names;
  std::vector<std::pair<std::string, nb::object>> directions;  // of names, in their place
  GradientOptions options;

  void take(Arguments& a) {
    add_scene(a, scene);
    a.add(
        {"names", std::string(kNamesType) + " | collections.abc.Mapping[str, " + kArrayType + "]",
         "",
         "of numbers and colours; a vertex is \"object.vertex_positions.7.x\", a field of "
         "vectors from a file \"object.vertex_positions:FILE\". Or {name: direction}, for arrays, "
         "too: finite numbers of the shape Parameter.shape, as (V, 3); copies of a vertex move "
         "together. A number's direction is 1.",
         [this](nb::handle given) {
           if (!nb::hasattr(given, "items")) return void(names = nb::cast<Names>(given));
           const nb::object copied = nb::module_::import_("builtins").attr("dict")(given);
           for (const auto& [name, direction] : nb::cast<nb::dict>(copied))
             directions.emplace_back(nb::cast<std::string>(name), as_array(direction, "float64"));
           names = std::vector<std::string>();
         }});
    add_run(a, request, progress, true);
    visit_options(options, a);
    add_samples(a, options.samples, &options.uniform_samples);
    add_store(a, request);
  }

  void find_directions() {
    const auto held = scene->share();
    const Scene& of = *held;
    for (const auto& [name, value] : directions) {
      const Parameter whole = find_parameter_or_array(of, name);
      const std::vector<double> numbers = to_numbers(of, whole, whole.shape(), value);
      const bool is_number = whole.numbers() == 1;
      if (is_number && !(numbers.size() == 1 && numbers[0] == 1)) {
        throw InputError({of.file},
                         fmt::format("the direction of parameter \"{}\" must be 1, as it "
                                     "is one number: scale its derivative in its place",
                                     whole.name));
      }
      options.parameters.push_back(whole.name);
      options.found.push_back(is_number ? whole : along(of, whole, numbers));
    }
  }

  nb::dict run(const Arguments& given) {
    given.refuse_samples(options.points, {"spp", "seconds", "samples"});
    options.parameters = to_list(names);
    find_directions();
    const GradientResult result = result_of([&](const Scene& of, const RunSettings& settings) {
      return gradient(of, options, settings);
    });
    nb::dict estimates;
    for (const ParameterGradient& g : result.parameters) {
      estimates[nb::cast(g.name)] = nb::cast(to_estimate(g, result, film()));
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
      "Derivative images, float32 (H, W, 3), by parameter: radiance per unit of it, or along its "
      "direction. All are from the same samples.\n\n"
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
