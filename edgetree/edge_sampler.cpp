#include "limn/edgetree/edge_sampler.h"

#include "limn/core/error.h"
#include "samplers.h"

namespace limn {

std::span<const EdgeSamplerType> edge_sampler_types() {
  static const EdgeSamplerType types[] = {
      {"forest", "4-wide trees that reject what holds no silhouette", make_forest_sampler},
      {"brute", "lists every candidate and draws by a bound of its contribution (the oracle)",
       make_brute_force_sampler},
      {"li2019", "the tree of Li et al. 2018 over positions and Hough-transformed planes",
       make_li2019_sampler},
      {"uniform", "any edge of the scene, any point on it", make_uniform_sampler},
  };
  return types;
}

std::unique_ptr<EdgeSampler> make_edge_sampler(const std::string& name,
                                               const EdgeSamplerInput& input, int threads) {
  std::string known;
  for (const EdgeSamplerType& type : edge_sampler_types()) {
    if (type.name == name) return type.make(input, threads);
    known += (known.empty() ? "" : ", ") + type.name;
  }
  throw InputError("unknown edge sampler \"" + name + "\" (known: " + known + ")");
}

}  // namespace limn
