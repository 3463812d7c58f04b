#pragma once
// The table of edge samplers. CONTRIBUTING.md lists the files that a new one touches.
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "limn/core/settings.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// Objects that inputs of a scene at several times have in common, and what a sampler keeps of them
// from one to the next. Not for use by several threads at once.
struct KeptTrees;
struct SharedObjects {
  std::vector<bool> same;  // of the first objects, whether they are the same in all inputs
  std::shared_ptr<KeptTrees> trees = nullptr;
};

// One row per sampler; tests and comparisons loop over them.
struct EdgeSamplerType {
  std::string name;
  std::string description;
  std::unique_ptr<EdgeSampler> (*maker)(const Settings& settings, const EdgeSamplerInput& input,
                                        int threads, SharedObjects* shared);
  Settings settings = {};  // ablations: each turns one of its ideas off or changes it
  // True if light sets (area lights, bright environment patches) are sampled separately: its list
  // of outlines serves them.
  bool regions = false;

  // shared: of the input; may be null.
  std::unique_ptr<EdgeSampler> make(const EdgeSamplerInput& input, int threads,
                                    SharedObjects* shared = nullptr) const {
    return maker(settings, input, threads, shared);
  }
};
// The first is the default.
std::span<const EdgeSamplerType> edge_sampler_types();

// Finds a sampler by name, which may carry settings. InputError lists the known names.
EdgeSamplerType edge_sampler_type(const std::string& name);
std::unique_ptr<EdgeSampler> make_edge_sampler(const std::string& name,
                                               const EdgeSamplerInput& input, int threads);

}  // namespace limn
