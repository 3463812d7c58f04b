#pragma once
// Light that reaches the camera by way of smooth lobes, but for flat mirrors whose edges are listed
// (flat_mirrors.h). The edges that it shows are in no term of a derivative.
#include <span>
#include <string>
#include <vector>

#include "integrators/paths/path_context.h"
#include "limn/core/parameter.h"

namespace limn {

struct ChainLight {
  double share = 0;             // of the image's light (luminance), from kChainPaths paths
  std::vector<ShapeId> shapes;  // whose smooth lobes come first on its paths, by their light
};
inline constexpr int kChainPaths = 1 << 14;

// Nothing in scenes without smooth lobes. The same seed gives the same bits.
ChainLight find_chain_light(const PathContext& context, uint64_t seed);

// Whether a parameter moves what is seen: a shape, the camera, a light, or the rays of a smooth
// lobe (an index of refraction).
bool moves_what_is_seen(const Scene& scene, std::span<const Parameter> parameters);

// What a derivative with respect to parameters lacks: "" if nothing. scene: that of the context,
// with no values seeded.
std::string missing_by_chains(const PathContext& context, const Scene& scene,
                              std::span<const Parameter> parameters);

}  // namespace limn
