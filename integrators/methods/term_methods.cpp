// The table of methods that work term by term.
#include "integrators/methods/term_methods.h"

#include <fmt/format.h>

#include <string>

#include "integrators/lights/closed_light.h"
#include "integrators/lights/direct_light_check.h"
#include "integrators/methods/term_job.h"
#include "integrators/terms/term.h"

namespace limn {
namespace {

// Their first values are those of `adaptive`, or of `silhouettes`.
Settings motion_settings(bool adaptive) {
  const auto values = [&](std::vector<std::string> all) {
    if (!adaptive) std::swap(all[0], all[1]);
    return all;
  };
  return {
      {"directions",
       "Path directions: reparameterised (moving), detached (fixed), or with random motion, which "
       "adds noise but no bias",
       values({"moving", "fixed", "random"})},
      {"film", "Film samples: reparameterised to follow the image motion (moving), or fixed",
       values({"moving", "fixed"})},
      {"spread", "Allocate samples to pixels by their error", values({"on", "off"})},
      {"generator",
       "Sample generator: Owen-scrambled Sobol' points, rescrambled per batch, or independent",
       values({"sobol", "independent"})},
  };
}

// Auxiliary rays go no further than the next surface.
void check_warped(const Scene& scene) {
  const Shape* shape = find_smooth(scene);
  if (!shape) return;
  refuse_light("was", shape->where,
               fmt::format("{}: warped directions are not for smooth or transparent surfaces, this "
                           "is {}: use another method",
                           shape_in_text(*shape), shape->bsdf->describe()));
}

// What the settings make of a method.
TermMethod with_settings(TermMethod method, const Settings& settings) {
  method.sampler.settings.copy_from(settings);
  for (const Setting& setting : settings.list()) {
    const std::string& value = setting.value();
    if (setting.name == "directions") {
      method.moves_directions = value == "moving";
      method.random_directions = value == "random";
    }
    if (setting.name == "film") method.moves_film = value == "moving";
    if (setting.name == "spread") method.spreads_samples = value == "on";
    if (setting.name == "generator") {
      method.numbers = value == "sobol" ? Numbers::kEvenInBatches : Numbers::kIndependent;
    }
    if (setting.name == "bias") method.unbiased = value == "off";
  }
  return method;
}

// Fills in what a row computes.
void set_up(MethodType& row, const TermMethod& given) {
  const TermMethod method = with_settings(given, row.settings);
  row.terms.clear();
  for (const TermType& type : term_types()) {
    if (has_term(method.sampler, type, method.closed, method.moves_film)) {
      row.terms.emplace_back(type.name);
    }
  }
  row.terms_can_be_left_out = !method.or_differences;
  row.only_sum_fixed = method.moves_directions || method.random_directions || method.moves_film ||
                       method.warps || method.closed;
  row.closed_light = method.closed;
  row.warps = method.warps;
  row.differs = method.or_differences;
  row.biased = (method.warps && !method.unbiased) || method.or_differences;
  row.run = [method](const MethodType&, const Scene& scene, const GradientOptions& options,
                     const RunSettings& settings) {
    if (options.points == FilmPoints::kFaces) return run_faces(scene, options, settings);
    if (method.or_differences) return run_fastest(method, scene, options, settings);
    return run_terms(method, scene, options, settings);
  };
  row.trace = [method](const MethodType&, const Scene& scene, const GradientOptions& options,
                       const RunSettings& settings, const NonFinite::SampleId& place) {
    if (options.points == FilmPoints::kFaces) return trace_faces(scene, options, place);
    return trace_terms(method, scene, options, settings, place);
  };
  row.reverse.reset();
  const bool plain = !method.moves_directions && !method.random_directions && !method.moves_film &&
                     !method.spreads_samples && method.numbers == Numbers::kIndependent;
  if (plain && !method.warps) row.reverse = ReverseMethod{method.sampler, method.closed};
}

MethodType method_row(const std::string& name, const std::string& description,
                      const std::string& sampler, TermMethod method, const Settings& own = {}) {
  MethodType row{.name = name, .description = description, .settings = own};
  method.sampler = edge_sampler_type(sampler);
  row.settings.add(method.sampler.settings);
  row.set_up = [method](MethodType& to) { set_up(to, method); };
  return row;
}

}  // namespace

std::vector<MethodType> term_methods() {
  std::vector<MethodType> methods;
  methods.push_back(method_row("adaptive",
                               "silhouettes, with reparameterised directions and film samples, and "
                               "samples allocated by error; in reverse mode forest or "
                               "silhouettes, and samples per term, as a pilot decides",
                               "silhouettes", {}, motion_settings(true)));
  methods.back().defaults = {Task::kGradient, Task::kBackward, Task::kCompare};
  methods.back().set_up = [gradients = methods.back().set_up](MethodType& to) {
    gradients(to);
    to.reverse.reset();
    if (!to.is_variant())
      to.reverse = ReverseMethod{.sampler = edge_sampler_type("silhouettes"), .chooses = true};
  };
  methods.push_back(method_row("fastest",
                               "adaptive, or fd where pilots expect less squared error of it after "
                               "equal time; that is biased, as the output says",
                               "silhouettes", {.or_differences = true}, motion_settings(true)));
  for (const EdgeSamplerType& type : edge_sampler_types()) {
    const bool lists = type.regions;
    methods.push_back(method_row(type.name, type.description, type.name, {},
                                 lists ? motion_settings(false) : Settings()));
  }
  // Of few edges, where surfaces cross and touch, it chooses: any will do, also a static one.
  methods.push_back(method_row(
      "was", "warped-area sampling (Bangaru et al. 2020): auxiliary rays in place of edges",
      "uniform", {.warps = true},
      {{"bias",
        "Use a fixed number of auxiliary rays, which biases the result (on), or remove the bias by "
        "Russian roulette over their number (off)",
        {"on", "off"}}}));
  methods.back().check = check_warped;
  methods.push_back(method_row("analytic",
                               "direct light of flat area lights on diffuse surfaces, in closed "
                               "form: soft shadows without noise",
                               "uniform", {.closed = true}));
  methods.back().check = check_closed_light;
  methods.back().image = ImageMethod{.closed_light = true};
  for (MethodType& row : methods) {
    if (row.name == "forest") row.defaults = {Task::kFit};
    if (row.name != "silhouettes") continue;
    row.description += "; images: the same as lines";
    row.set_up = [gradients = row.set_up](MethodType& to) {
      gradients(to);
      to.image.reset();
      if (!to.is_variant()) to.image = ImageMethod{.looks_around = true, .by_lines = true};
    };
  }
  return methods;
}

}  // namespace limn
