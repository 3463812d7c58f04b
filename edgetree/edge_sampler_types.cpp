// The table of edge samplers.
#include "limn/edgetree/edge_sampler_types.h"

#include "edgetree/baselines/baselines.h"
#include "edgetree/forest/edge_forest.h"
#include "edgetree/quadric/quadric_sampler.h"
#include "limn/core/error.h"
#include "limn/core/names.h"

namespace limn {
namespace {

template <ForestConfig kConfig>
std::unique_ptr<EdgeSampler> make_forest(const EdgeSamplerInput& input, int threads) {
  return EdgeForest::build(input, threads, kConfig);
}

template <QuadricConfig kConfig>
std::unique_ptr<EdgeSampler> make_quadric(const EdgeSamplerInput& input, int threads) {
  return QuadricSampler::build(input, threads, kConfig);
}

constexpr int kNoHeight = ForestConfig::kNoHeight, kEdgesOnly = ForestConfig::kEdgesOnly,
              kAnyHeight = ForestConfig::kAnyHeight;
constexpr bool kAblation = true;

}  // namespace

std::span<const EdgeSamplerType> edge_sampler_types() {
  static const EdgeSamplerType types[] = {
      {"forest", "8-wide trees that reject what holds no silhouette", make_forest<ForestConfig{}>},
      {"silhouettes", "forest, and all silhouettes before lamps and the sun, listed by it",
       make_forest<ForestConfig{}>, false, true},
      {"brute", "lists every candidate and draws by a bound of its contribution (the oracle)",
       make_brute_force_sampler},
      {"li2019", "the tree of Li et al. 2018 over positions and Hough-transformed planes",
       make_li2019_sampler},
      {"quadric", "the forest of Soroka et al. 2025: 4-wide, dual boxes and pairs of quadrics",
       make_quadric<QuadricConfig{}>},
      {"uniform", "any edge of the scene, any point on it", make_uniform_sampler},
      {"forest-look-ahead-none", "forest whose children are chosen without a look at theirs",
       make_forest<ForestConfig{.look_ahead = kNoHeight}>, kAblation},
      {"forest-look-ahead-edges", "forest that looks ahead at nodes of edges alone",
       make_forest<ForestConfig{.look_ahead = kEdgesOnly}>, kAblation},
      {"forest-look-ahead-all", "forest that looks ahead at all nodes",
       make_forest<ForestConfig{.look_ahead = kAnyHeight}>, kAblation},
      {"forest-width-2-look-ahead-none", "forest of two children a node, without a look at theirs",
       make_forest<ForestConfig{.width = 2, .look_ahead = kNoHeight}>, kAblation},
      {"forest-width-4-look-ahead-none", "forest of four children a node, without a look at theirs",
       make_forest<ForestConfig{.width = 4, .look_ahead = kNoHeight}>, kAblation},
      {"forest-width-4-look-ahead-all",
       "forest of four children a node that looks ahead at all nodes",
       make_forest<ForestConfig{.width = 4, .look_ahead = kAnyHeight}>, kAblation},
      {"forest-closed", "forest that opens no nodes for narrow lobes and near points",
       make_forest<ForestConfig{.most_open = 0}>, kAblation},
      {"forest-any-axes", "forest with dual boxes along any axes",
       make_forest<ForestConfig{.principal_axes = false}>, kAblation},
      {"forest-hard-weights", "forest whose children weigh by length and distance or are rejected",
       make_forest<ForestConfig{.soft_weights = false}>, kAblation},
      {"forest-plain", "forest with dual boxes along any axes, hard weights and no look ahead",
       make_forest<ForestConfig{.principal_axes = false,
                                .soft_weights = false,
                                .look_ahead = kNoHeight,
                                .most_open = 0}>,
       kAblation},
      {"forest-any-motion", "forest whose weights count motion along the line of sight, too",
       make_forest<ForestConfig{.normal_speed = false}>, kAblation},
      {"forest-quadrics", "forest whose nodes of 32 to 8192 edges all have a pair of quadrics",
       make_forest<ForestConfig{.quadrics = ForestConfig::Quadrics::kAll}>, kAblation},
      {"forest-concave", "forest that keeps concave edges",
       make_forest<ForestConfig{.cull_concave = false}>, kAblation},
      {"forest-no-lights", "forest whose weights ignore where the lights are",
       make_forest<ForestConfig{.light_term = false}>, kAblation},
      {"forest-no-environment", "forest whose weights take the environment for uniform",
       make_forest<ForestConfig{.environment_term = false}>, kAblation},
      {"dual-bvh", "brute that finds its candidates by a hierarchy over pairs of planes in 4D",
       make_dual_bvh_sampler, kAblation},
      {"li2019-solid", "li2019 with the mistake of redner, whose sphere of planes is solid",
       make_li2019_solid_sampler, kAblation},
      {"quadric-box", "quadric without the pairs of quadrics",
       make_quadric<QuadricConfig{.quadrics = false}>, kAblation},
      {"quadric-no-lights", "quadric whose weights ignore where the lights are",
       make_quadric<QuadricConfig{.light_term = false}>, kAblation},
      {"quadric-concave", "quadric that keeps concave edges",
       make_quadric<QuadricConfig{.cull_concave = false}>, kAblation},
  };
  return types;
}

const EdgeSamplerType& default_edge_sampler() { return edge_sampler_types().front(); }

const EdgeSamplerType& edge_sampler_type(const std::string& name) {
  for (const EdgeSamplerType& type : edge_sampler_types()) {
    if (type.name == name) return type;
  }
  throw InputError(unknown_name("edge sampler", name, names_of(edge_sampler_types())));
}

std::unique_ptr<EdgeSampler> make_edge_sampler(const std::string& name,
                                               const EdgeSamplerInput& input, int threads) {
  return edge_sampler_type(name).make(input, threads);
}

}  // namespace limn
