// Parameters by name, and messages about unknown names.
#include "limn/core/parameter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "limn/core/check.h"
#include "limn/core/names.h"
#include "src/scene/motion.h"

namespace limn {

namespace {

std::optional<Parameter> find_own(const std::vector<Parameter>& list, const Scene& scene,
                                  const std::string& name) {
  for (const Parameter& p : list) {
    if (p.name == name) {
      Parameter found = p;
      if (const auto held = p.motion->held(scene)) found.motion = held;
      return found;
    }
    if (!name.starts_with(p.name)) continue;
    if (auto part = p.motion->part(scene, p, name.substr(p.name.size()))) return part;
  }
  return std::nullopt;
}

// Also finds Mitsuba's names, which number nested BSDFs.
std::optional<Parameter> find_nested(const std::vector<Parameter>& list, const Scene& scene,
                                     const std::string& name) {
  if (auto found = find_own(list, scene, name)) return found;
  constexpr std::pair<std::string_view, std::string_view> kParts[] = {{".nested_bsdf.", "."},
                                                                      {".brdf_0.", "."},
                                                                      {".brdf_0.", ".front."},
                                                                      {".brdf_1.", ".back."},
                                                                      {".x_fov", ".fov"}};
  for (const auto& [mitsuba, own] : kParts) {
    const size_t at = name.find(mitsuba);
    if (at == std::string::npos || (own == ".fov" && scene.camera.x_factor != 1)) continue;
    const std::string here = std::string(name).replace(at, mitsuba.size(), own);
    if (auto found = find_nested(list, scene, here)) return found;
  }
  return std::nullopt;
}

// The same parameter, called by "sensor" in place of the selected sensor's id.
std::string of_sensor(const Scene& scene, const std::string& name) {
  if (scene.sensor >= scene.sensors.size()) return name;
  const std::string& id = scene.sensors[scene.sensor].id;
  return id.empty() || !name.starts_with(id + ".") ? name : "sensor" + name.substr(id.size());
}

[[noreturn]] void fail_unknown(const Scene& scene, const std::string& name,
                               const std::vector<Parameter>& list) {
  std::vector<std::string> names;
  for (const Parameter& p : list) names.push_back(p.name);
  std::string advice = "nearest: " + join(nearest_names(name, names, 5));
  const bool is_of_shape =
      std::any_of(scene.shapes.begin(), scene.shapes.end(),
                  [&](const Shape& shape) { return shape.id == name.substr(0, name.rfind('.')); });
  if (is_of_shape && name.ends_with(".positions")) advice = "they are called vertex_positions";
  if (is_of_shape && name.ends_with(".faces")) advice = "see mesh() and set_mesh() in Python";
  if (name.ends_with(".film.size")) advice = "see resize() in Python";
  if (of_sensor(scene, name) == "sensor.x_fov" && scene.camera.x_factor != 1) {
    advice = "sensor.fov is along the file's fov_axis, which is not x";
  }
  throw UnknownParameter({scene.file}, "unknown parameter \"" + name + "\" (" + advice + ")");
}

// Whether a texture in use is discontinuous where no edge is known: then nothing may move. Those of
// surfaces list the borders of their texels, but for the slopes of bumps, which are discontinuous
// between faces, too.
bool has_texel_borders(const Scene& scene) {
  for (const Shape& shape : scene.shapes) {
    for (int k = 0; k < shape.bsdf->texture_count(); ++k) {
      const Texture& texture = shape.bsdf->texture(k);
      if (texture.discontinuous_between_texels() && texture.discontinuous_between_faces())
        return true;
    }
  }
  return std::any_of(scene.delta_lights.begin(), scene.delta_lights.end(), [](const auto& light) {
    return light->texture() && light->texture()->discontinuous_between_texels();
  });
}

void add_moving_parameters(const Scene& scene, std::vector<Parameter>& list) {
  add_shape_parameters(scene, list);
  add_camera_parameters(scene, list);
  add_course_parameters(scene, list);
}

void check_nothing_moves(const Scene& scene, const std::string& name) {
  std::vector<Parameter> moving;
  add_moving_parameters(scene, moving);
  for (const Parameter& p : moving) {
    if (name != p.name && !name.starts_with(p.name + ".") && !name.starts_with(p.name + ":")) {
      continue;
    }
    throw InputError({scene.file}, "parameter \"" + name +
                                       "\": no term covers texel borders of a nearest "
                                       "bitmap of a light or bumpmap: use bilinear");
  }
}

}  // namespace

std::vector<size_t> Parameter::shape() const {
  if (colour) return {3};
  return array;
}

void Parameter::seed(Scene& scene, int lane, size_t component) const {
  CHECK_LE(0, lane);
  CHECK_LT(lane, kLanes);
  CHECK_LT(component, size);
  motion->seed(scene, lane, component);
}

Scene Parameter::moved(const Scene& scene, double step, size_t component) const {
  CHECK_LT(component, size);
  Scene copy = deep_copy(scene);
  motion->move(copy, step, component);
  return copy;
}

void Parameter::move(Scene& scene, double step, size_t component) const {
  CHECK_LT(component, size);
  motion->move(scene, step, component);
}

void Parameter::move_checked(Scene& scene, double step) const {
  CHECK_EQ(size, 1u);
  if (!std::isfinite(step)) {
    throw InputError({scene.file},
                     fmt::format("parameter \"{}\": the step {:g} is not finite", name, step));
  }
  std::vector<double> numbers = value(scene);
  if (!numbers.empty()) {
    for (double& x : numbers) x += step;
    return assign(scene, numbers);
  }
  Scene there = moved(scene, step);
  for (uint32_t i = 0; i < there.shapes.size(); ++i) {
    if (velocities(scene, ShapeId(i)).empty()) continue;
    double largest = 0;
    for (const Vec3f& p : there.shapes[i].mesh.positions) {
      for (int k = 0; k < 3; ++k) largest = std::max(largest, std::fabs(double{p[k]}));
    }
    const bool is_point = bounds_of(there.shapes[i].mesh).diagonal() == 0 ||
                          (there.shapes[i].pivot && there.shapes[i].pivot->size <= 0);
    if (largest <= kLargestCoordinate && !is_point) continue;
    throw InputError(
        {scene.file},
        fmt::format("parameter \"{}\": a step of {:g} is too long: the shape would {}", name, step,
                    largest <= kLargestCoordinate
                        ? "be a point, or inside out"
                        : fmt::format("go beyond {:g}", kLargestCoordinate)));
  }
  scene = std::move(there);
}

std::vector<double> Parameter::value(const Scene& scene) const { return motion->numbers(scene); }

void Parameter::assign(Scene& scene, const std::vector<double>& value,
                       std::vector<std::string>* warnings) const {
  motion->assign(scene, name, value, warnings);
}

Moved moved_by(std::span<const Parameter> parameters) {
  Moved moved;
  for (const Parameter& parameter : parameters) moved = moved | parameter.motion->moved();
  return moved;
}

std::vector<Vec3d> Parameter::velocities(const Scene& scene, ShapeId shape,
                                         size_t component) const {
  CHECK_LT(component, size);
  return motion->velocities(scene, shape, component);
}

std::vector<Vec3d> Parameter::directions(const Scene& scene) const {
  return motion->directions(scene);
}

TexelMap* Parameter::texel_map(Scene& scene) const { return motion->texel_map(scene); }

const TexelMap* Parameter::texel_map(const Scene& scene) const {
  return motion->texel_map(const_cast<Scene&>(scene));  // it is looked up alone
}

Image Parameter::texel_velocities(const Scene& scene, size_t component) const {
  CHECK_LT(component, size);
  return motion->texel_velocities(scene, component);
}

std::vector<Parameter> list_parameters(const Scene& scene) {
  std::vector<Parameter> list;
  if (!has_texel_borders(scene)) add_moving_parameters(scene, list);
  add_bsdf_parameters(scene, list);
  add_emitter_parameters(scene, list);
  add_texel_parameters(scene, list);
  return list;
}

Parameter find_parameter_or_array(const Scene& scene, const std::string& name) {
  constexpr std::string_view kOneValue = ".value";
  const size_t size = name.size() - (name.ends_with(kOneValue) ? kOneValue.size() : 0);
  const std::vector<Parameter> list = list_parameters(scene);
  const std::string whole = name.substr(0, size);
  for (const std::string& own : {whole, of_sensor(scene, whole)}) {
    if (auto found = find_nested(list, scene, own)) {
      found->name = name;  // results are looked up by the name that was given
      return *found;
    }
  }
  if (has_texel_borders(scene)) check_nothing_moves(scene, name);
  fail_unknown(scene, name, list);
}

Parameter find_parameter(const Scene& scene, const std::string& name) {
  Parameter parameter = find_parameter_or_array(scene, name);
  if (parameter.size == 1) return parameter;
  throw InputError({scene.file},
                   "parameter \"" + name + "\" is an array of " + std::to_string(parameter.size) +
                       " numbers, and one is wanted: " + parameter.motion->parts(name));
}

Parameter along(const Scene& scene, const Parameter& whole, const std::vector<double>& direction) {
  const auto fail = [&](const std::string& text) {
    throw InputError({scene.file},
                     fmt::format("the direction of parameter \"{}\" {}", whole.name, text));
  };
  if (direction.size() != whole.numbers()) {
    fail(fmt::format("must have {} numbers, but has {}", whole.numbers(), direction.size()));
  }
  for (size_t i = 0; i < direction.size(); ++i) {
    if (!std::isfinite(static_cast<float>(direction[i])))
      fail(fmt::format("is not finite in single precision (number {}, from 0)", i));
  }
  auto field = whole.motion->along(scene, whole, direction);
  if (!field) fail("would be one number: scale the derivative in its place");
  field->name = whole.name;
  return *field;
}

}  // namespace limn
