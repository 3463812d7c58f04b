#pragma once
// Building the trees of the edge forest.
#include <optional>
#include <span>

#include "edgetree/forest/forest_config.h"
#include "edgetree/forest/forest_fit.h"
#include "edgetree/forest/forest_node.h"
#include "limn/core/bounds.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// Nothing for an edge that no query needs.
std::optional<ForestGroup> group_of(const EdgeMesh& mesh, const Edge& edge, bool cull_concave);
// scale: EdgeSamplerInput::lane_scale.
Wedge wedge_of(const EdgeMesh& mesh, EdgeId id, const Lanes& scale);
Bounds bounds_of(std::span<const Wedge> wedges);
// The frame of a node whose edges fill the box: the cube [-1, 1]^3 holds it.
NodeFrame frame_of(const Bounds& box);

// One tree per object and group that has edges. The result does not depend on `threads`.
Forest build_forest(const EdgeSamplerInput& input, int threads, const ForestConfig& config);

}  // namespace limn
