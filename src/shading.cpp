#include "limn/core/shading.h"

namespace limn {

SurfacePoint<double> surface_at(const Scene& scene, FaceRef face, double b1, double b2) {
  SurfacePoint<double> point;
  point.shape = &scene.shapes[face.shape];
  point.face = face;
  const Mesh& mesh = point.shape->mesh;
  const auto corners = face_corners<double>(mesh, face.face);
  const Vec3d e1 = corners[1] - corners[0];
  const Vec3d e2 = corners[2] - corners[0];
  point.p = corners[0] + e1 * b1 + e2 * b2;
  point.n_g = normalize(cross(e1, e2));
  if (mesh.normal_source == NormalSource::kFace) {
    point.n_s = point.n_g;
  } else {
    detail::interpolate_shading<double>(mesh, b1, b2, point);
  }
  return point;
}

}  // namespace limn
