// Where edges lie on faces: pairs from a tree over the faces' boxes, then tests in double precision.
#include "edgetree/edges/contacts.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>

#include "edgetree/edges/box_tree.h"
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

double size_of(const Mesh& mesh, FaceId face) {
  float size = 0;
  for (const uint32_t vertex : mesh.face(face)) {
    const Vec3f& x = mesh.positions[vertex];
    size = std::max({size, std::fabs(x.x), std::fabs(x.y), std::fabs(x.z)});
  }
  return size;
}

// Of a face with area: its least height.
double width_of(const Corners& corners) {
  double longest = 0;
  for (int k = 0; k < 3; ++k)
    longest = std::max(longest, length_squared(corners[(k + 1) % 3] - corners[k]));
  return length(cross(corners[1] - corners[0], corners[2] - corners[0])) / std::sqrt(longest);
}

// What the rounding of rays explains at distance D, and no more than this share of a width.
constexpr double kNear = 0x1.0p-20, kMostNear = 0x1.0p-8;
// Of an edge's length, what a face is near to at least.
constexpr double kLeastNear = 1.0 / 16;
// What is near to both sides of a face together, at its middle, makes it a needle; all that touches it
// is off by no more than this share of its width, far beyond what rounding in double explains.
constexpr double kMostTouch = 0x1.0p-20;

// The part of the segment that lies in the triangle, seen along its normal; its sides are moved
// outward by at least `margin`, at most sqrt(3) times that.
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

// The part of the segment that lies on the triangle, if it is more than a point.
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

// The part of `longer` along which `shorter` runs, or none; `other` becomes the part of `shorter`.
std::optional<Interval> common_part(const Segment& longer, const Segment& shorter, double tolerance,
                                    Interval& other) {
  const double squared = length_squared(longer.d);
  double s0 = dot(shorter.a - longer.a, longer.d) / squared;
  const double slope = dot(shorter.d, longer.d) / squared;
  // Clipped to where it is beside the longer one.
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

// V: whether the faces around a vertex form one closed fan that covers the directions around it once,
// seen along their mean normal, none of them a needle. No edge at such a vertex lies on another face
// at it.
std::vector<bool> single_fans(const EdgeMesh& edges, const Mesh& mesh,
                              const std::vector<bool>& is_needle) {
  const size_t count = mesh.positions.size();
  std::vector<Vec3d> axes(count);
  std::vector<uint8_t> covers(count);
  std::vector<bool> single(count, true);
  for (uint32_t f = 0; f < mesh.faces.size(); ++f)
    for (const uint32_t v : mesh.faces[f]) axes[mesh.weld[v]] += edges.planes[f].n;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const uint32_t v = mesh.weld[mesh.faces[f][k]];
      const Vec3d& axis = axes[v];
      const Vec3d x = cast<double>(mesh.positions[v]);
      const auto to_corner = [&](int corner) {
        return cast<double>(mesh.positions[mesh.weld[mesh.faces[f][corner % 3]]]) - x;
      };
      if (!(dot(edges.planes[f].n, axis) > 0) || is_needle[f]) single[v] = false;
      const auto turn = [&](const Vec3d& a, const Vec3d& b) { return dot(axis, cross(a, b)); };
      const Vec3d reference =
          cross(axis, std::fabs(axis.x) < std::fabs(axis.y) ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0});
      const bool covered =
          turn(to_corner(k + 1), reference) >= 0 && turn(reference, to_corner(k + 2)) > 0;
      covers[v] = static_cast<uint8_t>(std::min(covers[v] + covered, 2));
    }
  }
  for (size_t v = 0; v < count; ++v)
    if (covers[v] != 1) single[v] = false;
  for (const Edge& edge : edges.edges) {
    if (edge.edge_class != EdgeClass::kBorder && edge.edge_class != EdgeClass::kIrregular) continue;
    for (const VertexId v : edge.vertices) single[v.index()] = single[mesh.weld[v.index()]] = false;
  }
  return single;
}

class ContactFinder {
 public:
  ContactFinder(std::span<const EdgeMesh> objects, std::span<const Mesh* const> meshes,
                const Vec3d& viewer, int threads)
      : objects_(objects), meshes_(meshes), viewer_(viewer), threads_(threads) {
    collect_faces();
    collect_edges();
  }

  Contacts find() {
    Contacts found;
    std::vector<Pair> touching;
    for (const Pair& pair : find_pairs()) {
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
  using LeafCorners = std::array<FaceIndices, BoxTree::kLeaf>;
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
    const Mesh& mesh = *meshes_[face.shape.index()];
    const FaceIndices& f = mesh.face(face.face);
    return {cast<double>(mesh.positions[f[0]]), cast<double>(mesh.positions[f[1]]),
            cast<double>(mesh.positions[f[2]])};
  }
  const Plane& plane(FaceRef face) const { return objects_[face.shape.index()].plane(face.face); }
  double size(EdgeRef id) const {
    const size_t object = id.object.index();
    return size_around(objects_[object], *meshes_[object], id.edge);
  }
  // How far two things that touch may be apart: the tolerance, but for needles.
  double tolerance(EdgeRef a, EdgeRef b) const {
    return std::min({touch_tolerance(size(a), size(b)), most_touch(a), most_touch(b)});
  }
  double tolerance(EdgeRef edge, FaceRef face) const {
    const double most = touch_tolerance(size(edge), size_of(*meshes_[face.shape.index()], face.face));
    return std::min({most, most_touch(edge), most_touch(face)});
  }
  double most_touch(FaceRef face) const {
    return most_touches_[first_face_[face.shape.index()] + face.face.index()];
  }
  double most_touch(EdgeRef id) const {
    double most = std::numeric_limits<double>::infinity();
    for (const FaceRef face : objects_[id.object.index()].faces_around(id.edge))
      most = std::min(most, most_touch(face));
    return most;
  }
  // How far rays from the viewer may miss points of the face.
  double blur(FaceRef face) const {
    double distance = size_of(*meshes_[face.shape.index()], face.face);
    for (const Vec3d& x : corners(face)) distance = std::max(distance, length(x - viewer_));
    return kNear * distance;
  }
  // Up to which distance faces are near to the edge, on its part, and to the face.
  double reach(EdgeRef id, const Segment& s) const {
    double reach = 0;
    for (const FaceRef face : objects_[id.object.index()].faces_around(id.edge))
      reach = std::max(reach, blur(face));
    return std::min(reach, kMostNear * length(s.d));
  }

  // All faces, with their boxes and those of their corners that may be passed over.
  void collect_faces() {
    uint32_t first_vertex = 0;
    for (uint32_t o = 0; o < objects_.size(); ++o) {
      first_face_.push_back(static_cast<uint32_t>(faces_.size()));
      first_vertex_.push_back(first_vertex);
      const Mesh& mesh = *meshes_[o];
      const auto count = static_cast<uint32_t>(objects_[o].planes.size());
      std::vector<bool> is_needle(count);
      std::vector<double> reaches(count);
      for (uint32_t f = 0; f < count; ++f) {
        const FaceRef face{ShapeId(o), FaceId(f)};
        const double width = width_of(this->corners(face)), blur = this->blur(face);
        is_needle[f] = !(width * kLeastNear > blur);
        most_touches_.push_back(is_needle[f] ? kMostTouch * width
                                             : std::numeric_limits<double>::infinity());
        reaches[f] = std::min(blur, kMostNear * width);
      }
      const std::vector<bool> single = single_fans(objects_[o], mesh, is_needle);
      for (uint32_t f = 0; f < count; ++f) {
        faces_.push_back({ShapeId(o), FaceId(f)});
        reaches_.push_back(reaches[f]);
        FaceIndices& corners = single_corners_.emplace_back();
        for (int k = 0; k < 3; ++k) {
          const uint32_t v = mesh.weld[mesh.faces[f][k]];
          corners[k] = single[v] ? first_vertex + v : UINT32_MAX;
        }
        const double tolerance = touch_tolerance(size_of(*meshes_[o], FaceId(f)), 0);
        boxes_.push_back(
            box_of(this->corners(faces_.back()), std::max(tolerance, reaches_.back())));
      }
      first_vertex += static_cast<uint32_t>(mesh.positions.size());
    }
  }

  // Twice the tolerance: a float's rounding is less than the second half.
  static FloatBox box_of(std::span<const Vec3d> points, double tolerance) {
    FloatBox box;
    for (int k = 0; k < 3; ++k) {
      double low = points[0][k], high = low;
      for (const Vec3d& x : points) {
        low = std::min(low, x[k]);
        high = std::max(high, x[k]);
      }
      box.lower[k] = static_cast<float>(low - 2 * tolerance);
      box.upper[k] = static_cast<float>(high + 2 * tolerance);
    }
    return box;
  }

  // Edges by their first face: they lie in its box.
  void collect_edges() {
    edge_offsets_.assign(faces_.size() + 1, 0);
    const auto for_every_edge = [&](const auto& visit) {
      for (uint32_t o = 0; o < objects_.size(); ++o)
        for (uint32_t e = 0; e < objects_[o].edges.size(); ++e) {
          const Edge& edge = objects_[o].edges[e];
          if (edge.edge_class == EdgeClass::kFlat) continue;
          visit(first_face_[o] + edge.faces[0].index(), EdgeRef{ShapeId(o), EdgeId(e)});
        }
    };
    for_every_edge([&](uint32_t face, EdgeRef) { ++edge_offsets_[face + 1]; });
    for (size_t f = 0; f < faces_.size(); ++f) edge_offsets_[f + 1] += edge_offsets_[f];
    edges_.resize(edge_offsets_.back());
    std::vector<uint32_t> next(edge_offsets_.begin(), edge_offsets_.end() - 1);
    for_every_edge([&](uint32_t face, EdgeRef id) { edges_[next[face]++] = id; });
  }

  // Pairs that may touch, in an order that does not depend on threads.
  std::vector<Pair> find_pairs() const {
    const BoxTree tree(boxes_, threads_);
    constexpr uint32_t kBlock = 256;  // leaves; not tuned
    const uint32_t blocks = (tree.leaf_count() + kBlock - 1) / kBlock;
    // Corners in the order of the leaves.
    std::vector<LeafCorners> corners(tree.leaf_count());
    for (uint32_t leaf = 0; leaf < tree.leaf_count(); ++leaf)
      for (size_t i = 0; i < tree.leaf(leaf).size(); ++i)
        corners[leaf][i] = single_corners_[tree.leaf(leaf)[i]];
    std::vector<std::vector<Pair>> found(blocks);
    parallel_for(blocks, threads_, [&](size_t block) {
      std::vector<uint32_t> leaves;
      const auto begin = static_cast<uint32_t>(block) * kBlock;
      for (uint32_t leaf = begin; leaf < std::min(begin + kBlock, tree.leaf_count()); ++leaf) {
        tree.find_leaves(tree.leaf_box(leaf), leaves);
        find_pairs_of_leaf(tree, corners, leaf, leaves, found[block]);
      }
    });
    std::vector<Pair> pairs;
    for (const auto& some : found) pairs.insert(pairs.end(), some.begin(), some.end());
    return pairs;
  }

  void find_pairs_of_leaf(const BoxTree& tree, std::span<const LeafCorners> corners, uint32_t leaf,
                          std::span<const uint32_t> leaves, std::vector<Pair>& pairs) const {
    for (const uint32_t first : tree.leaf(leaf)) {
      for (uint32_t i = edge_offsets_[first]; i < edge_offsets_[first + 1]; ++i) {
        const EdgeRef id = edges_[i];
        const Segment s = segment(id);
        const double edge_size = size(id);
        const Vec3d ends[2] = {s.a, s.at(1)};
        const double edge_reach = reach(id, s);
        const FloatBox box = box_of(ends, std::max(touch_tolerance(edge_size, 0), edge_reach));
        const uint32_t first_vertex = first_vertex_[id.object.index()];
        const auto [a, b] = objects_[id.object.index()].edge(id.edge).vertices;
        const uint32_t from = first_vertex + a.index(), to = first_vertex + b.index();
        for (const uint32_t other : leaves) {
          if (!tree.leaf_box(other).overlaps(box)) continue;
          for (uint32_t bits = tree.boxes(other).overlaps(box); bits != 0; bits &= bits - 1) {
            const int lane = std::countr_zero(bits);
            const FaceIndices& c = corners[other][lane];
            if (c[0] == from || c[1] == from || c[2] == from) continue;
            if (c[0] == to || c[1] == to || c[2] == to) continue;
            const uint32_t place = tree.leaf(other)[lane];
            const FaceRef face = faces_[place];
            const bool is_near = this->is_near(id, s, std::max(edge_reach, reaches_[place]), face);
            const bool may_touch = this->may_touch(id, s, edge_size, face);
            if (is_near || may_touch) pairs.push_back({id, face, may_touch, is_near});
          }
        }
      }
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

  // Looser than what decides.
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

  // For every face of a pair, all edges that it is around.
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

  // The part of edge a along which edge b runs. Decided for both alike.
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
  std::vector<uint32_t> first_face_;    // of each object, in faces_
  std::vector<FaceRef> faces_;          // of all objects
  std::vector<FloatBox> boxes_;         // theirs
  std::vector<double> reaches_;         // up to where edges are near to them
  std::vector<double> most_touches_;    // up to where edges touch them at most
  std::vector<uint32_t> first_vertex_;  // of each object, in a count over all
  // Of every face, the corners with a single fan of faces, counted over all objects; else UINT32_MAX.
  std::vector<FaceIndices> single_corners_;
  // Edges whose first face is faces_[f]: edges_[edge_offsets_[f], edge_offsets_[f + 1]).
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
                       const Vec3d& viewer, int threads) {
  return ContactFinder(objects, meshes, viewer, threads).find();
}

}  // namespace limn
