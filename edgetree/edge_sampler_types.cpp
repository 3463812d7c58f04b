// The table of edge samplers.
#include "limn/edgetree/edge_sampler_types.h"

#include <fmt/format.h>

#include "edgetree/baselines/baselines.h"
#include "edgetree/forest/edge_forest.h"
#include "edgetree/quadric/quadric_sampler.h"

namespace limn {
namespace {

Settings forest_settings() {
  const ForestConfig standard;
  return {
      {"width", "Children of a node", {"8", "4", "2"}},
      {"look-ahead",
       fmt::format("Which children weigh by the lengths that their own children expect: those of "
                   "height up to {} (low), none, those that hold edges, or all",
                   standard.look_ahead),
       {"low", "none", "edges", "all"}},
      {"expansion", "Nodes are expanded where the lobe is narrow or the point near", {"on", "off"}},
      {"axes",
       "Dual boxes along the principal axes of a node's planes, or along any",
       {"principal", "any"}},
      {"weights",
       "Children weigh by how deep the query plane cuts their dual box (soft); or by "
       "length and distance alone unless rejected (hard)",
       {"soft", "hard"}},
      {"motion",
       "Weights count motion across the line of sight, or in any direction",
       {"across", "any"}},
      {"concave", "Concave edges of closed one-sided meshes are kept", {"off", "on"}},
      {"lights", "Weights follow where the lights are", {"on", "off"}},
      {"environment", "Weights follow an environment that is not uniform", {"on", "off"}},
  };
}

std::unique_ptr<EdgeSampler> make_forest(const Settings& settings, const EdgeSamplerInput& input,
                                         int threads) {
  ForestConfig config;
  config.width = static_cast<uint32_t>(std::stoi(settings["width"]));
  const std::string& ahead = settings["look-ahead"];
  if (ahead == "none") config.look_ahead = ForestConfig::kNoHeight;
  if (ahead == "edges") config.look_ahead = ForestConfig::kEdgesOnly;
  if (ahead == "all") config.look_ahead = ForestConfig::kAnyHeight;
  if (!settings.on("expansion")) config.most_open = 0;
  config.principal_axes = settings["axes"] == "principal";
  config.soft_weights = settings["weights"] == "soft";
  config.normal_speed = settings["motion"] == "across";
  config.cull_concave = !settings.on("concave");
  config.light_term = settings.on("lights");
  config.environment_term = settings.on("environment");
  return EdgeForest::build(input, threads, config);
}

std::unique_ptr<EdgeSampler> make_quadric(const Settings& settings, const EdgeSamplerInput& input,
                                          int threads) {
  QuadricConfig config;
  config.quadrics = settings.on("quadrics");
  config.light_term = settings.on("lights");
  config.cull_concave = !settings.on("concave");
  return QuadricSampler::build(input, threads, config);
}

std::unique_ptr<EdgeSampler> make_li2019(const Settings& settings, const EdgeSamplerInput& input,
                                         int) {
  return make_li2019_sampler(input, settings["sphere"] == "solid");
}

std::unique_ptr<EdgeSampler> make_brute_force(const Settings& settings,
                                              const EdgeSamplerInput& input, int threads) {
  return settings["search"] == "list" ? make_brute_force_sampler(input, threads)
                                      : make_dual_bvh_sampler(input, threads);
}

std::unique_ptr<EdgeSampler> make_uniform(const Settings&, const EdgeSamplerInput& input,
                                          int threads) {
  return make_uniform_sampler(input, threads);
}

}  // namespace

std::span<const EdgeSamplerType> edge_sampler_types() {
  static const EdgeSamplerType types[] = {
      {"forest", "8-wide trees that reject nodes without a silhouette", make_forest,
       forest_settings()},
      {"silhouettes",
       "the edge forest, which also lists all silhouettes in front of area lights and bright "
       "environment patches",
       make_forest, forest_settings(), true},
      {"brute",
       "lists every candidate and draws by a bound of its contribution (the oracle)",
       make_brute_force,
       {{"search",
         "How candidates are found: one by one, or by a hierarchy over pairs of planes",
         {"list", "dual-bvh"}}}},
      {"li2019",
       "the tree of Li et al. 2018 over positions and Hough-transformed planes",
       make_li2019,
       {{"sphere",
         "The planes through a point are a sphere's surface; solid is redner's mistake",
         {"surface", "solid"}}}},
      {"quadric",
       "the forest of Soroka et al. 2025: 4-wide, dual boxes and pairs of quadrics",
       make_quadric,
       {{"quadrics",
         "Nodes have pairs of bounding quadrics beside their dual boxes",
         {"on", "off"}},
        {"lights", "Weights follow where the lights are", {"on", "off"}},
        {"concave", "Concave edges of closed one-sided meshes are kept", {"off", "on"}}}},
      {"uniform", "any edge of the scene, any point on it", make_uniform},
  };
  return types;
}

EdgeSamplerType edge_sampler_type(const std::string& name) {
  return find_row("edge sampler", name, edge_sampler_types());
}

std::unique_ptr<EdgeSampler> make_edge_sampler(const std::string& name,
                                               const EdgeSamplerInput& input, int threads) {
  return edge_sampler_type(name).make(input, threads);
}

}  // namespace limn
