// Edges that pass through faces: every edge traced as a ray.
#include "limn/integrators/crossings.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "limn/core/shading.h"
#include "limn/edgetree/edges.h"

namespace limn {
namespace {

// The faces around each welded vertex.
std::vector<std::vector<FaceRef>> faces_by_vertex(const Mesh& mesh, ShapeId shape) {
  std::vector<std::vector<FaceRef>> faces(mesh.positions.size());
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    for (const uint32_t vertex : mesh.faces[f]) {
      faces[mesh.weld[vertex]].push_back({shape, FaceId(f)});
    }
  }
  return faces;
}

// Whether the segment from a to b passes through the triangle, in double precision: a ray tracer's
// answer is noise where the two lie in one plane.
bool passes_through(const Vec3d& a, const Vec3d& b, const std::array<Vec3d, 3>& triangle) {
  const Vec3d n = cross(triangle[1] - triangle[0], triangle[2] - triangle[0]);
  const double d_a = dot(n, a - triangle[0]);
  const double d_b = dot(n, b - triangle[0]);
  if ((d_a < 0) == (d_b < 0)) return false;
  const Vec3d x = a + (b - a) * (d_a / (d_a - d_b));
  for (int i = 0; i < 3; ++i) {
    const Vec3d& corner = triangle[i];
    if (dot(cross(triangle[(i + 1) % 3] - corner, x - corner), n) < 0) return false;
  }
  return true;
}

// The first hit of the ray (an edge from a to b) that holds in double precision.
bool first_crossing(const Scene& scene, const RayTracer& tracer, Ray ray, const Vec3d& a,
                    const Vec3d& b, Hit& hit) {
  while (tracer.closest(ray, hit)) {
    const Mesh& mesh = scene.shape(hit.face.shape).mesh;
    if (passes_through(a, b, face_corners<double>(mesh, hit.face.face))) return true;
    // The next float: the ray tracer may compute in single precision.
    ray.t_min = std::nextafter(static_cast<float>(std::max(hit.t, ray.t_min)), INFINITY);
    if (ray.t_min >= ray.t_max) return false;
  }
  return false;
}

}  // namespace

Crossings find_crossings(const Scene& scene, const RayTracer& tracer) {
  Crossings crossings;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Mesh& mesh = scene.shapes[s].mesh;
    const EdgeMesh edges = build_edge_mesh(mesh, false);
    const auto around = faces_by_vertex(mesh, ShapeId(s));
    for (const Edge& edge : edges.edges) {
      const Vec3d a = edges.position(edge.vertices[0]);
      const Vec3d b = edges.position(edge.vertices[1]);
      // Faces that share an end with the edge touch it without crossing.
      std::vector<FaceRef> skipped = around[edge.vertices[0].index()];
      const auto& more = around[edge.vertices[1].index()];
      skipped.insert(skipped.end(), more.begin(), more.end());
      const double distance = length(b - a);
      Ray ray{a, (b - a) / distance, 0, distance};
      ray.skip_faces = skipped;
      Hit hit;
      if (!first_crossing(scene, tracer, ray, a, b, hit)) continue;
      if (crossings.edges++ == 0) {
        crossings.shape_a = ShapeId(s);
        crossings.shape_b = hit.face.shape;
      }
    }
  }
  return crossings;
}

}  // namespace limn
