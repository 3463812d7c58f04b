// Texture coordinates of a point of a face.
#include <cmath>

#include "limn/core/texture.h"
#include "src/base/angles.h"

namespace limn {

namespace {

// An angle over 2 pi, in [0, 1].
template <class S>
S turns(const S& y, const S& x) {
  const S t = angle_of(y, x) * (1 / (2 * kPi));
  return value(t) < 0 ? t + 1.0 : t;
}

// The slope at the axis is that of no direction: it is taken as 0 there.
template <class S>
S distance_from_axis(const Vec3<S>& p) {
  using std::sqrt;
  const S square = p.x * p.x + p.y * p.y;
  return value(square) > 0 ? sqrt(square) : S(0.0);
}

template <class S>
std::array<S, 2> coordinates(UvSource source, const Vec3<S>& place) {
  switch (source) {
    case UvSource::kSphere:
      return {turns(place.y, place.x), angle_of(distance_from_axis(place), place.z) * (1 / kPi)};
    case UvSource::kDisk:
      return {distance_from_axis(place), turns(place.y, place.x)};
    default:
      return {place.x, place.y};
  }
}

}  // namespace

template <class S>
TexturePoint<S> texture_point(const Mesh& mesh, FaceId face, const std::array<S, 2>& b) {
  TexturePoint<S> point{&mesh, face, b, {}};
  if (mesh.uv_source == UvSource::kNone) return point;
  const FaceIndices& ids = mesh.uv_ids[face.index()];
  Vec3d corners[3];
  for (int k = 0; k < 3; ++k) corners[k] = cast<double>(mesh.uv_places[ids[k]]);
  const Vec3d e1 = corners[1] - corners[0], e2 = corners[2] - corners[0];
  Vec3<S> place;
  for (int k = 0; k < 3; ++k) place[k] = corners[0][k] + e1[k] * b[0] + e2[k] * b[1];
  point.uv = coordinates(mesh.uv_source, place);
  return point;
}

template TexturePoint<double> texture_point(const Mesh&, FaceId, const std::array<double, 2>&);
template TexturePoint<Dual> texture_point(const Mesh&, FaceId, const std::array<Dual, 2>&);

}  // namespace limn
