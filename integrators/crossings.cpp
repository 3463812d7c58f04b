#include "limn/integrators/crossings.h"

#include "limn/edgetree/edges.h"

namespace limn {
namespace {

// The faces around each welded vertex.
std::vector<std::vector<uint32_t>> faces_by_vertex(const Mesh& mesh) {
  std::vector<std::vector<uint32_t>> faces(mesh.positions.size());
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    for (const uint32_t vertex : mesh.faces[f]) faces[mesh.weld[vertex]].push_back(f);
  }
  return faces;
}

}  // namespace

Crossings find_crossings(const Scene& scene, const RayTracer& tracer) {
  Crossings crossings;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Mesh& mesh = scene.shapes[s].mesh;
    const EdgeMesh edges = build_edge_mesh(mesh, false);
    const auto around = faces_by_vertex(mesh);
    for (const Edge& edge : edges.edges) {
      const Vec3d a = edges.positions[edge.vertices[0]];
      const Vec3d b = edges.positions[edge.vertices[1]];
      // Faces that share an end with the edge touch it without crossing.
      std::vector<uint32_t> skipped = around[edge.vertices[0]];
      const auto& more = around[edge.vertices[1]];
      skipped.insert(skipped.end(), more.begin(), more.end());
      const double distance = length(b - a);
      Ray ray{a, (b - a) / distance, 0, distance};
      ray.skip_shape = s;
      ray.skip_faces = skipped;
      Hit hit;
      if (!tracer.closest(ray, hit)) continue;
      if (crossings.edges++ == 0) {
        crossings.shape_a = s;
        crossings.shape_b = hit.face.shape;
      }
    }
  }
  return crossings;
}

}  // namespace limn
