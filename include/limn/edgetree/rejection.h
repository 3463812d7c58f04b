#pragma once
// How well a sampler's rejection test does: against the exact test of every edge, in numbers. E(p),
// the edges across which radiance may jump as seen from p, is what edges.h defines.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "limn/edgetree/edge_sampler.h"

namespace limn {

// The node is rejected and holds no edge of E(p); accepted and holds one; accepted and holds none;
// rejected although it holds one, which is an error of the sampler.
enum class Verdict : uint8_t { kTrueReject, kTrueAccept, kFalseAccept, kMissed };
inline constexpr int kVerdicts = 4;
using VerdictCounts = std::array<uint64_t, kVerdicts>;

// By the node's own test, whatever its parents say.
Verdict judge(const EdgeSamplerInput& input, const RejectionTree& tree, uint32_t node,
              const Vec3d& p);

// A square of points: center + a * right + b * up with a, b in [-1, 1], b = 1 on top.
struct Slice {
  Vec3d center, right, up;  // right, up: of equal length, at right angles
  int size = 0;             // rows of `size` pixels
  // The point at a position in pixels; those of centers are halves.
  Vec3d point(double x, double y) const {
    return center + right * (2 * x / size - 1) + up * (1 - 2 * y / size);
  }
};
// At the centers of the pixels, row 0 on top.
std::vector<Verdict> judge_slice(const EdgeSamplerInput& input, const RejectionTree& tree,
                                 uint32_t node, const Slice& slice, int threads);
VerdictCounts count(std::span<const Verdict> verdicts);

// Nodes at one depth. Tested: those whose parent was accepted.
struct DepthCounts {
  uint64_t tested = 0, accepted = 0;
  uint64_t false_accepts = 0;  // accepted without an edge of E(p) below
  uint64_t missed = 0;         // rejected with an edge of E(p) below
};

// All that descents from one point can meet, if they go wherever the test lets them.
struct Reach {
  std::vector<EdgeRef> silhouettes;    // where a descent can end, in E(p)
  std::vector<EdgeRef> false_accepts;  // where a descent can end, not in E(p)
  std::vector<EdgeRef> dead_ends;  // in nodes that are accepted while all nodes below are rejected
  std::vector<EdgeRef> missed;     // in E(p), but no descent can end there
  std::vector<DepthCounts> by_depth;  // [0] is depth 1
};
Reach reach_from(const EdgeSamplerInput& input, const RejectionTree& tree, const Vec3d& p);

// Sums of the above over points.
struct ReachCounts {
  uint64_t points = 0, silhouettes = 0, false_accepts = 0, missed = 0;
  std::vector<DepthCounts> by_depth;
};
ReachCounts count_reach(const EdgeSamplerInput& input, const RejectionTree& tree,
                        std::span<const EdgeQuery> queries, int threads);

// Diffuse points at 1.5 times the radius around the center of the object's bounds, spread evenly
// over directions, that look at the center; the object moves against them as a whole, each time in
// another direction.
std::vector<EdgeQuery> queries_around(const EdgeMesh& mesh, int count, uint64_t seed);

// The hit rate, which is the share of draws that end on an edge of E(p), and its standard error:
// over the queries, of their shares of `draws` draws each.
struct HitRate {
  double mean = 0, standard_error = 0;
};
HitRate hit_rate(const EdgeSampler& sampler, std::span<const EdgeQuery> queries, int draws,
                 uint64_t seed, int threads);

}  // namespace limn
