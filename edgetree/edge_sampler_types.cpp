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
      {"width", "Children per node", {"8", "4", "2"}},
      {"look-ahead",
       fmt::format("Two-level importance: which children are weighted by their own children. low: "
                   "those of height at most {}; edges: those whose children are edges",
                   standard.look_ahead),
       {"low", "none", "edges", "all"}},
      {"expansion",
       "Expand top nodes per query where the lobe is narrow or the shading point is near",
       {"on", "off"}},
      {"axes",
       "Orientation of dual boxes: the principal axes of a node's planes, or arbitrary axes",
       {"principal", "any"}},
      {"weights",
       "Weight of children that are not rejected. soft: by how the query plane cuts the dual box; "
       "hard: by length and distance only",
       {"soft", "hard"}},
      {"motion",
       "Speed of edges in weights: normal to the plane through edge and shading point (across), or "
       "of any direction",
       {"across", "any"}},
      {"concave",
       "Keep concave edges of closed one-sided meshes, which cannot be silhouettes",
       {"off", "on"}},
      {"lights", "Weights include the radiance of emitters behind the edges", {"on", "off"}},
      {"environment", "Weights include the radiance of a non-uniform environment", {"on", "off"}},
  };
}

std::unique_ptr<EdgeSampler> make_forest(const Settings& settings, const EdgeSamplerInput& input,
                                         int threads, SharedObjects* shared) {
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
  return EdgeForest::build(input, threads, config, shared);
}

std::unique_ptr<EdgeSampler> make_quadric(const Settings& settings, const EdgeSamplerInput& input,
                                          int threads, SharedObjects*) {
  QuadricConfig config;
  config.quadrics = settings.on("quadrics");
  config.light_term = settings.on("lights");
  config.cull_concave = !settings.on("concave");
  return QuadricSampler::build(input, threads, config);
}

std::unique_ptr<EdgeSampler> make_li2019(const Settings& settings, const EdgeSamplerInput& input,
                                         int, SharedObjects*) {
  return make_li2019_sampler(input, settings["sphere"] == "solid");
}

std::unique_ptr<EdgeSampler> make_brute_force(const Settings& settings,
                                              const EdgeSamplerInput& input, int threads,
                                              SharedObjects*) {
  return settings["search"] == "list" ? make_brute_force_sampler(input, threads)
                                      : make_dual_bvh_sampler(input, threads);
}

std::unique_ptr<EdgeSampler> make_uniform(const Settings&, const EdgeSamplerInput& input,
                                          int threads, SharedObjects*) {
  return make_uniform_sampler(input, threads);
}

}  // namespace

std::span<const EdgeSamplerType> edge_sampler_types() {
  static const EdgeSamplerType types[] = {
      {"forest", "limn's trees of edges, 8-wide, which reject nodes without a silhouette",
       make_forest, forest_settings()},
      {"silhouettes",
       "forest, and a list of all silhouettes in front of area lights and bright environment "
       "patches",
       make_forest, forest_settings(), true},
      {"brute",
       "tests every edge, and samples candidates by a bound on their contribution (the oracle)",
       make_brute_force,
       {{"search",
         "Search for candidates: all edges in turn, or the hierarchy of Nowrouzezahrai et al. 2014",
         {"list", "dual-bvh"}}}},
      {"li2019",
       "the edge trees of Li et al. 2018, over positions and Hough-transformed planes",
       make_li2019,
       {{"sphere",
         "Hough test of a node: against the sphere's surface, or against the solid sphere as "
         "redner does by mistake",
         {"surface", "solid"}}}},
      {"quadric",
       "the forest of Soroka et al. 2025: 4-wide, with dual boxes and pairs of quadrics",
       make_quadric,
       {{"quadrics", "Bound nodes by pairs of quadrics in addition to dual boxes", {"on", "off"}},
        {"lights", "Weights include the radiance of emitters behind the edges", {"on", "off"}},
        {"concave",
         "Keep concave edges of closed one-sided meshes, which cannot be silhouettes",
         {"off", "on"}}}},
      {"uniform", "all edges of the scene alike, and all points on an edge alike", make_uniform},
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
