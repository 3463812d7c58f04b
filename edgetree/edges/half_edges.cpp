// Sides of faces over welded vertices, with degenerate faces removed.
#include "edgetree/edges/half_edges.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "edgetree/edges/contacts.h"
#include "edgetree/edges/union_find.h"

namespace limn {
namespace {

// Compares the motions of a vertex's copies.
class Motions {
 public:
  explicit Motions(const Mesh& mesh) : mesh_(mesh), diagonal_(bounds_of(mesh).diagonal()) {
    for (const Vec3<Lanes> v : mesh.position_tangents)
      for (int k = 0; k < 3; ++k)
        for (int i = 0; i < kLanes; ++i) speeds_[i] = std::max(speeds_[i], std::fabs(v[k][i]));
  }

  bool are_alike(VertexId u, VertexId v) const {
    const Vec3<Lanes> a = tangent(u), b = tangent(v);
    const double apart = length(position(u) - position(v));
    for (int i = 0; i < kLanes; ++i) {
      double size = 0, difference = 0;
      for (int k = 0; k < 3; ++k) {
        size = std::max({size, std::fabs(a[k][i]), std::fabs(b[k][i])});
        difference = std::max(difference, std::fabs(a[k][i] - b[k][i]));
      }
      // A velocity is rounded to float once, after rounding in the motion's own arithmetic. Copies
      // at different rounded positions differ by the motion between these.
      double allowed = 0x1.0p-22 * size;
      if (apart > 0) allowed += speeds_[i] * (0x1.0p-20 + 2 * apart / diagonal_);
      if (difference > allowed) return false;
    }
    return true;
  }

 private:
  Vec3<Lanes> tangent(VertexId v) const { return mesh_.position_tangents[v.index()]; }
  Vec3d position(VertexId v) const { return cast<double>(mesh_.positions[v.index()]); }

  const Mesh& mesh_;
  double diagonal_;
  Lanes speeds_;  // the largest component of a velocity
};

uint64_t undirected_key(VertexId a, VertexId b) {
  return uint64_t{std::min(a, b).index()} << 32 | std::max(a, b).index();
}

// Sets of collinear vertices that degenerate faces connect. Short sides of slivers (which are lines
// up to rounding) carry no information about the direction of the line.
class SliverLines {
 public:
  SliverLines(const Mesh& mesh, const std::vector<VertexId>& ids,
              const std::vector<FaceId>& slivers)
      : mesh_(mesh), lines_(slivers.size()), vertices_(slivers.size()) {
    for (uint32_t s = 0; s < slivers.size(); ++s) {
      const FaceIndices& face = mesh.face(slivers[s]);
      for (int k = 0; k < 3; ++k) {
        const VertexId a = ids[face[k]], b = ids[face[(k + 1) % 3]];
        if (a == b || is_across(face, k)) continue;
        const auto [found, is_new] = line_of_edge_.emplace(undirected_key(a, b), s);
        if (!is_new) lines_.join(s, found->second);
      }
    }
    for (uint32_t s = 0; s < slivers.size(); ++s)
      for (uint32_t corner : mesh.face(slivers[s]))
        vertices_[lines_.root(s)].push_back(ids[corner]);
  }

  // Appends a side, split at the vertices of its line that are strictly between its ends.
  void append_split(const HalfEdge& side, std::vector<HalfEdge>& sides) {
    const auto line = line_of_edge_.find(undirected_key(side.from, side.to));
    if (line == line_of_edge_.end()) {
      sides.push_back(side);
      return;
    }
    HalfEdge part = side;
    for (const VertexId vertex :
         between(side.from, side.to, vertices_[lines_.root(line->second)])) {
      part.to = vertex;
      sides.push_back(part);
      part.from = vertex;
    }
    part.to = side.to;
    sides.push_back(part);
  }

 private:
  // True if a side is at most 16 times as long as the sliver is wide.
  bool is_across(const FaceIndices& face, int k) const {
    Vec3d x[3];
    for (int i = 0; i < 3; ++i) x[i] = cast<double>(mesh_.positions[face[(k + i) % 3]]);
    if (!has_area(x[0], x[1], x[2])) return false;
    const double longest = std::max(
        {length_squared(x[1] - x[0]), length_squared(x[2] - x[1]), length_squared(x[0] - x[2])});
    const double twice_area = length_squared(cross(x[1] - x[0], x[2] - x[0]));
    return length_squared(x[1] - x[0]) * longest <= 256 * twice_area;
  }

  // True if v is on the side: exactly, or up to the rounding of positions away from the ends.
  bool is_on(VertexId v, VertexId from, VertexId to) const {
    const auto position = [&](VertexId id) { return cast<double>(mesh_.positions[id.index()]); };
    const Vec3d x = position(v), a = position(from), b = position(to);
    if (!has_area(a, b, x)) return true;
    double size = 0;
    for (const Vec3d& p : {x, a, b})
      size = std::max({size, std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)});
    const double rounding = touch_tolerance(size, size);
    return length(cross(b - a, x - a)) <= rounding * length(b - a) && length(x - a) > rounding &&
           length(x - b) > rounding;
  }

  // Vertices of a line are compared and sorted along its longest axis.
  std::vector<VertexId> between(VertexId from, VertexId to,
                                const std::vector<VertexId>& candidates) const {
    const auto position = [&](VertexId v) { return mesh_.positions[v.index()]; };
    const Vec3d e = cast<double>(position(to)) - cast<double>(position(from));
    const double ax = std::fabs(e.x), ay = std::fabs(e.y), az = std::fabs(e.z);
    const int axis = ax >= ay && ax >= az ? 0 : ay >= az ? 1 : 2;
    const float sign = e[axis] > 0 ? 1.0f : -1.0f;
    const auto along = [&](VertexId v) { return sign * position(v)[axis]; };
    std::vector<VertexId> inside;
    for (const VertexId v : candidates)
      if (along(v) > along(from) && along(v) < along(to) && is_on(v, from, to)) inside.push_back(v);
    std::sort(inside.begin(), inside.end(), [&](VertexId a, VertexId b) {
      return along(a) != along(b) ? along(a) < along(b) : a < b;
    });
    inside.erase(std::unique(inside.begin(), inside.end()), inside.end());
    return inside;
  }

  const Mesh& mesh_;
  UnionFind lines_;                                      // of slivers
  std::vector<std::vector<VertexId>> vertices_;          // of a line, at its root
  std::unordered_map<uint64_t, uint32_t> line_of_edge_;  // to a sliver of the line
};

}  // namespace

std::vector<VertexId> edge_vertex_ids(const Mesh& mesh) {
  std::vector<VertexId> ids(mesh.weld.begin(), mesh.weld.end());
  if (mesh.position_tangents.all_alike()) return ids;
  const Motions motions(mesh);
  std::unordered_map<uint32_t, std::vector<VertexId>> torn;  // weld: further representatives
  for (uint32_t v = 0; v < ids.size(); ++v) {
    const auto alike = [&](VertexId other) { return motions.are_alike(VertexId(v), other); };
    if (alike(ids[v])) continue;
    std::vector<VertexId>& others = torn[mesh.weld[v]];
    const auto found = std::find_if(others.begin(), others.end(), alike);
    const bool is_new = found == others.end();
    ids[v] = is_new ? VertexId(v) : *found;
    if (is_new) others.push_back(ids[v]);
  }
  return ids;
}

std::vector<HalfEdge> half_edges_of(const Mesh& mesh, const std::vector<VertexId>& ids) {
  std::vector<FaceId> slivers;
  std::vector<HalfEdge> sides;
  sides.reserve(3 * mesh.faces.size());
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const FaceIndices& face = mesh.faces[f];
    if (!has_area(mesh, face)) {
      slivers.emplace_back(f);
      continue;
    }
    for (int k = 0; k < 3; ++k)
      sides.push_back({ids[face[k]], ids[face[(k + 1) % 3]], FaceId(f), ids[face[(k + 2) % 3]]});
  }
  if (slivers.empty()) return sides;
  SliverLines lines(mesh, ids, slivers);
  std::vector<HalfEdge> split;
  split.reserve(sides.size());
  for (const HalfEdge& side : sides) lines.append_split(side, split);
  return split;
}

}  // namespace limn
