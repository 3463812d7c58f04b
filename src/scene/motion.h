#pragma once
// What a parameter does to a scene: one class per kind of motion.
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "limn/core/parameter.h"

namespace limn {

class Motion {
 public:
  virtual ~Motion() = default;

  // See Parameter.
  virtual void seed(Scene& scene, int lane, size_t component) const = 0;
  virtual void move(Scene& scene, double step, size_t component) const = 0;
  virtual std::vector<double> numbers(const Scene& scene) const;
  // By default InputError: there are no numbers.
  virtual void assign(Scene& scene, const std::string& name, const std::vector<double>& value,
                      std::vector<std::string>* warnings) const;
  virtual std::vector<Vec3d> velocities(const Scene& scene, ShapeId shape, size_t component) const;
  virtual Image texel_velocities(const Scene& scene, size_t component) const;

  // This motion with what it takes from the scene as it is there; null: it takes nothing later.
  virtual std::shared_ptr<const Motion> held(const Scene&) const { return nullptr; }
  // See Parameter.
  virtual std::vector<Vec3d> directions(const Scene&) const { return {}; }
  // See Parameter.
  virtual ShapePose pose_per_unit(ShapeId /*shape*/) const { return {}; }
  // This motion of the shape after it was moved; null: it is no other there.
  virtual std::shared_ptr<const Motion> at(const ShapePose&) const { return nullptr; }

  // The part of an array or colour whose name continues its own with `rest` (":FILE", ".7.x",
  // ".r"); nothing if `rest` means nothing here. InputError if it means something that cannot be.
  virtual std::optional<Parameter> part(const Scene& scene, const Parameter& whole,
                                        const std::string& rest) const;
  // How to name a part of the array called `name`, for messages.
  virtual std::string parts(const std::string& name) const;
};

// One number of an array.
std::shared_ptr<const Motion> one_component(std::shared_ptr<const Motion> array, size_t component);

// InputError unless there are `count` numbers, all within the bounds.
void check_numbers(const Scene& scene, const std::string& name, const std::vector<double>& value,
                   size_t count, double least, double most);

// Coordinate axis 0 to 2, and v turned about it by `angle` [radians].
Vec3d unit_vector(int axis);
Vec3d turned(const Vec3d& v, int axis, double angle);
// The diagonal of the bounds of all shapes; 1 if there is none.
double scene_size(const Scene& scene);

}  // namespace limn
