#pragma once
// Interpolated normals, and how far above a face rays start.
//
// Interpolated normals n_s mean a smooth surface, but rays meet flat faces: of the directions above
// the smooth surface, n_s.wo > 0, some lie below the face, and a ray that started on the face would
// begin inside the mesh, on this face and not on its neighbour. So rays start above the face, after
// J. Hanika, Hacking the Shadow Terminator, Ray Tracing Gems II, 2021: with c_k the corners, n_k
// their normals, b_k the barycentric coordinates of the hit x and d_k = (x - c_k).n_k,
//     p = x + sum over k of g_k b_k d_k n_k.
// Seen from outside, g_k = -1 where x lies below the tangent plane of a corner (d_k < 0), which is
// Hanika's point. Where x lies above it, in a hollow, Hanika has 0; here g_k = kHollowLift, so that
// no ray starts inside there either: what lies below the face sees the face itself. p is continuous
// across edges, as it depends on the corners of an edge alone there, and faces whose corners have
// their own normal stay as they are.
#include <algorithm>
#include <array>
#include <cmath>

#include "limn/core/dual.h"
#include "limn/core/mesh.h"
#include "limn/core/prefetch.h"
#include "limn/core/vec.h"

namespace limn::detail {

// The less, the nearer is the start to the face, and the noisier are derivatives where the faces of
// a hollow are seen from themselves. Not tuned.
inline constexpr double kHollowLift = 0.125;

// How far each corner lifts a point (the factors g_k above), and whether it comes clear of the
// face.
struct Lift {
  std::array<double, 3> gain{};
  bool clear = false;
};

// b, depth: b_k and d_k above; side: 1 if the face is seen from outside, else -1; size: twice the
// area of the face.
inline Lift lift_of(const std::array<Vec3d, 3>& normals, const std::array<double, 3>& b,
                    const std::array<double, 3>& depth, const Vec3d& n_g, double side, double size,
                    const Vec3d& p) {
  // Relative to the face. Less is rounding: a tie, where the mean of both sides' slopes stands.
  constexpr double kTie = 0x1p-20, kClear = 0x1p-17;
  Lift lift;
  double height = 0;
  for (int k = 0; k < 3; ++k) {
    if (!(b[k] > 0)) continue;  // rounding puts points beyond a side
    const double above = side * depth[k];
    const bool tie = above * above <= kTie * kTie * size;
    lift.gain[k] = tie ? 0.5 * (kHollowLift - 1) : above < 0 ? -1 : kHollowLift;
    height += side * lift.gain[k] * b[k] * depth[k] * dot(normals[k], n_g);
  }
  // Normals that point to the other side of the face do not lift.
  if (height < -kClear * std::sqrt(size)) return {};
  const double coordinate = std::max({std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)});
  lift.clear = height > 0 && height * height > kClear * kClear * size &&
               height > 0x1p-21 * coordinate;  // the rounding of rays
  return lift;
}

template <class S>
std::array<Vec3<S>, 3> corner_normals(const Mesh& mesh, FaceId face) {
  const FaceIndices& ids = mesh.normal_ids[face.index()];
  std::array<Vec3<S>, 3> n;
  for (int k = 0; k < 3; ++k) {
    const Vec3d& a = mesh.normals[ids[k]];
    n[k] = {a.x, a.y, a.z};
    if constexpr (!std::is_same_v<S, double>) {
      if (mesh.normal_tangents.empty()) continue;
      const Vec3<Lanes> d = mesh.normal_tangents[ids[k]];
      n[k] = {{a.x, d.x}, {a.y, d.y}, {a.z, d.z}};
    }
  }
  return n;
}

// Brings what interpolate_shading reads into the cache, while the plane is still to be met.
template <class S>
void fetch_shading(const Mesh& mesh, FaceId face) {
  const auto fetch = [](const auto& values, uint32_t i) {
    const char* begin = reinterpret_cast<const char*>(&values[i]);
    prefetch(begin);
    if (sizeof(values[i]) > 64) prefetch(begin + sizeof(values[i]) - 1);
  };
  const FaceIndices& ids = mesh.normal_ids[face.index()];
  const FaceIndices& vertices = mesh.face(face);
  for (int k = 0; k < 3; ++k) {
    fetch(mesh.normals, ids[k]);
    // Plain numbers read no tangents.
    if constexpr (!std::is_same_v<S, double>) {
      if (!mesh.position_tangents.empty()) mesh.position_tangents.fetch(vertices[k]);
      if (!mesh.normal_tangents.empty()) mesh.normal_tangents.fetch(ids[k]);
    }
  }
}

}  // namespace limn::detail
