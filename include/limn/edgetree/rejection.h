#pragma once
// Statistics of a sampler's rejection test compared with the exact test of every edge. E(p), the
// set of edges across which radiance may be discontinuous, is defined in edges.h.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "limn/edgetree/edge_sampler.h"

namespace limn {

// The outcome for a node. True or false: whether the verdict agrees with the exact test of its
// edges. kMissed: rejected although it holds an edge of E(p), an error of the sampler.
enum class NodeVerdict : uint8_t { kTrueReject, kTrueAccept, kFalseAccept, kMissed };
inline constexpr int kVerdicts = 4;
using VerdictCounts = std::array<uint64_t, kVerdicts>;

// Applies the node's own test, regardless of its ancestors.
NodeVerdict judge(const EdgeSamplerInput& input, const RejectionTree& tree, uint32_t node,
                  const Vec3d& p);

// A square of points: center + a * right + b * up with a, b in [-1, 1]; b = 1 is the top.
struct Slice {
  Vec3d center, right, up;  // orthogonal and of equal length
  int size = 0;             // rows of `size` pixels
  // The point at a position in pixels; pixel centers have fractions of one half.
  Vec3d point(double x, double y) const {
    return center + right * (2 * x / size - 1) + up * (1 - 2 * y / size);
  }
};
// Verdicts at the pixel centers, row 0 on top.
std::vector<NodeVerdict> judge_slice(const EdgeSamplerInput& input, const RejectionTree& tree,
                                     uint32_t node, const Slice& slice, int threads);
VerdictCounts count(std::span<const NodeVerdict> verdicts);

// Counts of nodes at one depth. A node is tested if its parent was accepted.
struct DepthCounts {
  uint64_t tested = 0, accepted = 0;
  uint64_t false_accepts = 0;  // accepted without an edge of E(p) below
  uint64_t missed = 0;         // rejected with an edge of E(p) below
};

// Everything that descents from one point can reach if they visit all accepted nodes.
struct Reach {
  std::vector<EdgeRef> silhouettes;    // reachable edges in E(p)
  std::vector<EdgeRef> false_accepts;  // reachable edges not in E(p)
  std::vector<EdgeRef> missed;         // unreachable edges in E(p)
  std::vector<DepthCounts> by_depth;   // [0] is depth 1
};
Reach reach_from(const EdgeSamplerInput& input, const RejectionTree& tree, const Vec3d& p);

// Sums of Reach over points.
struct ReachCounts {
  uint64_t points = 0, silhouettes = 0, false_accepts = 0, missed = 0;
  std::vector<DepthCounts> by_depth;
};
ReachCounts count_reach(const EdgeSamplerInput& input, const RejectionTree& tree,
                        std::span<const EdgeQuery> queries, int threads);

// Diffuse query points at 1.5 times the bounding radius around an object, evenly distributed over
// directions and facing its center. The object translates relative to each, in a different
// direction every time.
std::vector<EdgeQuery> queries_around(const EdgeMesh& mesh, int count, uint64_t seed);
Vec3d random_direction(Rng& rng);  // uniform
// Of the sphere around the center of its bounds that holds all edges.
double radius_of(const EdgeMesh& mesh);

// Acceptance rate: the fraction of draws that return an edge of E(p), and its standard error over
// the queries, each with `draws` draws.
struct AcceptanceRate {
  double mean = 0, standard_error = 0;
};
AcceptanceRate acceptance_rate(const EdgeSampler& sampler, std::span<const EdgeQuery> queries,
                               int draws, uint64_t seed, int threads);

// A node with about `edges` edges (within a factor of 3/2, or else the nearest number) that holds
// edges of E(p) for about half of the queries: curved enough to be accepted often, flat enough to
// be rejected often. The tree must have a node.
uint32_t balanced_node(const EdgeSamplerInput& input, const RejectionTree& tree, uint32_t edges,
                       std::span<const EdgeQuery> queries);

// The node with the best agreement with a set of edges: intersection over union.
struct Match {
  uint32_t node = 0;
  double overlap = 0;  // intersection over union, in [0, 1]
};
Match best_match(const EdgeSamplerInput& input, const RejectionTree& tree,
                 std::span<const EdgeRef> edges);

// A surface patch with orthonormal axes.
struct Patch {
  Vec3d center;        // center of the bounds of its edges
  double radius;       // half the diagonal of the bounds
  Vec3d normal;        // mean of the faces around its edges
  Vec3d bend, across;  // the tangents along which normals vary most and least
};
Patch patch_of(const EdgeSamplerInput& input, std::span<const EdgeRef> edges);

// Two parallel squares of half-width `extent`, with the patch's normal up and bend to the right:
// one through its center, the other displaced by `distance` along `across`.
std::array<Slice, 2> slices_around(const Patch& patch, double extent, double distance, int size);

}  // namespace limn
