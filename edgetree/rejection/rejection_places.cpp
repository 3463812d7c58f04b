// Chooses nodes and slices to inspect a rejection test.
#include "limn/edgetree/rejection_places.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace limn {
namespace {

// Normals of the faces around the edges, for each edge once.
std::vector<Vec3d> normals_of(const EdgeSamplerInput& input, std::span<const EdgeRef> edges) {
  std::vector<Vec3d> normals;
  for (const EdgeRef id : edges) {
    const EdgeMesh& mesh = input.object(id.object);
    for (const FaceRef face : mesh.faces_around(id.edge))
      if (face.shape == mesh.shape) normals.push_back(mesh.plane(face.face).n);
  }
  return normals;
}

Vec3d mean(const std::vector<Vec3d>& vectors) {
  Vec3d sum;
  for (const Vec3d& v : vectors) sum += v;
  return sum / static_cast<double>(vectors.size());
}

// The unit tangent along which the vectors vary most: the larger principal axis of their second
// moments in the tangent plane of n.
Vec3d widest_tangent(const std::vector<Vec3d>& vectors, const Vec3d& n) {
  const Frame frame(n);
  double ss = 0, st = 0, tt = 0;
  for (const Vec3d& v : vectors) {
    const Vec3d local = frame.to_local(v);
    ss += local.x * local.x;
    st += local.x * local.y;
    tt += local.y * local.y;
  }
  const double angle = 0.5 * std::atan2(2 * st, ss - tt);
  return frame.s * std::cos(angle) + frame.t * std::sin(angle);
}

// Distance of two counts: the logarithm of their ratio.
double misfit(uint32_t a, uint32_t b) { return std::fabs(std::log(static_cast<double>(a) / b)); }

// Nodes within a factor of 3/2 of the number of edges, or else the closest.
std::vector<uint32_t> nodes_of_size(const RejectionTree& tree, uint32_t edges) {
  const auto nodes = tree.nodes();
  double limit = std::log(1.5), nearest = std::numeric_limits<double>::infinity();
  for (const RejectionNode& node : nodes)
    nearest = std::min(nearest, misfit(node.end - node.begin, edges));
  limit = std::max(limit, nearest);
  std::vector<uint32_t> fitting;
  for (uint32_t i = 0; i < nodes.size(); ++i)
    if (misfit(nodes[i].end - nodes[i].begin, edges) <= limit) fitting.push_back(i);
  return fitting;
}

}  // namespace

uint32_t balanced_node(const EdgeSamplerInput& input, const RejectionTree& tree, uint32_t edges,
                       std::span<const EdgeQuery> queries) {
  uint32_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (const uint32_t i : nodes_of_size(tree, edges)) {
    const auto own = tree.edges(i);
    const auto holds = std::count_if(queries.begin(), queries.end(), [&](const EdgeQuery& query) {
      return std::any_of(own.begin(), own.end(), [&](EdgeRef id) {
        return is_candidate(input.object(id.object), id.edge, query.p);
      });
    });
    const double off = std::fabs(static_cast<double>(holds) - 0.5 * queries.size());
    if (off < least) {
      least = off;
      best = i;
    }
  }
  return best;
}

Match best_match(const EdgeSamplerInput& input, const RejectionTree& tree,
                 std::span<const EdgeRef> edges) {
  std::vector<std::vector<bool>> wanted;
  for (const EdgeMesh& mesh : input.objects) wanted.emplace_back(mesh.edges.size(), false);
  for (const EdgeRef id : edges) wanted[id.object.index()][id.edge.index()] = true;
  std::vector<uint32_t> running{0};
  for (const EdgeRef id : tree.edges())
    running.push_back(running.back() + (wanted[id.object.index()][id.edge.index()] ? 1 : 0));
  Match best;
  for (uint32_t i = 0; i < tree.nodes().size(); ++i) {
    const RejectionNode& node = tree.nodes()[i];
    const double common = running[node.end] - running[node.begin];
    const double either = static_cast<double>(edges.size()) + (node.end - node.begin) - common;
    if (common / either > best.overlap) best = {i, common / either};
  }
  return best;
}

Patch patch_of(const EdgeSamplerInput& input, std::span<const EdgeRef> edges) {
  Bounds bounds;
  for (const EdgeRef id : edges) {
    const EdgeMesh& mesh = input.object(id.object);
    for (const VertexId vertex : mesh.edge(id.edge).vertices) bounds.extend(mesh.position(vertex));
  }
  const std::vector<Vec3d> normals = normals_of(input, edges);
  const Vec3d sum = mean(normals);
  const Vec3d n = length(sum) > 0 ? normalize(sum) : Vec3d{0, 0, 1};
  const Vec3d bend = widest_tangent(normals, n);
  return {bounds.center(), 0.5 * bounds.diagonal(), n, bend, cross(bend, n)};
}

std::array<Slice, 2> slices_around(const Patch& patch, double extent, double distance, int size) {
  const Slice first{patch.center, patch.bend * extent, patch.normal * extent, size};
  Slice second = first;
  second.center += patch.across * distance;
  return {first, second};
}

}  // namespace limn
