// The table of methods that work term by term.
#include "integrators/methods/term_methods.h"

#include <string>

#include "integrators/lights/closed_light.h"
#include "integrators/methods/faces_method.h"
#include "integrators/methods/term_job.h"
#include "integrators/terms/term.h"

namespace limn {
namespace {

MethodType method_row(const std::string& name, const std::string& description,
                      const TermMethod& term_method) {
  MethodType method;
  method.name = name;
  method.description = description;
  for (const TermType& type : term_types()) {
    if (has_term(term_method.sampler, type, term_method.closed, term_method.moves_film))
      method.terms.emplace_back(type.name);
  }
  method.terms_can_be_left_out = true;
  method.ablation = term_method.sampler.ablation || term_method.ablation;
  method.only_sum_fixed = term_method.moves_directions || term_method.random_directions ||
                          term_method.warps || term_method.closed;
  method.closed_light = term_method.closed;
  method.warps = term_method.warps;
  method.biased = term_method.warps && !term_method.unbiased;
  method.run = [term_method](const MethodType&, const Scene& scene, const GradientOptions& options,
                             const RunSettings& settings) {
    if (options.points == FilmPoints::kFaces) return run_faces(scene, options, settings);
    return run_terms(term_method, scene, options, settings);
  };
  method.trace = [term_method](const MethodType&, const Scene& scene,
                               const GradientOptions& options, const RunSettings& settings,
                               const NonFinite::Place& place) {
    if (options.points == FilmPoints::kFaces) return trace_faces(scene, options, place);
    return trace_terms(term_method, scene, options, settings, place);
  };
  return method;
}

}  // namespace

std::vector<MethodType> term_methods() {
  const EdgeSamplerType& silhouettes = edge_sampler_type("silhouettes");
  std::vector<MethodType> methods;
  methods.push_back(
      method_row("adaptive",
                 "silhouettes, with directions and positions on the film that move along with what "
                 "they see and samples where the error is",
                 {.sampler = silhouettes,
                  .moves_directions = true,
                  .spreads_samples = true,
                  .moves_film = true,
                  .numbers = Numbers::kEvenInBatches}));
  methods.push_back(method_row("independent-numbers",
                               "adaptive, with random numbers of samples that are independent",
                               {.sampler = silhouettes,
                                .moves_directions = true,
                                .spreads_samples = true,
                                .moves_film = true,
                                .ablation = true}));
  methods.push_back(method_row("held-positions",
                               "independent-numbers, with positions on the film held",
                               {.sampler = silhouettes,
                                .moves_directions = true,
                                .spreads_samples = true,
                                .ablation = true}));
  methods.push_back(method_row("moving-directions",
                               "silhouettes, with directions that move along with what they see",
                               {.sampler = silhouettes, .moves_directions = true}));
  for (const EdgeSamplerType& type : edge_sampler_types()) {
    methods.push_back(method_row(type.name, type.description, {type}));
  }
  // It chooses among few edges, where surfaces cross and touch: any will do, also one at rest.
  const EdgeSamplerType& uniform = edge_sampler_type("uniform");
  methods.push_back(method_row("was",
                               "warped-area sampling (Bangaru et al. 2020): auxiliary rays in "
                               "place of edges; biased, the less the more rays",
                               {.sampler = uniform, .warps = true}));
  methods.push_back(method_row("was-unbiased",
                               "warped-area sampling without bias, by roulette over numbers of "
                               "auxiliary rays",
                               {.sampler = uniform, .warps = true, .unbiased = true}));
  methods.push_back(method_row("analytic",
                               "direct light of flat lamps on diffuse surfaces in closed form: "
                               "soft shadows without noise",
                               {.sampler = uniform, .closed = true}));
  methods.back().check = check_closed_light;
  methods.push_back(method_row(
      "random-directions",
      "silhouettes, with directions and positions on the film that move by "
      "chance: noise, but the same mean",
      {.sampler = silhouettes, .moves_film = true, .random_directions = true, .ablation = true}));
  return methods;
}

}  // namespace limn
