// Costs and single samples of the terms of a run.
#include "tools/limn/run_stats.h"

#include "tools/limn/table.h"

namespace limn {

using nlohmann::json;

json costs_json(const std::vector<TermRun>& terms) {
  json costs = json::object();
  for (const TermRun& term : terms) {
    const TermCost& c = term.cost;
    costs[term.name] = {
        {"seconds", c.seconds},         {"rays", c.rays},
        {"shadow_rays", c.shadow_rays}, {"samples", c.samples},
        {"no_edge", c.no_edge},         {"zero_weight", c.zero_weight},
        {"left_out", c.left_out},       {"occluded", c.occluded},
        {"counted", c.counted},         {"largest_sample_share", c.largest.share()}};
  }
  return costs;
}

json stats_json(const GradientStats& stats) {
  json edges = json::object(), setup = json::object();
  for (const auto& [name, count] : stats.edges) edges[name] = count;
  for (const auto& [name, seconds] : stats.setup) setup[name] = seconds;
  return {{"edges", edges},
          {"sampler_nodes", stats.sampler_nodes},
          {"sampler_bytes", stats.sampler_bytes},
          {"setup_seconds", setup}};
}

void print_stats(const GradientStats& stats, const std::vector<TermRun>& runs) {
  for (const auto& [name, count] : stats.edges) fmt::print("edges {}: {}\n", name, count);
  if (stats.sampler_nodes > 0) {
    fmt::print("edge sampler: {} nodes, {:.3g} MB\n", stats.sampler_nodes,
               static_cast<double>(stats.sampler_bytes) / 1e6);
  }
  Table terms({{"term", true},
               {"samples"},
               {"rays to surfaces"},
               {"shadow rays"},
               {"time of all threads [s]"}});
  for (const TermRun& term : runs) {
    const TermCost& c = term.cost;
    if (c.samples == 0) continue;
    terms.add({term.name, std::to_string(c.samples), std::to_string(c.rays - c.shadow_rays),
               std::to_string(c.shadow_rays), fmt::format("{:.3g}", c.seconds)});
  }
  Table setup({{"set-up", true}, {"time [s]"}});
  for (const auto& [name, seconds] : stats.setup) setup.add({name, fmt::format("{:.3g}", seconds)});
  fmt::print("\n{}\n{}", terms.text(), setup.text());
}

// From this share of the sum of squares of a term's samples on, one is an outlier. Not tuned.
constexpr double kRulingShare = 0.1;

void print_largest(const std::vector<TermRun>& terms, int64_t spp, const std::string& command_line,
                   bool all) {
  for (const TermRun& term : terms) {
    const LargestSample& largest = term.cost.largest;
    if (!term.computed || largest.square == 0) continue;
    if (!all && largest.share() < kRulingShare) continue;
    NonFinite::SampleId place = largest.place;
    if (place.x < 0) place.term = term.name;
    fmt::print("{}: one sample is {:.0f} % of the sum of squares (an outlier): {}\n", term.name,
               100 * largest.share(),
               place.x >= 0
                   ? fmt::format("pixel ({}, {}), sample {}", place.x, place.y, place.sample)
                   : fmt::format("sample {} of {} samples per pixel", place.sample, spp));
    if (!command_line.empty()) fmt::print("  trace: {}\n", repeat_command(command_line, place));
  }
}

}  // namespace limn
