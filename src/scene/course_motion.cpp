// Velocities and spins of shapes and cameras, and the times of the shutter.
#include <algorithm>

#include "limn/core/exposure.h"
#include "src/scene/motion.h"
#include "src/scene/motion_lists.h"

namespace limn {
namespace {

double half_open(const Scene& scene) {
  const Shutter& shutter = scene.exposure->shutters[scene.sensor];
  return 0.5 * (shutter.close.v - shutter.open.v);
}

// A number of the exposure.
class ExposureNumber : public Motion {
 public:
  void seed(Scene& scene, int lane, size_t) const final { own(scene).d[lane] += 1; }
  void move(Scene& scene, double step, size_t) const final { own(scene).v += step; }
  std::vector<double> numbers(const Scene& scene) const final {
    return {number(*scene.exposure, scene.sensor).v};
  }
  void assign(Scene& scene, const std::string& name, const std::vector<double>& value,
              std::vector<std::string>*) const final {
    check_numbers(scene, name, value, 1, -kLargestCoordinate, kLargestCoordinate);
    own(scene).v = value[0];
  }

 protected:
  virtual Dual& number(Exposure& exposure, size_t sensor) const = 0;

 private:
  Dual& own(Scene& scene) const { return number(own_exposure(scene), scene.sensor); }
};

// A velocity or a spin, of a shape or (none) of the camera.
class CourseRate final : public ExposureNumber {
 public:
  CourseRate(ShapeId shape, bool spins, int axis) : shape_(shape), spins_(spins), axis_(axis) {}
  Moved moved() const override { return {.vertices = shape_.valid(), .camera = !shape_.valid()}; }
  // Those at the end of the exposure: at the reference time all vertices are at rest.
  std::vector<Vec3d> velocities(const Scene& scene, ShapeId shape, size_t) const override {
    if (!shape_.valid() || shape != shape_) return {};
    const Vec3d center = scene.exposure->shapes[shape.index()].center;
    std::vector<Vec3d> velocities;
    for (const Vec3f& p : scene.shape(shape).mesh.positions) {
      const Vec3d unit = unit_vector(axis_) * half_open(scene);
      velocities.push_back(spins_ ? cross(unit, cast<double>(p) - center) : unit);
    }
    return velocities;
  }

 protected:
  Dual& number(Exposure& exposure, size_t sensor) const override {
    Course& course = shape_.valid() ? exposure.shapes[shape_.index()] : exposure.cameras[sensor];
    return spins_ ? course.spin[axis_] : course.velocity[axis_];
  }

 private:
  ShapeId shape_;
  bool spins_;
  int axis_;
};

class ShutterTime final : public ExposureNumber {
 public:
  ShutterTime(Dual Shutter::*time, const Moved& moved) : time_(time), moved_(moved) {}
  Moved moved() const override { return moved_; }

 protected:
  Dual& number(Exposure& exposure, size_t sensor) const override {
    return exposure.shutters[sensor].*time_;
  }

 private:
  Dual Shutter::*time_;
  Moved moved_;
};

void add_rates(const Scene& scene, const std::string& id, ShapeId shape, double size,
               std::vector<Parameter>& list) {
  for (const bool spins : {false, true}) {
    for (int axis = 0; axis < 3; ++axis) {
      list.push_back({id + (spins ? ".spin." : ".velocity.") + "xyz"[axis],
                      spins ? "radians per unit of time" : "scene units per unit of time",
                      0.01 * (spins ? 1 : size) / half_open(scene), 1,
                      std::make_shared<CourseRate>(shape, spins, axis)});
    }
  }
}

}  // namespace

void add_course_parameters(const Scene& scene, std::vector<Parameter>& list) {
  if (!scene.exposure || !(half_open(scene) > 0)) return;
  const Exposure& exposure = *scene.exposure;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    if (shape.id.empty()) continue;
    add_rates(scene, shape.id, ShapeId(s), bounds_of(shape.mesh).diagonal(), list);
  }
  add_rates(scene, "sensor", ShapeId(), scene_size(scene), list);
  const auto moves = [](const Course& course) { return course.moves(); };
  const Moved moved{.vertices = std::ranges::any_of(exposure.shapes, moves),
                    .camera = moves(exposure.cameras[scene.sensor])};
  if (!moved.any()) return;
  const double step = 0.02 * half_open(scene);
  for (const auto& [name, time] : {std::pair{"sensor.shutter_open", &Shutter::open},
                                   {"sensor.shutter_close", &Shutter::close}}) {
    list.push_back({name, "units of time", step, 1, std::make_shared<ShutterTime>(time, moved)});
    list.back().repeats = true;  // derivatives in forward mode alone
  }
}

}  // namespace limn
