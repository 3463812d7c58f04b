#pragma once
// What shading normals are made of: normals and angles of faces, tilts, and where sums cancel.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "limn/core/mesh.h"

namespace limn {

inline constexpr uint32_t kUnused = UINT32_MAX;

template <class S>
Vec3<S> position_as(const Mesh& mesh, VertexId vertex) {
  return as<S>(mesh.position(vertex));
}

// The unit normal of a face and the angles at its corners.
template <class S>
struct FaceShape {
  bool has_area = false;
  Vec3<S> normal;
  std::array<S, 3> angles;
  double rounding = 0;  // [rad] how far the rounding of its corners may have turned the normal
};

// Corners off by 2^-22 of the largest coordinate, one up and one down (weld_seams.cpp).
inline double normal_rounding(const std::array<Vec3d, 3>& corners, double doubled_area) {
  double size = 0, longest = 0;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) size = std::max(size, std::fabs(corners[i][k]));
    longest = std::max(longest, length(corners[(i + 1) % 3] - corners[i]));
  }
  return 0x1.0p-21 * size * longest / doubled_area;
}

template <class S>
FaceShape<S> face_shape(const Mesh& mesh, FaceId face) {
  using std::atan2;
  const FaceIndices& f = mesh.face(face);
  // Copies of a vertex move together: the first one stands for all.
  std::array<Vec3<S>, 3> p;
  for (int i = 0; i < 3; ++i) p[i] = position_as<S>(mesh, VertexId(mesh.weld[f[i]]));
  const Vec3<S> a = p[1] - p[0], b = p[2] - p[0], c = p[2] - p[1];
  const Vec3<S> doubled_area = cross(a, b);
  const S size = length(doubled_area);
  FaceShape<S> shape;
  shape.has_area = has_area(value(p[0]), value(p[1]), value(p[2]));
  if (!shape.has_area) return shape;
  shape.normal = doubled_area / size;
  shape.rounding = normal_rounding({value(p[0]), value(p[1]), value(p[2])}, value(size));
  shape.angles = {S(atan2(size, dot(a, b))), S(atan2(size, -dot(a, c))), S(atan2(size, dot(b, c)))};
  return shape;
}

// How much of a sum of face normals may be rounding alone, or is too little to say a direction.
// noise: the sum of angles times roundings; angles: their sum.
inline double rest_of_cancelled(double noise, double angles) {
  return std::max(64 * std::numeric_limits<double>::epsilon(), std::min(noise, 0x1.0p-10 * angles));
}

// Sine of the tilt of a corner's normal against its face; 1 if it is no less than a right angle.
// The sine is the length of the cross product, which is exact where sqrt(1 - cos^2) would lose all
// digits.
template <class S>
S sine_of_tilt(const Vec3<S>& normal, const Vec3<S>& face_normal) {
  if (value(dot(normal, face_normal)) <= 0) return S(1);
  const S sine = length(cross(normal, face_normal));
  return sine < 1.0 ? sine : S(1);
}

// How far rounding may have turned the normal of a face against that of a corner [rad]. At most
// what leaves the derivative of a mesh far from the origin its meaning; not tuned.
inline double tilt_rounding(double face, double corner) {
  return std::min(0x1.0p-16, face + corner);
}

}  // namespace limn
