// Poses of cameras in and out.
#include "limn/core/camera_pose.h"

#include <cmath>

#include "limn/core/error.h"

namespace limn {

Matrix4 camera_to_world(const Scene& scene) {
  const Camera& camera = scene.camera;
  const Vec3d columns[4] = {value(camera.left), value(camera.up), value(camera.forward),
                            value(camera.origin)};
  Matrix4 to_world;
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 3; ++row) to_world.m[row][column] = columns[column][row];
  }
  return to_world;
}

namespace {

Vec3<Dual> dual(const Vec3d& v) { return {v.x, v.y, v.z}; }

}  // namespace

Camera place_camera(const Scene& scene, const Matrix4& to_world) {
  constexpr double kDigits = 1e-3;  // as in scene files
  const auto column = [&](int k) {
    return Vec3d{to_world.m[0][k], to_world.m[1][k], to_world.m[2][k]};
  };
  bool rigid = to_world.m[3][0] == 0 && to_world.m[3][1] == 0 && to_world.m[3][2] == 0 &&
               to_world.m[3][3] == 1;
  for (int k = 0; k < 3; ++k) {
    rigid = rigid && std::fabs(length(column(k)) - 1) <= kDigits &&
            std::fabs(dot(column(k), column((k + 1) % 3))) <= kDigits;
  }
  if (!rigid) {
    throw InputError({scene.file}, "a camera can be moved and rotated, not scaled or sheared");
  }
  const Vec3d origin = column(3);
  for (int k = 0; k < 3; ++k) {
    if (std::fabs(origin[k]) <= kLargestCoordinate) continue;
    throw InputError({scene.file}, "the camera would have a coordinate beyond 2e12");
  }
  const Vec3d forward = normalize(column(2));
  const Vec3d up = normalize(column(1) - forward * dot(forward, column(1)));
  const Vec3d left = cross(up, forward);
  Camera camera = scene.camera;
  camera.forward = dual(forward);
  camera.up = dual(up);
  camera.left = dual(dot(left, column(0)) > 0 ? left : -left);
  camera.origin = dual(origin);
  return camera;
}

}  // namespace limn
