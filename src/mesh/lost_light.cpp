// Light that faces hide from the smooth surface that interpolated normals describe.
#include "src/mesh/mesh_build.h"

#include <array>
#include <cmath>

#include "limn/core/surface_lift.h"

namespace limn {
namespace {

// Exact for quadratics.
constexpr std::array<std::array<double, 3>, 3> kPoints = {
    {{2.0 / 3, 1.0 / 6, 1.0 / 6}, {1.0 / 6, 2.0 / 3, 1.0 / 6}, {1.0 / 6, 1.0 / 6, 2.0 / 3}}};

// At a tilt of the normal by an angle a, the part (1 - cos a) / 2 of uniform light comes from below
// the face. It passes where corners lift the point above the face, and is blocked where they do
// not.
double lost_at(const std::array<double, 3>& b, const std::array<Vec3d, 3>& corners,
               const std::array<Vec3d, 3>& normals, const Vec3d& n_g, double size) {
  Vec3d x, n_s;
  for (int k = 0; k < 3; ++k) {
    x += corners[k] * b[k];
    n_s += normals[k] * b[k];
  }
  const double cosine = dot(n_s, n_g) / length(n_s);
  if (!(cosine > 0)) return 0;
  std::array<double, 3> depth;
  for (int k = 0; k < 3; ++k) depth[k] = dot(x - corners[k], normals[k]);
  const detail::Lift lift = detail::lift_of(normals, b, depth, n_g, 1, size, x);
  double lifting = 0, all = 0;
  for (int k = 0; k < 3; ++k) {
    const double part = b[k] * std::fabs(depth[k]);
    all += part;
    if (lift.gain[k] < 0) lifting += part;
  }
  return all > 0 ? (1 - lifting / all) * (1 - cosine) / 2 : 0;
}

}  // namespace

double lost_light(const Mesh& mesh) {
  if (mesh.normal_source == NormalSource::kFace) return 0;
  double lost = 0, area = 0;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const auto corners = face_corners<double>(mesh, FaceId(f));
    const Vec3d n = cross(corners[1] - corners[0], corners[2] - corners[0]);
    const double size = length(n);
    if (!(size > 0)) continue;
    const auto normals = detail::corner_normals<double>(mesh, FaceId(f));
    for (const auto& b : kPoints) lost += size * lost_at(b, corners, normals, n / size, size);
    area += size * static_cast<double>(kPoints.size());
  }
  return area > 0 ? lost / area : 0;
}

}  // namespace limn
