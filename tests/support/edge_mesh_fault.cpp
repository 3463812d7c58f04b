// Checks the invariants of EdgeMesh.
#include "support/edge_mesh_fault.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "edgetree/edges/contacts.h"

namespace limn {
namespace {

std::pair<VertexId, VertexId> ends_of(const Edge& edge) {
  return std::minmax(edge.vertices[0], edge.vertices[1]);
}

const char* fault_of_sizes(const EdgeMesh& mesh) {
  if (!mesh.tangents.empty() && mesh.tangents.size() != mesh.positions.size())
    return "there are other than V tangents";
  const size_t offsets = mesh.face_offsets.size();
  if (offsets > 0 && offsets != mesh.edges.size() + 1) return "there are other than E + 1 offsets";
  if (!mesh.incidences.empty() && mesh.incidences.size() != mesh.incident_faces.size())
    return "there are other incidences than incident faces";
  if (mesh.incident_faces.size() != (offsets == 0 ? 0 : mesh.face_offsets.back()))
    return "offsets do not span the incident faces";
  for (size_t e = 0; e + 1 < offsets; ++e)
    if (mesh.face_offsets[e] >= mesh.face_offsets[e + 1]) return "an edge has no faces";
  for (const Edge& edge : mesh.edges)
    for (const FaceId face : edge.faces)
      if (face.valid() && face.index() >= mesh.planes.size())
        return "an edge's face is out of range";
  if (!mesh.near_offsets.empty() && (mesh.near_offsets.size() != mesh.edges.size() + 1 ||
                                     mesh.near_offsets.back() != mesh.faces_and_near.size()))
    return "offsets do not span the near faces";
  for (const FaceRef face : mesh.incident_faces)
    if (face.shape == mesh.shape && face.face.index() >= mesh.planes.size())
      return "an incident face is out of range";
  for (const Edge& edge : mesh.edges)
    if (ends_of(edge).second.index() >= mesh.positions.size()) return "a vertex is out of range";
  return nullptr;
}

// The normal is a unit vector up to rounding, or zero.
const char* fault_of(const Plane& plane) {
  const double squared = length_squared(plane.n);
  if (squared == 0) return plane.offset == 0 ? nullptr : "a plane without a normal has an offset";
  return std::fabs(squared - 1) <= 8 * 0x1.0p-53 ? nullptr
                                                 : "a plane's normal is not a unit vector";
}

// Largest distance between copies of a vertex (contacts.h).
double welding_error(const EdgeMesh& mesh) { return touch_tolerance(mesh.extent, mesh.extent); }

const char* fault_of_faces(const EdgeMesh& mesh, EdgeId id) {
  const Edge& edge = mesh.edge(id);
  const FaceList around = mesh.faces_around(id);
  if (around[0] != FaceRef{mesh.shape, edge.faces[0]})
    return "its first face is not the first around it";
  const bool has_second = around.size() > 1 && around[1].shape == mesh.shape;
  if (edge.faces[1] != (has_second ? around[1].face : FaceId::none()))
    return "its second face is not the second around it";
  for (size_t i = 0; i < around.size(); ++i) {
    if (around[i].shape != mesh.shape) continue;
    if (i > 0 && around[i - 1].shape != mesh.shape) return "its own mesh's faces do not come first";
    const Plane& plane = mesh.plane(around[i].face);
    if (length_squared(plane.n) == 0) return "a face around it has no area";
    for (const VertexId vertex : edge.vertices)
      if (std::fabs(plane.distance(mesh.position(vertex))) > welding_error(mesh))
        return "an end lies off the plane of a face around it";
  }
  return nullptr;
}

// Intersection segments: both faces pass through the edge. Contact lines: the first face ends
// there, and others may be around.
const char* fault_of_crossing(const EdgeMesh& mesh, EdgeId id) {
  if (mesh.shape.valid()) return "a mesh has an edge where faces cross";
  const FacesAround around = mesh.around(id);
  if (around.faces.size() < 2) return "less than two faces cross";
  const bool contact = !around.incidence(0).through;
  if (!contact && around.faces.size() > 2) return "more than two faces cross";
  for (size_t i = 0; i < 2; ++i) {
    if (!around.faces[i].shape.valid()) return "a face that crosses is of no shape";
    if (!contact &&
        around.incidence(i) != Incidence{.through = true, .motion_group = kNoMotionGroup})
      return "a face that crosses ends there";
  }
  return nullptr;
}

// An edge of a texture runs through one face.
const char* fault_of_texture(const EdgeMesh& mesh, EdgeId id) {
  const FacesAround around = mesh.around(id);
  if (mesh.places.size() != mesh.positions.size()) return "there are other than V places";
  if (around.faces.size() != 1) return "it is inside of other than one face";
  if (around.incidence(0) != Incidence{.through = true, .motion_group = kNoMotionGroup})
    return "its face ends there";
  return fault_of_faces(mesh, id);
}

const char* fault_of_rims(const EdgeMesh& mesh, EdgeId id) {
  const FacesAround around = mesh.around(id);
  bool moves_with_it = false;
  for (size_t i = 0; i < around.faces.size(); ++i) {
    const Incidence incidence = around.incidence(i);
    if (incidence.through && incidence.motion_group != kNoMotionGroup)
      return "a face that it runs through has a motion_group";
    if (incidence.motion_group >= kMostMotionGroups && incidence.motion_group != kNoMotionGroup)
      return "a motion_group is out of range";
    moves_with_it |= incidence.motion_group == mesh.edge(id).motion_group;
  }
  return moves_with_it ? nullptr : "no face around it moves with it";
}

const char* fault_of_class(const EdgeMesh& mesh, EdgeId id) {
  const Edge& edge = mesh.edge(id);
  const size_t faces = mesh.faces_around(id).size();
  const bool irregular = edge.edge_class == EdgeClass::kIrregular;
  if ((edge.edge_class == EdgeClass::kBoundary) != (faces == 1)) return "a border has one face";
  if (faces > 2 && !irregular) return "more than two faces make it irregular";
  if (edge.concave && (faces != 2 || irregular || edge.edge_class == EdgeClass::kFlat))
    return "only smooth and sharp edges are concave";
  if (mesh.one_sided_closed && (faces == 1 || (faces == 2 && irregular)))
    return "a closed mesh has neither borders nor irregular edges";
  return nullptr;
}

const char* fault_of_edge(const EdgeMesh& mesh, EdgeId id) {
  const Edge& edge = mesh.edge(id);
  if (edge.vertices[0] == edge.vertices[1]) return "its two ends are one vertex";
  if (id.index() > 0 && ends_of(mesh.edges[id.index() - 1]) >= ends_of(edge))
    return "edges are not sorted by their vertices";
  for (const VertexId vertex : edge.vertices)
    if (!(length(mesh.position(vertex)) <= mesh.extent)) return "an end lies beyond the extent";
  if (edge.edge_class == EdgeClass::kIntersection) return fault_of_crossing(mesh, id);
  if (edge.edge_class == EdgeClass::kTexture) return fault_of_texture(mesh, id);
  if (const char* fault = fault_of_faces(mesh, id)) return fault;
  if (const char* fault = fault_of_rims(mesh, id)) return fault;
  return fault_of_class(mesh, id);
}

}  // namespace

std::string fault_of(const EdgeMesh& mesh) {
  if (const char* fault = fault_of_sizes(mesh)) return fault;
  for (size_t f = 0; f < mesh.planes.size(); ++f)
    if (const char* fault = fault_of(mesh.planes[f]))
      return "face " + std::to_string(f) + ": " + fault;
  for (uint32_t e = 0; e < mesh.edges.size(); ++e)
    if (const char* fault = fault_of_edge(mesh, EdgeId(e)))
      return "edge " + std::to_string(e) + ": " + fault;
  return {};
}

}  // namespace limn
