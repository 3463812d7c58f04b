#pragma once
// An experiment: the edge forest with leaves of many edges in place of nodes of edges.
#include <memory>

#include "edgetree/bounds/forest_config.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// What leaves hold, of the edges that the forest keeps: those of one node of edges (up to 8), or
// all below an inner node whose children are nodes of edges (up to 64).
enum class LeafSize { k8, k64 };

// A leaf keeps its frame and the numbers of its edges alone: planes, ends and lengths are taken
// from the mesh whenever a draw gets there, and all of its edges are weighed. Leaves of 64 are not
// looked ahead at, which would take several times as long. Leaves of 8 draw as the forest does that
// opens no nodes (ForestConfig::most_open 0). Of meshes at rest, without crossings, lights and
// environment; the input must outlive it.
std::unique_ptr<EdgeSampler> make_leaf_forest(const EdgeSamplerInput& input, int threads,
                                              LeafSize size, const ForestConfig& config);

}  // namespace limn
