// Builds edges from sides of faces: pairing, classes, planes; and the exact test of E(p).
#include "limn/edgetree/edges.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "edgetree/edges/fold.h"
#include "edgetree/edges/half_edges.h"
#include "edgetree/edges/union_find.h"

namespace limn {
namespace {

// Computed in extended precision, so that normals of slivers are exact to double precision.
Plane plane_of(const Mesh& mesh, const FaceIndices& face) {
  if (!has_area(mesh, face)) return {};
  const Vec3f &fa = mesh.positions[face[0]], &fb = mesh.positions[face[1]],
              &fc = mesh.positions[face[2]];
  using Real = long double;
  const Vec3<Real> a = cast<Real>(fa);
  const Vec3<Real> n = normalize(cross(cast<Real>(fb) - a, cast<Real>(fc) - a));
  return {cast<double>(n), static_cast<double>(-dot(n, a))};
}

// Builds one EdgeMesh; its steps are called in the order of their definition.
class Builder {
 public:
  Builder(const Mesh& mesh, bool black_behind, ShapeId shape, const TextureSeams* seams)
      : mesh_(mesh), seams_(seams), ids_(edge_vertex_ids(mesh)) {
    result_.shape = shape;
    copy_vertices();
    result_.planes.reserve(mesh.faces.size());
    for (const FaceIndices& face : mesh.faces) result_.planes.push_back(plane_of(mesh, face));
    group_half_edges();
    result_.one_sided_closed = black_behind && is_closed() && parts_have_volume();
  }

  EdgeMesh take() { return std::move(result_); }

 private:
  void copy_vertices() {
    result_.positions.reserve(mesh_.positions.size());
    for (const Vec3f& x : mesh_.positions) result_.positions.push_back(cast<double>(x));
    result_.tangents = mesh_.position_tangents;
    for (const FaceIndices& face : mesh_.faces)
      for (uint32_t v : face)
        result_.extent = std::max(result_.extent, length(result_.positions[v]));
  }

  void group_half_edges() {
    sort_sides(half_edges_of(mesh_, ids_));
    const auto ends = [](const HalfEdge& s) {
      return std::pair(std::min(s.from, s.to), std::max(s.from, s.to));
    };
    result_.edges.reserve(sides_.size() / 2);  // of a closed mesh
    std::vector<uint32_t> offsets{0};
    bool many = false;  // faces are around some edge
    for (size_t begin = 0, end; begin < sides_.size(); begin = end) {
      for (end = begin; end < sides_.size() && ends(sides_[end]) == ends(sides_[begin]);) ++end;
      many = many || end - begin > 2;
      offsets.push_back(static_cast<uint32_t>(end));
      append_edge({&sides_[begin], end - begin});
    }
    if (!many) return;
    result_.face_offsets = std::move(offsets);
    for (const HalfEdge& side : sides_)
      result_.incident_faces.push_back({result_.shape, side.face});
  }

  // Sorts by the smaller end (counting sort, faster than comparisons), the larger end, the
  // face.
  void sort_sides(const std::vector<HalfEdge>& sides) {
    const auto low = [](const HalfEdge& s) { return std::min(s.from, s.to).index(); };
    std::vector<uint32_t> offsets(mesh_.positions.size() + 1);
    for (const HalfEdge& side : sides) ++offsets[low(side) + 1];
    for (size_t v = 1; v < offsets.size(); ++v) offsets[v] += offsets[v - 1];
    sides_.resize(sides.size());
    std::vector<uint32_t> next(offsets.begin(), offsets.end() - 1);
    for (const HalfEdge& side : sides) sides_[next[low(side)]++] = side;
    for (size_t v = 0; v + 1 < offsets.size(); ++v) {
      std::sort(sides_.begin() + offsets[v], sides_.begin() + offsets[v + 1],
                [](const HalfEdge& a, const HalfEdge& b) {
                  return std::pair(std::max(a.from, a.to), a.face) <
                         std::pair(std::max(b.from, b.to), b.face);
                });
    }
  }

  void append_edge(std::span<const HalfEdge> around) {
    const HalfEdge& first = around[0];
    Edge edge;
    edge.vertices = {first.from, first.to};
    edge.faces = {first.face, around.size() > 1 ? around[1].face : FaceId::none()};
    if (around.size() == 1) {
      edge.edge_class = EdgeClass::kBoundary;
    } else if (around.size() > 2 || around[1].from == first.from) {
      edge.edge_class = EdgeClass::kIrregular;
    } else {
      const Fold fold = fold_of(position(first.from), position(first.to), position(first.opposite),
                                position(around[1].opposite));
      edge.edge_class = class_of_pair(edge, fold);
      edge.concave = edge.edge_class != EdgeClass::kFlat && fold.volume > fold.rounding;
    }
    result_.edges.push_back(edge);
  }

  EdgeClass class_of_pair(const Edge& edge, const Fold& fold) const {
    const bool flat = is_flat(edge, fold);
    const bool continuous =
        mesh_.normal_source == NormalSource::kFace ? flat : normals_continuous(edge);
    if (!continuous || (seams_ && is_seam(edge))) return EdgeClass::kSharp;
    return flat ? EdgeClass::kFlat : EdgeClass::kSmooth;
  }

  // An end that is no corner of a face (a split side) counts as a seam.
  bool is_seam(const Edge& edge) const {
    if (seams_->everywhere) return true;
    std::array<std::array<int, 2>, 2> corners;  // [face][end]
    for (int f = 0; f < 2; ++f) {
      for (int e = 0; e < 2; ++e) {
        corners[f][e] = corner_of(edge.faces[f], edge.vertices[e]);
        if (corners[f][e] < 0) return true;
      }
      const auto [a, b] = corners[f];
      const int side = (a + 1) % 3 == b ? a : b;
      if (!seams_->sides.empty() && (seams_->sides[edge.faces[f].index()] >> side & 1) != 0)
        return true;
    }
    if (!seams_->coordinates) return false;
    std::array<Vec3f, 2> shift;
    for (int e = 0; e < 2; ++e) {
      const auto place = [&](int f) {
        return mesh_.uv_places[mesh_.uv_ids[edge.faces[f].index()][corners[f][e]]];
      };
      const Vec3f a = place(0), b = place(1);
      shift[e] = {b.x - a.x, b.y - a.y, b.z - a.z};
    }
    if (!(shift[0] == shift[1])) return true;
    if (!seams_->period_one || mesh_.uv_source != UvSource::kPlane) return !(shift[0] == Vec3f{});
    return shift[0].x != std::round(shift[0].x) || shift[0].y != std::round(shift[0].y);
  }

  // The corner of the face at the welded vertex; -1 if there is none.
  int corner_of(FaceId face, VertexId vertex) const {
    for (int k = 0; k < 3; ++k)
      if (ids_[mesh_.face(face)[k]] == vertex) return k;
    return -1;
  }

  // Coplanar up to the rounding of positions. Rounding may tilt slivers far, and two "flat" edges
  // could hide a crease: flat faces must also agree to half of a float's digits. An edge wrongly
  // called sharp costs samples; one wrongly called flat loses a discontinuity.
  bool is_flat(const Edge& edge, const Fold& fold) const {
    const Vec3d &n0 = result_.plane(edge.faces[0]).n, &n1 = result_.plane(edge.faces[1]).n;
    return std::fabs(fold.volume) <= fold.rounding && dot(n0, n1) > 0 &&
           length(cross(n0, n1)) <= 0x1.0p-12;
  }

  // True if both faces have the same shading normals at both ends, hence along the whole edge. An
  // end that is no corner of a face (a split side) counts as different.
  bool normals_continuous(const Edge& edge) const {
    for (const VertexId vertex : edge.vertices) {
      const Vec3d* a = corner_normal(edge.faces[0], vertex);
      const Vec3d* b = corner_normal(edge.faces[1], vertex);
      if (!a || !b || !(*a == *b)) return false;
    }
    return true;
  }

  const Vec3d* corner_normal(FaceId face, VertexId vertex) const {
    const int k = corner_of(face, vertex);
    return k < 0 ? nullptr : &mesh_.normals[mesh_.normal_ids[face.index()][k]];
  }

  bool is_closed() const {
    return result_.count(EdgeClass::kBoundary) == 0 && result_.count(EdgeClass::kIrregular) == 0;
  }

  // True if each connected part of a closed mesh encloses positive volume, beyond rounding.
  bool parts_have_volume() const {
    UnionFind parts(mesh_.faces.size());
    for (const Edge& edge : result_.edges) parts.join(edge.faces[0].index(), edge.faces[1].index());
    std::vector<double> volumes(mesh_.faces.size()), sizes(mesh_.faces.size());
    // A face has three or more sides; its area is that of a triangle fan.
    for (const HalfEdge& side : sides_) {
      const uint32_t part = parts.root(side.face.index());
      const Vec3d origin = position(VertexId(mesh_.faces[part][0])),
                  e = position(side.from) - origin;
      const Plane& plane = result_.plane(side.face);
      const Vec3d x = position(side.opposite) - position(side.from);
      const double area = length(cross(position(side.to) - position(side.from), x));
      volumes[part] += dot(plane.n, e) * area;
      sizes[part] += length(e) * area;
    }
    for (uint32_t f = 0; f < sizes.size(); ++f)
      if (sizes[f] > 0 && volumes[f] <= 0x1.0p-44 * sizes[f]) return false;
    return !result_.edges.empty();
  }

  const Vec3d& position(VertexId vertex) const { return result_.position(vertex); }

  const Mesh& mesh_;
  const TextureSeams* seams_;
  std::vector<VertexId> ids_;    // V
  std::vector<HalfEdge> sides_;  // sorted by edge
  EdgeMesh result_;
};

// Candidate or not, if the edge's class decides it; nothing if its faces must be tested.
std::optional<bool> known_candidate(const EdgeMesh& mesh, const Edge& edge) {
  if (edge.edge_class == EdgeClass::kBoundary || edge.edge_class == EdgeClass::kIrregular ||
      edge.edge_class == EdgeClass::kIntersection)
    return true;
  const bool seen = edge.edge_class == EdgeClass::kSharp || edge.edge_class == EdgeClass::kTexture;
  if (seen && !mesh.one_sided_closed) return true;
  if (edge.edge_class == EdgeClass::kSmooth && edge.concave && mesh.one_sided_closed) return false;
  return {};
}

bool is_candidate(EdgeClass edge_class, Facing first, Facing second) {
  if (edge_class == EdgeClass::kSharp) return first.front || second.front;
  if (edge_class == EdgeClass::kTexture) return first.front;
  return (first.front && second.back) || (first.back && second.front);
}

}  // namespace

const char* edge_class_name(EdgeClass edge_class) {
  constexpr const char* kNames[] = {"smooth", "sharp",    "border", "irregular",
                                    "flat",   "crossing", "texture"};
  return kNames[static_cast<int>(edge_class)];
}

uint64_t EdgeMesh::count(EdgeClass edge_class) const {
  return std::count_if(edges.begin(), edges.end(),
                       [&](const Edge& e) { return e.edge_class == edge_class; });
}

EdgeMesh build_edge_mesh(const Mesh& mesh, bool black_behind, ShapeId shape,
                         const TextureSeams* seams) {
  return Builder(mesh, black_behind, shape, seams).take();
}

// n . p + offset has four roundings of terms no larger than |p| and the extent; the offset has
// three, the normal two, all doubled.
double distance_error(const EdgeMesh& mesh, const Vec3d& p) {
  return 11 * 0x1.0p-53 * (length(p) + mesh.extent);
}

Facing facing(const EdgeMesh& mesh, FaceId face, const Vec3d& p) {
  const double error = distance_error(mesh, p);
  const double d = mesh.plane(face).distance(p);
  return {d >= -error, d <= error};
}

bool is_candidate(const EdgeMesh& mesh, EdgeId id, const Vec3d& p) {
  const Edge& edge = mesh.edge(id);
  if (const auto known = known_candidate(mesh, edge)) return *known;
  const double error = distance_error(mesh, p);
  const double d0 = mesh.plane(edge.faces[0]).distance(p);
  const Facing first{d0 >= -error, d0 <= error};
  if (edge.edge_class == EdgeClass::kTexture) return is_candidate(edge.edge_class, first, first);
  const double d1 = mesh.plane(edge.faces[1]).distance(p);
  return is_candidate(edge.edge_class, first, {d1 >= -error, d1 <= error});
}

bool is_candidate(const EdgeMesh& mesh, EdgeId id, Facing first, Facing second) {
  const Edge& edge = mesh.edge(id);
  const auto known = known_candidate(mesh, edge);
  return known ? *known : is_candidate(edge.edge_class, first, second);
}

bool is_outline(const EdgeMesh& mesh, EdgeId id, const Vec3d& p) {
  const Edge& edge = mesh.edge(id);
  if (edge.edge_class == EdgeClass::kTexture) return false;
  if (edge.edge_class != EdgeClass::kSharp) return is_candidate(mesh, id, p);
  if (edge.concave && mesh.one_sided_closed) return false;
  const double error = distance_error(mesh, p);
  const double d0 = mesh.plane(edge.faces[0]).distance(p);
  const double d1 = mesh.plane(edge.faces[1]).distance(p);
  return std::fmin(d0, d1) <= error && std::fmax(d0, d1) >= -error;
}

}  // namespace limn
