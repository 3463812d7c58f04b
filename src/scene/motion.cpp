// Defaults of Motion, which suit most parameters, and the motion of one component of an array.
#include "src/scene/motion.h"

#include <fmt/format.h>

#include <cmath>

namespace limn {

namespace {

class OneComponent final : public Motion {
 public:
  OneComponent(std::shared_ptr<const Motion> array, size_t component)
      : array_(std::move(array)), component_(component) {}

  Moved moved() const override { return array_->moved(); }
  void seed(Scene& scene, int lane, size_t) const override {
    array_->seed(scene, lane, component_);
  }
  void move(Scene& scene, double step, size_t) const override {
    array_->move(scene, step, component_);
  }
  std::vector<Vec3d> velocities(const Scene& scene, ShapeId shape, size_t) const override {
    return array_->velocities(scene, shape, component_);
  }
  TexelMap* texel_map(Scene& scene) const override { return array_->texel_map(scene); }
  Image texel_velocities(const Scene& scene, size_t) const override {
    return array_->texel_velocities(scene, component_);
  }

 private:
  std::shared_ptr<const Motion> array_;
  size_t component_;
};

}  // namespace

std::shared_ptr<const Motion> one_component(std::shared_ptr<const Motion> array, size_t component) {
  return std::make_shared<OneComponent>(std::move(array), component);
}

std::vector<double> Motion::numbers(const Scene&) const { return {}; }

void Motion::assign(Scene& scene, const std::string& name, const std::vector<double>&,
                    std::vector<std::string>*) const {
  throw InputError({scene.file}, "parameter \"" + name +
                                     "\" moves things from where they are and has no value to set: "
                                     "move it by a step");
}

std::vector<Vec3d> Motion::velocities(const Scene&, ShapeId, size_t) const { return {}; }

Image Motion::texel_velocities(const Scene&, size_t) const { return {}; }

std::optional<Parameter> Motion::part(const Scene&, const Parameter&, const std::string&) const {
  return std::nullopt;
}

std::optional<Parameter> Motion::along(const Scene&, const Parameter&,
                                       const std::vector<double>&) const {
  return std::nullopt;
}

std::string Motion::parts(const std::string& name) const { return name; }

void check_numbers(const Scene& scene, const std::string& name, const std::vector<double>& value,
                   size_t count, double least, double most) {
  if (value.size() != count) {
    throw InputError({scene.file}, fmt::format("parameter \"{}\" holds {} number{}, not {}", name,
                                               count, count == 1 ? "" : "s", value.size()));
  }
  for (const double v : value) {
    if (std::isfinite(v) && v >= least && v <= most) continue;
    const bool bounded = std::isfinite(least) || std::isfinite(most);
    throw InputError(
        {scene.file},
        fmt::format("parameter \"{}\" cannot be {:g}: it must be finite{}", name, v,
                    bounded ? fmt::format(" and lie in [{:g}, {:g}]", least, most) : ""));
  }
}

Vec3d unit_vector(int axis) {
  Vec3d v;
  v[axis] = 1;
  return v;
}

Vec3d turned(const Vec3d& v, int axis, double angle) {
  const int i = (axis + 1) % 3, j = (axis + 2) % 3;
  const double c = std::cos(angle), s = std::sin(angle);
  Vec3d r = v;
  r[i] = c * v[i] - s * v[j];
  r[j] = s * v[i] + c * v[j];
  return r;
}

double scene_size(const Scene& scene) {
  return scene.shapes.empty() ? 1 : bounds_of(scene).diagonal();
}

}  // namespace limn
