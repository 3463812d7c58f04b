#pragma once
// Where a texture is discontinuous on a face of a mesh, whatever its texture coordinates follow
// from.
#include "limn/core/texture.h"

namespace limn {

// As Texture::add_discontinuities. Where texture coordinates are not linear over the face (spheres,
// disks) lines are curves: segments lie off them by about kOffCurve at most, but around the axis.
// The meridian where an angle comes back to its beginning is not found.
bool add_face_discontinuities(const Texture& texture, const Mesh& mesh, FaceId face, size_t most,
                              Texture::Discontinuities& lines);

// In barycentric coordinates.
inline constexpr double kOffCurve = 0x1p-9;

}  // namespace limn
