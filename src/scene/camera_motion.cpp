// Motions of the camera.
#include <algorithm>
#include <cmath>
#include <limits>

#include "src/scene/motion.h"
#include "src/scene/motion_lists.h"

namespace limn {

namespace {

class CameraTranslation final : public Motion {
 public:
  explicit CameraTranslation(int axis) : axis_(axis) {}
  Moved moved() const override { return {.camera = true}; }
  void seed(Scene& scene, int lane, size_t) const override {
    scene.camera.origin[axis_].d[lane] += 1;
  }
  void move(Scene& scene, double step, size_t) const override {
    scene.camera.origin[axis_].v += step;
  }
  std::vector<double> numbers(const Scene& scene) const override {
    return {scene.camera.origin[axis_].v};
  }
  void assign(Scene& scene, const std::string& name, const std::vector<double>& value,
              std::vector<std::string>*) const override {
    check_numbers(scene, name, value, 1, -kLargestCoordinate, kLargestCoordinate);
    scene.camera.origin[axis_].v = value[0];
  }

 private:
  int axis_;
};

// Rotation about the pinhole.
class CameraRotation final : public Motion {
 public:
  explicit CameraRotation(int axis) : axis_(axis) {}
  Moved moved() const override { return {.camera = true}; }
  void seed(Scene& scene, int lane, size_t) const override {
    for (Vec3<Dual>* v : frame(scene.camera)) {
      const Vec3d velocity = cross(unit_vector(axis_), value(*v));
      for (int k = 0; k < 3; ++k) (*v)[k].d[lane] += velocity[k];
    }
  }
  void move(Scene& scene, double step, size_t) const override {
    for (Vec3<Dual>* v : frame(scene.camera)) {
      const Vec3d to = turned(value(*v), axis_, step);
      for (int k = 0; k < 3; ++k) (*v)[k].v = to[k];
    }
  }

 private:
  static std::array<Vec3<Dual>*, 3> frame(Camera& camera) {
    return {&camera.left, &camera.up, &camera.forward};
  }
  int axis_;
};

class FieldOfView final : public Motion {
 public:
  // The field of view lies strictly between 0 and 180 degrees.
  static constexpr double kLeast = std::numeric_limits<double>::min();
  static double most() { return std::nextafter(180.0, 0.0); }

  Moved moved() const override { return {.camera = true}; }
  void seed(Scene& scene, int lane, size_t) const override { scene.camera.fov.d[lane] += 1; }
  void move(Scene& scene, double step, size_t) const override { scene.camera.fov.v += step; }
  std::vector<double> numbers(const Scene& scene) const override { return {scene.camera.fov.v}; }
  void assign(Scene& scene, const std::string& name, const std::vector<double>& value,
              std::vector<std::string>*) const override {
    check_numbers(scene, name, value, 1, kLeast, most());
    scene.camera.fov.v = value[0];
  }
};

}  // namespace

void add_camera_parameters(const Scene& scene, std::vector<Parameter>& list) {
  const double step = 0.01 * scene_size(scene);
  for (int axis = 0; axis < 3; ++axis) {
    const std::string end(1, "xyz"[axis]);
    list.push_back({"sensor.translate." + end, "scene units", step, 1,
                    std::make_shared<CameraTranslation>(axis)});
    list.push_back(
        {"sensor.rotate." + end, "radians", 0.01, 1, std::make_shared<CameraRotation>(axis)});
  }
  list.push_back({"sensor.fov", "degrees", 0.01 * scene.camera.fov.v, 1,
                  std::make_shared<FieldOfView>(), FieldOfView::kLeast, FieldOfView::most()});
}

}  // namespace limn
