// What happens at an edge that a path starts on: decided in the plane across it.
#include "integrators/terms/path.h"

namespace limn {

Vec3d direction_into_face(const Mesh& mesh, FaceId face, const Vec3d& x0, const Vec3d& along) {
  Vec3d best{};
  double best_length = 0;
  for (const Vec3d& corner : face_corners<double>(mesh, face)) {
    const Vec3d a = corner - x0;
    const Vec3d across = a - along * dot(a, along);
    const double across_length = length(across);
    if (across_length > best_length) {
      best_length = across_length;
      best = across / across_length;
    }
  }
  return best;
}

// In the plane across the edge a face is a ray {s g, s >= 0} and the path starts at a point f of
// its own face, |f| -> 0. It meets g where f + r w = s g with r, s > 0; by Cramer's rule r = (f x
// g) / (g x w), s = (f x w) / (g x w). Lengths drop out.
std::optional<FaceId> blocked_at_edge(const Scene& scene, const EdgeStart& edge, FaceId start,
                                      const Vec3d& direction) {
  const Mesh& mesh = scene.shape(edge.shape).mesh;
  const Vec3d along = normalize(edge.x1 - edge.x0);
  const Vec3d f = direction_into_face(mesh, start, edge.x0, along);
  const auto turn = [&](const Vec3d& a, const Vec3d& b) { return dot(along, cross(a, b)); };
  std::optional<FaceId> nearest;
  double nearest_r = 0;
  for (const FaceId face : edge.faces) {
    if (face == start) continue;
    const Vec3d g = direction_into_face(mesh, face, edge.x0, along);
    const double gw = turn(g, direction);
    const double r = turn(f, g) / gw;
    const double s = turn(f, direction) / gw;
    if (gw == 0 || !(r > 0) || !(s > 0)) continue;
    if (!nearest || r < nearest_r) {
      nearest = face;
      nearest_r = r;
    }
  }
  return nearest;
}

}  // namespace limn
