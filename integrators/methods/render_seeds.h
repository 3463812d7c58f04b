#pragma once
// Images of one scene by several seeds: what they are made with is built once.
#include <span>
#include <vector>

#include "limn/core/scene.h"
#include "limn/integrators/render.h"

namespace limn {

// Each has the bits of render() with this seed in place of settings.seed, and takes no part of a
// store. A limit of time is that of each, with its share of the set-up; its samples are then as
// many as fit. InputError as render(). Not for methods that look around.
std::vector<RenderResult> render_seeds(const Scene& scene, const RunSettings& settings,
                                       std::span<const uint64_t> seeds,
                                       const RenderOptions& options);

}  // namespace limn
