// Velocities and spins of shapes and cameras, and the times of the shutter.
#include <fmt/format.h>

#include <algorithm>

#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "src/scene/motion.h"

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
              std::vector<std::string>*) const override {
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
  // At the end of the exposure, by which edges that move are found: at the reference time all
  // vertices are at rest. Derivatives are those of set_time().
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
  void assign(Scene& scene, const std::string& name, const std::vector<double>& value,
              std::vector<std::string>* warnings) const override {
    const Shutter& now = scene.exposure->shutters[scene.sensor];
    const bool opens = time_ == &Shutter::open;
    if (value.size() == 1 && (opens ? value[0] > now.close.v : value[0] < now.open.v)) {
      throw InputError({scene.file},
                       fmt::format("parameter \"{}\": {:g}: it must not be {}, {:g}", name,
                                   value[0], opens ? "after shutter_close" : "before shutter_open",
                                   opens ? now.close.v : now.open.v));
    }
    ExposureNumber::assign(scene, name, value, warnings);
  }

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
  const Course& course =
      shape.valid() ? scene.exposure->shapes[shape.index()] : scene.exposure->cameras[scene.sensor];
  for (const bool spins : {false, true}) {
    for (int axis = 0; axis < 3; ++axis) {
      list.push_back({id + (spins ? ".spin." : ".velocity.") + "xyz"[axis],
                      spins ? "radians per unit of time" : "scene units per unit of time",
                      0.01 * (spins ? 1 : size) / half_open(scene), 1,
                      std::make_shared<CourseRate>(shape, spins, axis)});
      // Of a course at rest the derivative is that of a translation or a rotation, times a time.
      list.back().repeats = !course.moves();
    }
  }
}

}  // namespace

bool needs_times(const Scene& scene, std::span<const Parameter> parameters) {
  return is_moving(scene) || std::ranges::any_of(parameters, [](const Parameter& parameter) {
           return dynamic_cast<const ExposureNumber*>(parameter.motion.get()) != nullptr;
         });
}

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
