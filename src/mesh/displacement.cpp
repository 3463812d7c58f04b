// Vertex normals for displacement, independent of the shading normals.
#include "limn/core/displacement.h"

namespace limn {

std::vector<Vec3d> displacement_directions(const Mesh& mesh) {
  Mesh smooth;
  smooth.positions = mesh.positions;
  smooth.faces = mesh.faces;
  smooth.weld = mesh.weld;
  smooth.normal_source = NormalSource::kComputed;
  update_shading_normals(smooth);
  std::vector<Vec3d> of_root(mesh.positions.size()), directions;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    for (int c = 0; c < 3; ++c) {
      of_root[mesh.weld[mesh.faces[f][c]]] = smooth.normals[smooth.normal_ids[f][c]];
    }
  }
  for (const uint32_t root : mesh.weld) directions.push_back(of_root[root]);
  return directions;
}

}  // namespace limn
