#pragma once
// The edges of a mesh, their classes, and E(p): the set of edges across which the radiance seen
// from a point p may be discontinuous.
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "limn/core/dual.h"
#include "limn/core/mesh.h"
#include "limn/core/prefetch.h"
#include "limn/core/vec.h"
#include "limn/edgetree/edge_class.h"

namespace limn {

struct Edge {
  // Welded vertices of the mesh; the first face runs from [0] to [1]. Next to a face without area
  // an edge may be a part of a longer side.
  std::array<VertexId, 2> vertices;
  std::array<FaceId, 2> faces;  // adjacent faces of its own mesh; [1] is none on a boundary edge
  EdgeClass edge_class = EdgeClass::kSmooth;
  bool concave = false;      // each of the two faces is in front of the other's plane
  uint8_t motion_group = 0;  // motion group: the edge moves with the faces of this number
};

// Not in any motion group: the surface continues across the edge.
inline constexpr uint8_t kNoMotionGroup = 255;
// Limit on motion groups at one place; the last one stands for all others.
inline constexpr uint8_t kMostMotionGroups = 8;

// The relation of a face to an edge.
struct Incidence {
  // True if the edge passes through the interior of the face, which then lies on both sides of it;
  // else the edge is on the face's boundary.
  bool through = false;
  // The motion group: faces whose common boundary moves alike share a number. With several groups
  // at one place, each has an edge of its own. kNoMotionGroup: the edge passes through the face, or
  // a coplanar face of equal appearance and motion continues it.
  uint8_t motion_group = 0;
  bool operator==(const Incidence&) const = default;
};

// At most two faces, or those of an array, which must outlive this.
class FaceList {
 public:
  FaceList() = default;
  FaceList(std::span<const FaceRef> faces) : array_(faces.data()), size_(faces.size()) {}
  // The first one or two: `second` may be none.
  FaceList(FaceRef first, FaceRef second = {})
      : size_(second.face.valid() ? 2 : 1), own_{first, second} {}
  const FaceRef* begin() const { return array_ ? array_ : own_.data(); }
  const FaceRef* end() const { return begin() + size_; }
  size_t size() const { return size_; }
  const FaceRef& operator[](size_t i) const { return begin()[i]; }

 private:
  const FaceRef* array_ = nullptr;
  size_t size_ = 0;
  std::array<FaceRef, 2> own_;
};

// All faces that touch an edge along its whole length, and near faces: float rays cannot resolve on
// which side of the edge they are (touching.h).
struct FacesAround {
  FaceList faces;
  std::span<const Incidence> incidences = {};  // of each face; empty if all are defaults
  std::span<const FaceRef> near = {};          // disjoint from `faces`
  FaceList all = faces;                        // the faces, then the near faces
  Incidence incidence(size_t i) const { return incidences.empty() ? Incidence{} : incidences[i]; }
};

// The signed distance of x is n . x + offset, positive in front; n = 0 for a degenerate face.
struct Plane {
  Vec3d n;
  double offset = 0;
  double distance(const Vec3d& x) const { return dot(n, x) + offset; }
};

// A vertex that splits an edge of its mesh, at (1 - t) of its first end plus t of the other.
struct CutVertex {
  std::array<VertexId, 2> ends;
  double t = 0;
};

// The edges of one mesh with all data that queries need. Welded: copies of a vertex along a texture
// seam are one vertex.
struct EdgeMesh {
  std::vector<Vec3d> positions;  // V, world space, equal to Embree's floats
  Tangents tangents;             // V; empty if nothing moves
  std::vector<CutVertex> cuts;   // of the last vertices, where edges of other meshes split these
  std::vector<Plane> planes;     // F, outward, double precision
  std::vector<Edge> edges;       // E
  ShapeId shape;                 // the shape of `planes`; none for intersection curves
  // Of the edges of a texture, an object of their own: V, where vertices lie on their edge's first
  // face, by the barycentric coordinates of its second and third corner. Else empty.
  std::vector<std::array<double, 2>> places;
  // Faces around edge e, of any shape: incident_faces[face_offsets[e], face_offsets[e + 1]). Those
  // of `shape` come first. Both arrays are empty if these are Edge::faces alone for every edge.
  std::vector<uint32_t> face_offsets;  // E + 1
  std::vector<FaceRef> incident_faces;
  std::vector<Incidence> incidences;  // of incident_faces; empty if all are defaults
  // FacesAround::all of an edge e with near faces: faces_and_near[near_offsets[e], near_offsets[e +
  // 1]), else empty. Both arrays are empty without near faces.
  std::vector<uint32_t> near_offsets;  // E + 1
  std::vector<FaceRef> faces_and_near;
  // True if the mesh is closed and black from behind. Then a point that sees only back faces sees
  // no discontinuity at a sharp edge, and concave edges are never silhouettes from outside. United
  // edges are irregular and exempt from this rule. Requires that every connected component encloses
  // positive volume (false for inverted components and for cavities). Self-intersections are not
  // tested. Of the edges of a texture: true if faces are black from behind.
  bool one_sided_closed = false;
  // Importance alone: by how much radiance differs across a sharp edge both of whose faces are
  // seen, per radian between their normals, over that across a silhouette; at most 1 counts.
  float fold_contrast = std::numeric_limits<float>::infinity();
  double extent = 0;  // largest |x| of a position in use

  bool of_texture() const { return !places.empty(); }
  const Edge& edge(EdgeId id) const { return edges[id.index()]; }
  const Plane& plane(FaceId id) const { return planes[id.index()]; }
  const Vec3d& position(VertexId id) const { return positions[id.index()]; }
  Vec3<Lanes> tangent(VertexId id) const { return tangents[id.index()]; }
  FaceList faces_around(EdgeId id) const {
    if (face_offsets.empty()) {
      const auto [first, second] = edge(id).faces;
      return {{shape, first}, {shape, second}};
    }
    const uint32_t *begin = &face_offsets[id.index()], *end = begin + 1;
    return std::span(incident_faces.data() + *begin, *end - *begin);
  }
  FacesAround around(EdgeId id) const {
    FacesAround around{faces_around(id)};
    const size_t count = around.faces.size();
    if (!incidences.empty()) around.incidences = {&incidences[face_offsets[id.index()]], count};
    if (!near_offsets.empty() && near_offsets[id.index() + 1] > near_offsets[id.index()]) {
      const uint32_t *begin = &near_offsets[id.index()], *end = begin + 1;
      const std::span all(faces_and_near.data() + *begin, *end - *begin);
      around.all = all;
      around.near = all.subspan(count);
    }
    return around;
  }
  // Prefetch for edges used soon: fetch_edge loads the edge, and the second function, once it is
  // there, its ends and faces.
  void fetch_edge(EdgeId id) const {
    prefetch(&edges[id.index()]);
    if (!face_offsets.empty()) prefetch(&face_offsets[id.index()]);
  }
  void fetch_ends(EdgeId id) const {
    for (const VertexId vertex : edge(id).vertices) {
      prefetch(&positions[vertex.index()]);
      if (!tangents.empty()) tangents.fetch(vertex.index());
    }
    if (!face_offsets.empty()) prefetch(incident_faces.data() + face_offsets[id.index()]);
  }
  uint64_t count(EdgeClass edge_class) const;
};

// An edge of a scene, or none.
struct EdgeRef {
  ShapeId object;  // which EdgeMesh
  EdgeId edge;
  bool operator==(const EdgeRef&) const = default;
};

// Where textures may be discontinuous at edges between two faces: these are sharp then.
struct TextureSeams {
  bool everywhere = false;  // at all of them
  // Where the faces' texture coordinates differ, or (period_one) differ by other than integers.
  bool coordinates = false;
  bool period_one = false;
  // F: bit k is set where the texture is discontinuous along the face's side from corner k to
  // the next; or empty.
  std::vector<uint8_t> sides = {};
};

// Builds the edges of a mesh; mesh.weld must be filled. black_behind: the mesh's BSDF is black
// from behind. shape: the mesh's shape. Degenerate faces keep a zero normal in `planes` and
// have no edges: adjacent sides are split at their corners, so that the real neighbours
// connect. Copies of a vertex with different motions tear the surface: both sides become
// boundary edges. seams: at which of its edges the texture is discontinuous; null: none.
EdgeMesh build_edge_mesh(const Mesh& mesh, bool black_behind, ShapeId shape = ShapeId(0),
                         const TextureSeams* seams = nullptr);

// Bound of the rounding error of Plane::distance(p) for the planes of a mesh. Within it, p counts
// as on both sides.
double distance_error(const EdgeMesh& mesh, const Vec3d& p);

// True if the edge is in E(p): incident radiance at p may be discontinuous across it, ignoring
// occlusion. Exact in double precision. Smooth edges: p is in front of exactly one of the two
// planes (within rounding of a plane it counts as on both sides, so no edge is lost); never if
// concave and one_sided_closed, as the mesh itself then occludes the edge. Sharp: p is in front of
// at least one face, or the mesh is not one_sided_closed. Boundary, irregular, intersection:
// always. Flat: as smooth. Texture: p is in front of the face, or the mesh is not one_sided_closed.
bool is_candidate(const EdgeMesh& mesh, EdgeId edge, const Vec3d& p);

// The sides of a face's plane on which a point counts as lying; both within rounding
// error.
struct Facing {
  bool front, back;
};
Facing facing(const EdgeMesh& mesh, FaceId face, const Vec3d& p);
// is_candidate for an edge, given on which sides of its two faces p lies; twice the same for one.
bool is_candidate(const EdgeMesh& mesh, EdgeId edge, Facing first, Facing second);

// True if the edge is in E(p) and geometry behind it may be visible beside it: silhouettes
// of all classes, boundary edges, irregular edges. It is E(p) without sharp edges that
// have a face on both sides as seen from p, and without edges that their own mesh
// occludes.
bool is_outline(const EdgeMesh& mesh, EdgeId edge, const Vec3d& p);

}  // namespace limn
