#pragma once
// One factory per sampler, for the table in edge_sampler.cpp.
#include <memory>

#include "limn/edgetree/edge_sampler.h"

namespace limn {

std::unique_ptr<EdgeSampler> make_brute_force_sampler(const EdgeSamplerInput& input, int threads);
std::unique_ptr<EdgeSampler> make_li2019_sampler(const EdgeSamplerInput& input, int threads);
std::unique_ptr<EdgeSampler> make_uniform_sampler(const EdgeSamplerInput& input, int threads);

// Whether the query's own face is among those around the edge.
inline bool is_own_edge(const EdgeSamplerInput& input, const EdgeQuery& query, EdgeId id) {
  if (id.object != query.object || query.face == kNoFace) return false;
  for (uint32_t face : input.objects[id.object].faces_around(id.edge))
    if (face == query.face) return true;
  return false;
}

}  // namespace limn
