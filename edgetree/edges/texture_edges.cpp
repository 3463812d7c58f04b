// Segments inside of faces as edges.
#include "limn/edgetree/texture_edges.h"

#include <algorithm>

namespace limn {
namespace {

// Exact where the corners agree.
template <class T>
T on_face(const std::array<T, 3>& corners, const std::array<double, 2>& b) {
  return corners[0] + (corners[1] - corners[0]) * b[0] + (corners[2] - corners[0]) * b[1];
}

}  // namespace

EdgeMesh texture_edges(const Mesh& mesh, const EdgeMesh& edges, bool black_behind,
                       std::span<const FaceSegment> segments) {
  EdgeMesh result;
  result.shape = edges.shape;
  result.planes = edges.planes;
  result.one_sided_closed = black_behind;
  result.face_offsets.push_back(0);
  for (const FaceSegment& segment : segments) {
    if (edges.plane(segment.face).n == Vec3d{}) continue;
    const auto corners = face_corners<double>(mesh, segment.face);
    const Vec3d ends[2] = {on_face(corners, segment.from), on_face(corners, segment.to)};
    if (ends[0] == ends[1]) continue;
    const FaceIndices& face = mesh.face(segment.face);
    Edge edge;
    edge.edge_class = EdgeClass::kTexture;
    edge.faces = {segment.face, FaceId::none()};
    for (int e = 0; e < 2; ++e) {
      const std::array<double, 2>& b = e == 0 ? segment.from : segment.to;
      edge.vertices[e] = VertexId(static_cast<uint32_t>(result.positions.size()));
      result.positions.push_back(ends[e]);
      result.places.push_back(b);
      result.extent = std::max(result.extent, length(ends[e]));
      if (mesh.position_tangents.empty()) continue;
      const std::array<Vec3<Lanes>, 3> tangents = {mesh.position_tangents[face[0]],
                                                   mesh.position_tangents[face[1]],
                                                   mesh.position_tangents[face[2]]};
      result.tangents.push_back(on_face(tangents, b));
    }
    result.edges.push_back(edge);
    result.incident_faces.push_back({result.shape, segment.face});
    result.incidences.push_back({.through = true, .motion_group = kNoMotionGroup});
    result.face_offsets.push_back(static_cast<uint32_t>(result.incident_faces.size()));
  }
  return result;
}

}  // namespace limn
