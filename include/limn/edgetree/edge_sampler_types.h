#pragma once
// The table of edge samplers. CONTRIBUTING.md lists the files that a new one touches.
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
  // True for an ablation: a sampler without one of its ideas, to measure what the idea is worth.
  bool ablation = false;
  // True if light sets (area lights, bright environment patches) are sampled separately: its list
  // of outlines serves them.
  bool regions = false;
};
std::span<const EdgeSamplerType> edge_sampler_types();

// The default sampler.
const EdgeSamplerType& default_edge_sampler();

// Finds a sampler by name. InputError lists the known names.
const EdgeSamplerType& edge_sampler_type(const std::string& name);
std::unique_ptr<EdgeSampler> make_edge_sampler(const std::string& name,
                                               const EdgeSamplerInput& input, int threads);

}  // namespace limn
