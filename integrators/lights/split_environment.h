#pragma once
// A map of radiance as the sum of two maps: its small bright patches (the sun), and what is left.
#include <memory>
#include <optional>

#include "limn/core/environment.h"

namespace limn {

// Texels of either are zero where the other has them, so that radiance adds up everywhere, to
// rounding; each draws directions by what it has itself.
struct SplitEnvironment {
  std::shared_ptr<const Environment> patches, rest;
};

// None for an environment that is no map, or has no such patches (bright_patches.h) of at least one
// texel. InputError if memory does not hold two maps more.
std::optional<SplitEnvironment> split_environment(const Environment& environment, int threads);

}  // namespace limn
