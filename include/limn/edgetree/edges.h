#pragma once
// The edges of a mesh, their classes, and E(p): the set of edges across which radiance may jump as
// seen from a point p.
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "limn/core/dual.h"
#include "limn/core/mesh.h"
#include "limn/core/vec.h"

namespace limn {

enum class EdgeClass : uint8_t {
  // Two faces, shading normals continuous: a jump only where it is a silhouette.
  kSmooth,
  // Two faces, shading normals differ: a jump for every point that sees one of the faces.
  kSharp,
  // One face: a jump for every point.
  kBorder,
  // More than two faces, two that wind the same way, or faces of several edges that were united
  // (touching.h): treated as a jump for every point.
  kIrregular,
  // Two coplanar faces (exactly, or to rounding) with equal shading normals: never a jump but on
  // their common plane.
  kFlat,
  // Two faces of any shapes that pass through each other along it, see crossing_curves.h: treated
  // as a jump for every point.
  kCrossing,
};

const char* edge_class_name(EdgeClass edge_class);

struct Edge {
  // Welded vertices of the mesh; the first face runs from [0] to [1]. Where a face without area
  // met a long side, an edge may be a part of that side.
  std::array<VertexId, 2> vertices;
  std::array<FaceId, 2> faces;  // two of its own mesh's faces around it; [1] is none if it has one
  EdgeClass edge_class = EdgeClass::kSmooth;
  bool concave = false;  // two faces, each in front of the other's plane
  uint8_t rim = 0;       // the edge moves with those faces around it that have this number
};

// No border of what moves: the surface goes on across the edge.
inline constexpr uint8_t kNoRim = 255;
// As many numbers of rims there are at most in one place; the last stands for all further ones.
inline constexpr uint8_t kMostRims = 8;

// How a face lies around an edge.
struct Incidence {
  // The edge runs through the inside of the face, which therefore lies on both sides of it; else
  // the edge is on the face's border.
  bool through = false;
  // Faces whose common border moves as one share a number; where there are several numbers, each
  // has an edge of its own in this place. kNoRim: a face that the edge runs through, or that
  // another one continues in its plane, which looks and moves alike.
  uint8_t rim = 0;
  bool operator==(const Incidence&) const = default;
};

// All faces of a scene that touch an edge along its whole length, and those so near to it that rays
// cannot tell on which side of it they pass (touching.h).
struct FacesAround {
  std::span<const FaceRef> faces;
  std::span<const Incidence> incidences;  // of each; empty if all are as by default
  std::span<const FaceRef> near = {};     // no face is in both
  std::span<const FaceRef> all = faces;   // the faces, then the near ones
  Incidence incidence(size_t i) const { return incidences.empty() ? Incidence{} : incidences[i]; }
};

// n . x + offset is the signed distance of x, positive in front; n is zero for a face without area.
struct Plane {
  Vec3d n;
  double offset = 0;
  double distance(const Vec3d& x) const { return dot(n, x) + offset; }
};

// A vertex on an edge of its mesh that was cut there: (1 - t) of its first end and t of the other.
struct CutVertex {
  std::array<VertexId, 2> ends;
  double t = 0;
};

// The edges of one mesh (an object), with all that a query needs. Welded: copies of a vertex along
// a texture seam are one vertex.
struct EdgeMesh {
  std::vector<Vec3d> positions;       // V, world space, the floats that Embree sees
  std::vector<Vec3<Lanes>> tangents;  // V; empty where nothing moves
  std::vector<CutVertex> cuts;        // the last of the V, where edges of other meshes end on them
  std::vector<Plane> planes;          // F, outward, double precision
  std::vector<Edge> edges;            // E
  ShapeId shape;                      // whose faces `planes` are; none for crossing curves
  // The faces around edge e: incident_faces[face_offsets[e], face_offsets[e + 1]), of any shape;
  // those of `shape` come first.
  std::vector<uint32_t> face_offsets;  // E + 1
  std::vector<FaceRef> incident_faces;
  std::vector<Incidence> incidences;  // of incident_faces; empty if all are as by default
  // FacesAround::all of edge e, if faces are near to it, else nothing:
  // faces_and_near[near_offsets[e], near_offsets[e + 1]). Both are empty if there are none at all.
  std::vector<uint32_t> near_offsets;  // E + 1
  std::vector<FaceRef> faces_and_near;
  // The mesh is closed and its surfaces are black from behind: a point that sees only back faces
  // sees no jump at a sharp edge, and concave edges are never silhouettes from outside.
  // United edges are irregular and stand outside of this rule.
  // Holds if every connected part encloses positive volume (a part turned inside out, or the cavity
  // of a hollow body, makes it false); parts that cross themselves are beyond this test.
  bool one_sided_closed = false;
  double extent = 0;  // largest |x| of a position that a face uses

  const Edge& edge(EdgeId id) const { return edges[id.index()]; }
  const Plane& plane(FaceId id) const { return planes[id.index()]; }
  const Vec3d& position(VertexId id) const { return positions[id.index()]; }
  const Vec3<Lanes>& tangent(VertexId id) const { return tangents[id.index()]; }
  std::span<const FaceRef> faces_around(EdgeId id) const {
    const uint32_t *begin = &face_offsets[id.index()], *end = begin + 1;
    return {incident_faces.data() + *begin, *end - *begin};
  }
  FacesAround around(EdgeId id) const {
    FacesAround around{faces_around(id), {}};
    const size_t count = around.faces.size();
    if (!incidences.empty()) around.incidences = {&incidences[face_offsets[id.index()]], count};
    if (!near_offsets.empty() && near_offsets[id.index() + 1] > near_offsets[id.index()]) {
      const uint32_t *begin = &near_offsets[id.index()], *end = begin + 1;
      around.all = {faces_and_near.data() + *begin, *end - *begin};
      around.near = around.all.subspan(count);
    }
    return around;
  }
  // For edges that are looked at soon: bring into the cache the edge itself; and once that is
  // there, its ends and its faces.
  void fetch_edge(EdgeId id) const {
    __builtin_prefetch(&edges[id.index()]);
    __builtin_prefetch(&face_offsets[id.index()]);
  }
  void fetch_ends(EdgeId id) const {
    for (const VertexId vertex : edge(id).vertices) {
      __builtin_prefetch(&positions[vertex.index()]);
      if (tangents.empty()) continue;
      const char* begin = reinterpret_cast<const char*>(&tangents[vertex.index()]);
      __builtin_prefetch(begin);
      __builtin_prefetch(begin + sizeof(Vec3<Lanes>) - 1);
    }
    __builtin_prefetch(incident_faces.data() + face_offsets[id.index()]);
  }
  uint64_t count(EdgeClass edge_class) const;
  // The first of the above that does not hold, in words; empty if all of it does.
  std::string validate() const;
};

// An edge of a scene, or none.
struct EdgeRef {
  ShapeId object;  // whose EdgeMesh it is in
  EdgeId edge;
  bool operator==(const EdgeRef&) const = default;
};

// mesh.weld must be filled. black_behind: the mesh's BSDF is black from behind. shape: whose mesh
// it is. Faces without area
// stay in `planes` with a zero normal and have no edges: their neighbours' sides are split at the
// corners that lie on them, so that the neighbours meet. Copies of a vertex that move differently
// tear the surface: both rims are borders.
EdgeMesh build_edge_mesh(const Mesh& mesh, bool black_behind, ShapeId shape = ShapeId(0));

// Bound of the rounding error of Plane::distance(p) for the planes of a mesh: within it of zero, p
// counts as lying on either side.
double distance_error(const EdgeMesh& mesh, const Vec3d& p);

// Whether incident radiance at p may jump across the edge: the set E(p), exactly, in double
// precision, without regard to occlusion. Smooth edges: p lies in front of exactly one of the two
// planes (a distance of zero, to rounding, counts as either side, so that an edge is rather listed
// than lost); never, if concave and one_sided_closed: the mesh itself hides such an edge from every
// point that lies between its planes. Sharp: p is in front of at least one face, or the mesh is not
// one_sided_closed. Border, irregular, crossing: always. Flat: as smooth.
bool is_candidate(const EdgeMesh& mesh, EdgeId edge, const Vec3d& p);

// On which sides of a face's plane a point counts as lying: on both within the rounding of its
// distance.
struct Facing {
  bool front, back;
};
Facing facing(const EdgeMesh& mesh, FaceId face, const Vec3d& p);
// is_candidate of an edge with two faces, from where these are turned like that.
bool is_candidate(const EdgeMesh& mesh, EdgeId edge, Facing first, Facing second);

// Whether the edge is in E(p) and its faces may leave one side of it free, so that what lies behind
// it is seen there: silhouettes of all classes, borders, irregular edges. It is E(p) without sharp
// edges that have a face on either side as seen from p, and without those that their own mesh
// hides.
bool is_outline(const EdgeMesh& mesh, EdgeId edge, const Vec3d& p);

}  // namespace limn
