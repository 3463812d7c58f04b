#pragma once
// Factories of this folder's samplers, for the table in edge_sampler_types.cpp.
#include <memory>

#include "limn/edgetree/edge_sampler.h"

namespace limn {

std::unique_ptr<EdgeSampler> make_brute_force_sampler(const EdgeSamplerInput& input, int threads);
std::unique_ptr<EdgeSampler> make_dual_bvh_sampler(const EdgeSamplerInput& input, int threads);
// solid: with the mistake of redner, see li2019_sampler.cpp.
std::unique_ptr<EdgeSampler> make_li2019_sampler(const EdgeSamplerInput& input, bool solid);
std::unique_ptr<EdgeSampler> make_uniform_sampler(const EdgeSamplerInput& input, int threads);

}  // namespace limn
