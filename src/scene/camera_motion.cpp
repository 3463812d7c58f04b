// Motions of the camera.
#include <cmath>
#include <limits>

#include "limn/core/exposure.h"
#include "src/scene/motion.h"

namespace limn {

namespace {

class CameraTranslation final : public Motion {
 public:
  explicit CameraTranslation(int axis) : axis_(axis) {}
  Moved moved() const override { return {.camera = true}; }
  void seed(Scene& scene, int lane, size_t) const override {
    scene.camera.origin[axis_].d[lane] += 1;
    if (Course* course = course_of(scene)) course->shift[axis_][lane] += 1;
  }
  void move(Scene& scene, double step, size_t) const override {
    scene.camera.origin[axis_].v += step;
    if (Course* course = course_of(scene)) course->translate(unit_vector(axis_) * step);
  }
  std::vector<double> numbers(const Scene& scene) const override {
    return {scene.camera.origin[axis_].v};
  }
  void assign(Scene& scene, const std::string& name, const std::vector<double>& value,
              std::vector<std::string>*) const override {
    check_numbers(scene, name, value, 1, -kLargestCoordinate, kLargestCoordinate);
    move(scene, value[0] - scene.camera.origin[axis_].v, 0);
    scene.camera.origin[axis_].v = value[0];
  }

 private:
  // Which moves as a whole.
  static Course* course_of(Scene& scene) {
    return scene.exposure ? &own_exposure(scene).cameras[scene.sensor] : nullptr;
  }
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

// A number of the camera, larger than 0.
class CameraNumber final : public Motion {
 public:
  static constexpr double kLeast = std::numeric_limits<double>::min();

  CameraNumber(Dual Camera::*number, double most) : number_(number), most_(most) {}
  Moved moved() const override { return {.camera = true}; }
  void seed(Scene& scene, int lane, size_t) const override { number(scene).d[lane] += 1; }
  void move(Scene& scene, double step, size_t) const override { number(scene).v += step; }
  std::vector<double> numbers(const Scene& scene) const override {
    return {(scene.camera.*number_).v};
  }
  void assign(Scene& scene, const std::string& name, const std::vector<double>& value,
              std::vector<std::string>*) const override {
    check_numbers(scene, name, value, 1, kLeast, most_);
    number(scene).v = value[0];
  }

 private:
  Dual& number(Scene& scene) const { return scene.camera.*number_; }
  Dual Camera::*number_;
  double most_;
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
  const auto add = [&](const char* name, const char* unit, Dual Camera::*number, double most) {
    list.push_back({name, unit, 0.01 * (scene.camera.*number).v, 1,
                    std::make_shared<CameraNumber>(number, most), CameraNumber::kLeast, most});
  };
  if (!scene.camera.is_orthographic()) {
    add("sensor.fov", "degrees", &Camera::fov, std::nextafter(180.0, 0.0));
  }
  if (!scene.camera.has_lens()) return;
  add("sensor.aperture_radius", "scene units", &Camera::aperture_radius, kLargestCoordinate);
  add("sensor.focus_distance", "scene units", &Camera::focus_distance, kLargestCoordinate);
}

}  // namespace limn
