#pragma once
// The table of edge samplers. CONTRIBUTING.md lists the files that a new one touches.
#include <memory>
#include <span>
#include <string>

#include "limn/core/settings.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// One row per sampler; tests and comparisons loop over them.
struct EdgeSamplerType {
  std::string name;
  std::string description;
  std::unique_ptr<EdgeSampler> (*maker)(const Settings& settings, const EdgeSamplerInput& input,
                                        int threads);
  Settings settings = {};  // ablations: each turns one of its ideas off or changes it
  // True if light sets (area lights, bright environment patches) are sampled separately: its list
  // of outlines serves them.
  bool regions = false;

  std::unique_ptr<EdgeSampler> make(const EdgeSamplerInput& input, int threads) const {
    return maker(settings, input, threads);
  }
};
// The first is the default.
std::span<const EdgeSamplerType> edge_sampler_types();

// Finds a sampler by name, which may carry settings. InputError lists the known names.
EdgeSamplerType edge_sampler_type(const std::string& name);
std::unique_ptr<EdgeSampler> make_edge_sampler(const std::string& name,
                                               const EdgeSamplerInput& input, int threads);

}  // namespace limn
