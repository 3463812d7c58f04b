// Faces that overlap in a plane: no line within it parts them.
#include "limn/edgetree/overlaps.h"

#include <algorithm>
#include <cmath>

#include "edgetree/edges/contacts.h"

namespace limn {
namespace {

using Corners = std::array<Vec3d, 3>;

Corners corners_of(const Mesh& mesh, FaceId face) {
  const FaceIndices& f = mesh.face(face);
  return {cast<double>(mesh.positions[f[0]]), cast<double>(mesh.positions[f[1]]),
          cast<double>(mesh.positions[f[2]])};
}

Vec3d unit_normal(const Corners& c) { return normalize(cross(c[1] - c[0], c[2] - c[0])); }

bool lies_in_plane(const Corners& corners, const Vec3d& x, const Vec3d& n, double tolerance) {
  return std::all_of(corners.begin(), corners.end(), [&](const Vec3d& corner) {
    return std::fabs(dot(n, corner - x)) <= tolerance;
  });
}

// Whether `b` lies beyond a side of `a`, but for what `tolerance` explains.
bool lies_beside(const Corners& a, const Vec3d& n, const Corners& b, double tolerance) {
  for (int k = 0; k < 3; ++k) {
    const Vec3d inward = normalize(cross(n, a[(k + 1) % 3] - a[k]));
    const auto is_out = [&](const Vec3d& x) { return dot(inward, x - a[k]) <= tolerance; };
    if (std::all_of(b.begin(), b.end(), is_out)) return true;
  }
  return false;
}

bool overlap(const Mesh& mesh_a, FaceId face_a, const Mesh& mesh_b, FaceId face_b) {
  if (!has_area(mesh_a, mesh_a.face(face_a)) || !has_area(mesh_b, mesh_b.face(face_b)))
    return false;
  const Corners a = corners_of(mesh_a, face_a), b = corners_of(mesh_b, face_b);
  const Vec3d na = unit_normal(a), nb = unit_normal(b);
  const double tolerance = touch_tolerance(size_of(mesh_a, face_a), size_of(mesh_b, face_b));
  if (!lies_in_plane(b, a[0], na, tolerance) || !lies_in_plane(a, b[0], nb, tolerance))
    return false;
  const double most = kShortestTouch * tolerance;
  return !lies_beside(a, na, b, most) && !lies_beside(b, nb, a, most);
}

}  // namespace

std::vector<FacePair> find_overlaps(std::span<const Mesh* const> meshes,
                                    std::span<const FacePair> pairs) {
  std::vector<FacePair> overlaps;
  std::copy_if(pairs.begin(), pairs.end(), std::back_inserter(overlaps), [&](const FacePair& pair) {
    return overlap(*meshes[pair.first.shape.index()], pair.first.face,
                   *meshes[pair.second.shape.index()], pair.second.face);
  });
  return overlaps;
}

}  // namespace limn
