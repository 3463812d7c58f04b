#include "limn/edgetree/edge_sampler.h"

#include "edgetree/samplers.h"
#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/edgetree/edge_forest.h"

namespace limn {

namespace {

template <ForestConfig kConfig>
std::unique_ptr<EdgeSampler> make_forest(const EdgeSamplerInput& input, int threads) {
  return EdgeForest::build(input, threads, kConfig);
}

}  // namespace

std::span<const EdgeSamplerType> edge_sampler_types() {
  static const EdgeSamplerType types[] = {
      {"forest", "8-wide trees that reject what holds no silhouette", make_forest<ForestConfig{}>},
      {"brute", "lists every candidate and draws by a bound of its contribution (the oracle)",
       make_brute_force_sampler},
      {"li2019", "the tree of Li et al. 2018 over positions and Hough-transformed planes",
       make_li2019_sampler},
      {"forest-2", "forest of two children a node, chosen without a look at theirs",
       make_forest<ForestConfig{.width = 2, .look_ahead = -1}>},
      {"forest-4", "forest of four children a node, chosen without a look at theirs",
       make_forest<ForestConfig{.width = 4, .look_ahead = -1}>},
      {"forest-16", "forest of four children a node, chosen with a look at all of theirs",
       make_forest<ForestConfig{.width = 4, .look_ahead = ForestConfig::kAnyHeight}>},
      {"forest-64", "forest that chooses with a look at all grandchildren",
       make_forest<ForestConfig{.look_ahead = ForestConfig::kAnyHeight}>},
      {"forest-any-axes", "forest with dual boxes along any axes",
       make_forest<ForestConfig{.principal_axes = false}>},
      {"forest-hard", "forest whose children weigh by length and distance or are rejected",
       make_forest<ForestConfig{.soft_weights = false}>},
      {"forest-concave", "forest that keeps concave edges",
       make_forest<ForestConfig{.cull_concave = false}>},
      {"forest-no-lights", "forest whose weights ignore where the lights are",
       make_forest<ForestConfig{.light_term = false}>},
      {"forest-no-environment", "forest whose weights take the environment for uniform",
       make_forest<ForestConfig{.environment_term = false}>},
      {"uniform", "any edge of the scene, any point on it", make_uniform_sampler},
  };
  return types;
}

std::unique_ptr<EdgeSampler> make_edge_sampler(const std::string& name,
                                               const EdgeSamplerInput& input, int threads) {
  for (const EdgeSamplerType& type : edge_sampler_types()) {
    if (type.name == name) return type.make(input, threads);
  }
  throw InputError(unknown_name("edge sampler", name, names_of(edge_sampler_types())));
}

}  // namespace limn
