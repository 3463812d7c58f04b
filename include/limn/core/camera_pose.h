#pragma once
// The pose of a scene's camera as a matrix.
#include "limn/core/matrix.h"
#include "limn/core/scene.h"

namespace limn {

// From camera space (+X to the left of the image, +Y up, +Z along the view) to the world.
Matrix4 camera_to_world(const Scene& scene);

// The scene's camera at another pose. InputError unless the matrix is finite, moves and rotates
// alone (a mirrored camera is allowed, as in Mitsuba), and puts the camera where rays can be traced
// (kLargestCoordinate).
Camera place_camera(const Scene& scene, const Matrix4& to_world);

}  // namespace limn
