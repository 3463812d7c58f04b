// Finds where edges lie on faces or near them, by tests of pairs in double precision.
#include "edgetree/edges/contacts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>

#include "limn/core/parallel.h"

namespace limn {
namespace {

using Corners = std::array<Vec3d, 3>;

struct Segment {
  Vec3d a, d;  // a + t d
  Vec3d at(double t) const { return a + d * t; }
};

struct Interval {
  double t0, t1;
};

// The least share of an edge's length along which a near face must run.
constexpr double kLeastNear = 1.0 / 16;
// Tolerance at slivers, as a share of their width: far above double
// rounding.
constexpr double kMostTouch = 0x1.0p-20;

// The part of the segment inside of the triangle, seen along its normal. The triangle's sides are
// moved outward by `margin` to sqrt(3) times `margin`.
std::optional<Interval> clip(const Segment& segment, const Corners& corners, const Vec3d& normal,
                             double margin) {
  Interval part{0, 1};
  for (int k = 0; k < 3; ++k) {
    const Vec3d side = corners[(k + 1) % 3] - corners[k];
    const Vec3d inward = cross(normal, side);
    const double height = dot(inward, segment.a - corners[k]) +
                          margin * (std::fabs(side.x) + std::fabs(side.y) + std::fabs(side.z));
    const double slope = dot(inward, segment.d);
    if (height < 0 && height + slope < 0) return std::nullopt;
    if (height < 0) part.t0 = std::max(part.t0, -height / slope);
    if (height + slope < 0) part.t1 = std::min(part.t1, -height / slope);
    if (!(part.t0 < part.t1)) return std::nullopt;
  }
  return part;
}

// The part of the segment on the triangle; nothing if it is only a point.
std::optional<Interval> part_on_face(const Segment& segment, const Corners& corners,
                                     const Plane& plane, double tolerance, double margin) {
  const double d0 = dot(plane.n, segment.a - corners[0]);
  const double d1 = d0 + dot(plane.n, segment.d);
  if (std::min(d0, d1) > tolerance || std::max(d0, d1) < -tolerance) return std::nullopt;
  const auto part = clip(segment, corners, plane.n, margin);
  if (!part) return std::nullopt;
  if (std::fabs(d0 + (d1 - d0) * part->t0) > tolerance) return std::nullopt;
  if (std::fabs(d0 + (d1 - d0) * part->t1) > tolerance) return std::nullopt;
  if ((part->t1 - part->t0) * length(segment.d) <= kShortestTouch * tolerance) return std::nullopt;
  return part;
}

// The part of `longer` along `shorter`, or nothing; `other` becomes the part of `shorter`.
std::optional<Interval> common_part(const Segment& longer, const Segment& shorter, double tolerance,
                                    Interval& other) {
  const double squared = length_squared(longer.d);
  double s0 = dot(shorter.a - longer.a, longer.d) / squared;
  const double slope = dot(shorter.d, longer.d) / squared;
  // Clipped to the extent of the longer one.
  other = {0, 1};
  const double s1 = s0 + slope;
  if ((s0 <= 0 && s1 <= 0) || (s0 >= 1 && s1 >= 1) || slope == 0) return std::nullopt;
  const double at_start = -s0 / slope, at_end = (1 - s0) / slope;
  other.t0 = std::max(other.t0, std::min(at_start, at_end));
  other.t1 = std::min(other.t1, std::max(at_start, at_end));
  if ((other.t1 - other.t0) * length(shorter.d) <= kShortestTouch * tolerance) return std::nullopt;
  double ends[2];
  for (int i = 0; i < 2; ++i) {
    const double t = i == 0 ? other.t0 : other.t1;
    ends[i] = std::clamp(s0 + slope * t, 0.0, 1.0);
    if (length(shorter.at(t) - longer.at(ends[i])) > tolerance) return std::nullopt;
  }
  return Interval{std::min(ends[0], ends[1]), std::max(ends[0], ends[1])};
}

class ContactFinder {
 public:
  ContactFinder(std::span<const EdgeMesh> objects, std::span<const Mesh* const> meshes,
                const Vec3d& viewer, int threads)
      : objects_(objects), meshes_(meshes), viewer_(viewer), threads_(threads) {}

  Contacts find(std::span<const FacePair> pairs) {
    Contacts found;
    if (pairs.empty()) return found;
    collect_edges();
    std::vector<Pair> touching;
    for (const Pair& pair : find_pairs(pairs)) {
      if (pair.may_touch) touching.push_back(pair);
      if (pair.is_near) found.near.push_back({pair.edge, pair.face});
    }
    std::sort(found.near.begin(), found.near.end(), [](const NearFace& a, const NearFace& b) {
      return std::tuple(a.edge.object, a.edge.edge, a.face.shape, a.face.face) <
             std::tuple(b.edge.object, b.edge.edge, b.face.shape, b.face.face);
    });
    if (touching.empty()) return found;
    list_edges_of_faces(touching);
    std::vector<Contact>& contacts = found.contacts;
    for (const Pair& pair : touching) add_contacts(pair, contacts);
    std::sort(contacts.begin(), contacts.end(), [](const Contact& a, const Contact& b) {
      return std::tuple(a.edge.object, a.edge.edge, a.face.shape, a.face.face, a.t0) <
             std::tuple(b.edge.object, b.edge.edge, b.face.shape, b.face.face, b.t0);
    });
    return found;
  }

 private:
  struct Pair {
    EdgeRef edge;
    FaceRef face;
    bool may_touch, is_near;
  };

  Segment segment(EdgeRef id) const {
    const EdgeMesh& mesh = objects_[id.object.index()];
    const auto [a, b] = mesh.edge(id.edge).vertices;
    return {mesh.position(a), mesh.position(b) - mesh.position(a)};
  }
  Corners corners(FaceRef face) const {
    return face_corners<double>(*meshes_[face.shape.index()], face.face);
  }
  const Plane& plane(FaceRef face) const { return objects_[face.shape.index()].plane(face.face); }
  double size(EdgeRef id) const {
    const size_t object = id.object.index();
    return size_around(objects_[object], *meshes_[object], id.edge);
  }
  // Largest distance at which things touch, reduced at slivers.
  double tolerance(EdgeRef a, EdgeRef b) const {
    return std::min({touch_tolerance(size(a), size(b)), most_touch(a), most_touch(b)});
  }
  double tolerance(EdgeRef edge, FaceRef face) const {
    const double most =
        touch_tolerance(size(edge), size_of(*meshes_[face.shape.index()], face.face));
    return std::min({most, most_touch(edge), most_touch(face)});
  }
  double most_touch(FaceRef face) const {
    const Mesh& mesh = *meshes_[face.shape.index()];
    if (!is_needle(mesh, face.face, viewer_)) return std::numeric_limits<double>::infinity();
    return kMostTouch * width_of(mesh, face.face);
  }
  double most_touch(EdgeRef id) const {
    double most = std::numeric_limits<double>::infinity();
    for (const FaceRef face : objects_[id.object.index()].faces_around(id.edge))
      most = std::min(most, most_touch(face));
    return most;
  }
  // Largest distance of near faces, from the edge's faces.
  double reach(EdgeRef id, const Segment& s) const {
    double reach = 0;
    for (const FaceRef face : objects_[id.object.index()].faces_around(id.edge))
      reach = std::max(reach, blur_of(*meshes_[face.shape.index()], face.face, viewer_));
    return std::min(reach, kMostNear * length(s.d));
  }
  // Groups edges by their first face, whose box contains them.
  void collect_edges() {
    uint32_t faces = 0;
    for (const EdgeMesh& mesh : objects_) {
      first_face_.push_back(faces);
      faces += static_cast<uint32_t>(mesh.planes.size());
    }
    edge_offsets_.assign(faces + 1, 0);
    const auto for_every_edge = [&](const auto& visit) {
      for (uint32_t o = 0; o < objects_.size(); ++o)
        for (uint32_t e = 0; e < objects_[o].edges.size(); ++e) {
          const Edge& edge = objects_[o].edges[e];
          visit(first_face_[o] + edge.faces[0].index(), EdgeRef{ShapeId(o), EdgeId(e)});
        }
    };
    for_every_edge([&](uint32_t face, EdgeRef) { ++edge_offsets_[face + 1]; });
    for (size_t f = 0; f < faces; ++f) edge_offsets_[f + 1] += edge_offsets_[f];
    edges_.resize(edge_offsets_.back());
    std::vector<uint32_t> next(edge_offsets_.begin(), edge_offsets_.end() - 1);
    for_every_edge([&](uint32_t face, EdgeRef id) { edges_[next[face]++] = id; });
  }

  // Pairs that may touch or are near; the order does not depend on threads.
  std::vector<Pair> find_pairs(std::span<const FacePair> candidates) const {
    constexpr size_t kBlock = 4096;  // not tuned
    std::vector<std::vector<Pair>> found((candidates.size() + kBlock - 1) / kBlock);
    parallel_for(found.size(), threads_, [&](size_t block) {
      const size_t begin = block * kBlock;
      for (const FacePair& pair :
           candidates.subspan(begin, std::min(kBlock, candidates.size() - begin))) {
        append_pairs(pair.first, pair.second, found[block]);
        append_pairs(pair.second, pair.first, found[block]);
      }
    });
    std::vector<Pair> pairs;
    for (const auto& some : found) pairs.insert(pairs.end(), some.begin(), some.end());
    return pairs;
  }

  // Pairs of the edges whose first face is `first` with the face `other`.
  void append_pairs(FaceRef first, FaceRef other, std::vector<Pair>& pairs) const {
    const size_t f = first_face_[first.shape.index()] + first.face.index();
    const Mesh& mesh = *meshes_[other.shape.index()];
    for (uint32_t i = edge_offsets_[f]; i < edge_offsets_[f + 1]; ++i) {
      const EdgeRef id = edges_[i];
      const Segment s = segment(id);
      const bool flat = objects_[id.object.index()].edge(id.edge).edge_class == EdgeClass::kFlat;
      if (flat && length(cross(plane(first).n, plane(other).n)) <= 0x1.0p-12) continue;
      const bool near =
          !flat &&
          is_near(id, s, std::max(reach(id, s), reach_of(mesh, other.face, viewer_)), other);
      const bool touching = may_touch(id, s, size(id), other);
      if (near || touching) pairs.push_back({id, other, touching, near});
    }
  }

  bool is_near(EdgeRef id, const Segment& s, double reach, FaceRef face) const {
    const Plane& p = plane(face);
    const Corners c = corners(face);
    const double d0 = dot(p.n, s.a - c[0]);
    const double d1 = d0 + dot(p.n, s.d);
    if (std::min(d0, d1) > reach || std::max(d0, d1) < -reach) return false;
    if (length_squared(p.n) == 0) return false;
    for (const FaceRef around : objects_[id.object.index()].faces_around(id.edge))
      if (around == face) return false;
    auto part = clip(s, c, p.n, reach);
    if (!part) return false;
    if (d0 != d1) {
      const double t0 = (-reach - d0) / (d1 - d0), t1 = (reach - d0) / (d1 - d0);
      part->t0 = std::max(part->t0, std::min(t0, t1));
      part->t1 = std::min(part->t1, std::max(t0, t1));
    }
    return part->t1 - part->t0 >= kLeastNear;
  }

  // A conservative test.
  bool may_touch(EdgeRef id, const Segment& s, double edge_size, FaceRef face) const {
    const Plane& p = plane(face);
    const Corners c = corners(face);
    const double tolerance =
        touch_tolerance(edge_size, size_of(*meshes_[face.shape.index()], face.face));
    const double d0 = dot(p.n, s.a - c[0]);
    const double d1 = d0 + dot(p.n, s.d);
    if (std::min(d0, d1) > 2 * tolerance || std::max(d0, d1) < -2 * tolerance) return false;
    if (length_squared(p.n) == 0) return false;
    for (const FaceRef around : objects_[id.object.index()].faces_around(id.edge))
      if (around == face) return false;
    const auto part = clip(s, c, p.n, 2 * tolerance);
    if (!part || (part->t1 - part->t0) * length(s.d) <= kShortestTouch * tolerance) return false;
    return std::fabs(d0 + (d1 - d0) * part->t0) <= 4 * tolerance &&
           std::fabs(d0 + (d1 - d0) * part->t1) <= 4 * tolerance;
  }

  // Lists all edges around every face of a pair.
  void list_edges_of_faces(std::span<const Pair> pairs) {
    std::vector<std::vector<bool>> wanted;
    for (const EdgeMesh& mesh : objects_) wanted.emplace_back(mesh.planes.size());
    for (const Pair& pair : pairs) wanted[pair.face.shape.index()][pair.face.face.index()] = true;
    for (uint32_t o = 0; o < objects_.size(); ++o) {
      if (std::find(wanted[o].begin(), wanted[o].end(), true) == wanted[o].end()) continue;
      for (uint32_t e = 0; e < objects_[o].edges.size(); ++e)
        for (const FaceRef face : objects_[o].faces_around(EdgeId(e)))
          if (wanted[o][face.face.index()]) edges_of_faces_.push_back({face, EdgeId(e)});
    }
    std::sort(edges_of_faces_.begin(), edges_of_faces_.end(), before);
  }

  struct EdgeOfFace {
    FaceRef face;
    EdgeId edge;
  };
  static bool before(const EdgeOfFace& a, const EdgeOfFace& b) {
    return std::tuple(a.face.shape, a.face.face, a.edge) <
           std::tuple(b.face.shape, b.face.face, b.edge);
  }

  void add_contacts(const Pair& pair, std::vector<Contact>& contacts) const {
    const size_t count = contacts.size();
    const auto first = std::lower_bound(edges_of_faces_.begin(), edges_of_faces_.end(),
                                        EdgeOfFace{pair.face, EdgeId(0)}, before);
    for (auto i = first; i != edges_of_faces_.end() && i->face == pair.face; ++i)
      if (const auto part = part_along(pair.edge, {pair.face.shape, i->edge}))
        contacts.push_back({pair.edge, pair.face, part->t0, part->t1, i->edge});
    if (contacts.size() > count) return;
    const Corners c = corners(pair.face);
    if (const auto part = part_on_face(segment(pair.edge), c, plane(pair.face),
                                       tolerance(pair.edge, pair.face), 0))
      contacts.push_back({pair.edge, pair.face, part->t0, part->t1, EdgeId::none()});
  }

  // The part of edge a along edge b; symmetric decision.
  std::optional<Interval> part_along(EdgeRef a, EdgeRef b) const {
    const Segment s = segment(a), r = segment(b);
    const double tolerance = this->tolerance(a, b);
    const double difference = length_squared(s.d) - length_squared(r.d);
    const bool longer = difference != 0
                            ? difference > 0
                            : std::tuple(a.object, a.edge) < std::tuple(b.object, b.edge);
    Interval other;
    const auto part =
        longer ? common_part(s, r, tolerance, other) : common_part(r, s, tolerance, other);
    if (!part) return std::nullopt;
    return longer ? *part : other;
  }

  std::span<const EdgeMesh> objects_;
  std::span<const Mesh* const> meshes_;
  Vec3d viewer_;
  int threads_;
  std::vector<uint32_t> first_face_;  // first face number of each object
  // Edges with the first face f (a global number): edges_[edge_offsets_[f], edge_offsets_[f + 1]).
  std::vector<uint32_t> edge_offsets_;
  std::vector<EdgeRef> edges_;
  std::vector<EdgeOfFace> edges_of_faces_;  // sorted
};

}  // namespace

double size_around(const EdgeMesh& edges, const Mesh& mesh, EdgeId edge) {
  double size = 0;
  for (const FaceRef face : edges.faces_around(edge))
    size = std::max(size, size_of(mesh, face.face));
  return size;
}

Contacts find_contacts(std::span<const EdgeMesh> objects, std::span<const Mesh* const> meshes,
                       std::span<const FacePair> pairs, const Vec3d& viewer, int threads) {
  return ContactFinder(objects, meshes, viewer, threads).find(pairs);
}

}  // namespace limn
