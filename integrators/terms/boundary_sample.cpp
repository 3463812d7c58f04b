// Linear forms on velocities.
#include "integrators/terms/boundary_sample.h"

#include <cmath>

#include "limn/core/reverse.h"

namespace limn {

std::array<double, 3> barycentric(const std::array<Vec3d, 3>& corners, const Vec3d& x) {
  const Vec3d area = cross(corners[1] - corners[0], corners[2] - corners[0]);
  const double scale = 1 / length_squared(area);
  std::array<double, 3> b;
  for (int k = 0; k < 3; ++k) {
    b[k] = dot(area, cross(corners[(k + 1) % 3] - x, corners[(k + 2) % 3] - x)) * scale;
  }
  return b;
}

// With a = v_ray, c the velocity of the face at x and n its normal, x moves with
//   a + omega n . (c - a) / (n . omega).
// What x is lifted to moves as x, its face's corners c_k and their normals make it. Moved together,
// they carry it along, so the derivatives of g . p with respect to x and c_k sum up to g, and
//   g . v_p = g . a + g_x . (v_x - a) + sum_k (g_k . (v_k - a) + m_k . dn_k).
double BoundaryForm::add_seen_point(const Scene& scene, FaceRef face, const Vec3d& omega,
                                    const Vec3d& g) {
  const auto c = face_corners<double>(scene.shape(face.shape).mesh, face.face);
  const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
  const double slope = dot(n, omega);
  Vec3d of_x = g;
  if (is_lifted(scene, face.shape)) {
    const ShadingAdjoint of = pull_back_shading(scene, face, x, omega, g, {});
    of_x = of.x;
    lift = {face, of.corners, of.normals};
  }
  const Vec3d across = n * (dot(of_x, omega) / slope);
  points[count++] = {MovingPoint::Of::kFace, nullptr, {}, 0, face, nullptr, across, x};
  return std::fabs(slope) / length(n);
}

Vec3d BoundaryForm::of_ray() const {
  Vec3d sum;
  for (const MovingPoint& point : all()) {
    if (point.light && point.light->origin().infinite) continue;
    sum = sum - point.g;
  }
  if (lift) {
    for (const Vec3d& g : lift->of_corners) sum = sum - g;
  }
  return sum;
}

}  // namespace limn
