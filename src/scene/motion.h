#pragma once
// Effects of parameters on a scene: one class per kind of motion.
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "limn/core/parameter.h"

namespace limn {

class Motion {
 public:
  virtual ~Motion() = default;

  virtual Moved moved() const = 0;
  // These functions are documented at Parameter.
  virtual void seed(Scene& scene, int lane, size_t component) const = 0;
  virtual void move(Scene& scene, double step, size_t component) const = 0;
  virtual std::vector<double> numbers(const Scene& scene) const;
  // Default: InputError, as there is no value to set.
  virtual void assign(Scene& scene, const std::string& name, const std::vector<double>& value,
                      std::vector<std::string>* warnings) const;
  virtual std::vector<Vec3d> velocities(const Scene& scene, ShapeId shape, size_t component) const;
  virtual TexelMap* texel_map(Scene&) const { return nullptr; }
  virtual Image texel_velocities(const Scene& scene, size_t component) const;

  // A copy that stores what it needs of the current scene; null if it needs nothing.
  virtual std::shared_ptr<const Motion> held(const Scene&) const { return nullptr; }
  // As in Parameter.
  virtual std::vector<Vec3d> directions(const Scene&) const { return {}; }

  // The component of an array or colour named by the suffix `rest` (":FILE", ".7.x", ".r"). Nothing
  // for an unknown suffix; InputError for an invalid one.
  virtual std::optional<Parameter> part(const Scene& scene, const Parameter& whole,
                                        const std::string& rest) const;
  // As limn::along(), of a direction with as many finite numbers as the whole; nothing of what is
  // one number.
  virtual std::optional<Parameter> along(const Scene& scene, const Parameter& whole,
                                         const std::vector<double>& direction) const;
  // How to name a component of the array `name`, for messages.
  virtual std::string parts(const std::string& name) const;
};

// The motion of one component of an array.
std::shared_ptr<const Motion> one_component(std::shared_ptr<const Motion> array, size_t component);

// InputError unless there are `count` values within the bounds.
void check_numbers(const Scene& scene, const std::string& name, const std::vector<double>& value,
                   size_t count, double least, double most);

// The unit vector of an axis (0 to 2), and the rotation of v about it by `angle` [radians].
Vec3d unit_vector(int axis);
Vec3d turned(const Vec3d& v, int axis, double angle);
// The diagonal of the bounds of all shapes; 1 if there is none.
double scene_size(const Scene& scene);

void add_shape_parameters(const Scene& scene, std::vector<Parameter>& list);    // shape_motion.cpp
void add_camera_parameters(const Scene& scene, std::vector<Parameter>& list);   // camera_motion.cpp
void add_course_parameters(const Scene& scene, std::vector<Parameter>& list);   // course_motion.cpp
void add_bsdf_parameters(const Scene& scene, std::vector<Parameter>& list);     // value_motion.cpp
void add_emitter_parameters(const Scene& scene, std::vector<Parameter>& list);  // value_motion.cpp
void add_texel_parameters(const Scene& scene, std::vector<Parameter>& list);    // texel_motion.cpp

}  // namespace limn
