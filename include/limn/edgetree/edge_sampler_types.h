#pragma once
// The table of edge samplers. A new one is its .cpp and .h in edgetree/, and a row here.
#include <memory>
#include <span>
#include <string>

#include "limn/edgetree/edge_sampler.h"

namespace limn {

// One row per sampler; tests and comparisons loop over them.
struct EdgeSamplerType {
  std::string name;
  std::string description;
  std::unique_ptr<EdgeSampler> (*make)(const EdgeSamplerInput& input, int threads);
  // A sampler with one idea taken out, which shows what the idea is worth: of no use but for that.
  bool ablation = false;
  // Regions of light (lamps, bright patches of the environment) are kept apart from what it chooses
  // by: its list of outlines serves them.
  bool regions = false;
};
std::span<const EdgeSamplerType> edge_sampler_types();

// What is used where nothing else is asked for.
const EdgeSamplerType& default_edge_sampler();

// InputError that lists the known names if there is none of this name.
const EdgeSamplerType& edge_sampler_type(const std::string& name);
std::unique_ptr<EdgeSampler> make_edge_sampler(const std::string& name,
                                               const EdgeSamplerInput& input, int threads);

}  // namespace limn
