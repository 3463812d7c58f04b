#pragma once
// Building blocks of shading normals: face normals and angles, cancellation.
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
  // Welded vertices move together: positions are those of the first copy.
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

// The share of a sum of face normals below which its direction is meaningless: rounding or
// cancellation. noise: sum of angles times roundings; angles: their sum.
inline double rest_of_cancelled(double noise, double angles) {
  return std::max(64 * std::numeric_limits<double>::epsilon(), std::min(noise, 0x1.0p-10 * angles));
}

}  // namespace limn
