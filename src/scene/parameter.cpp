#include "limn/core/parameter.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "src/base/text.h"
#include "src/mesh/mesh_build.h"

namespace limn {

namespace {

enum class Motion {
  kTranslate,  // of a shape
  kRotate,     // of a shape, about the centre of its bounds
  kScale,      // of a shape, about the centre of its bounds
  kVertices,   // along a vector field
  kCameraMove,
  kCameraTurn,
  kFieldOfView,
  kValues,  // numbers of a BSDF or a light
};

// What a name stands for in one scene.
struct Target {
  ParameterInfo info;
  Motion motion;
  Shape* shape = nullptr;
  int axis = 0;
  std::string file;
  std::vector<Dual*> values;
};

const std::string kVertexPositions = "vertex_positions:";

Vec3d unit(int axis) {
  Vec3d v;
  v[axis] = 1;
  return v;
}

double scene_size(const Scene& scene) {
  Bounds bounds;
  for (const Shape& shape : scene.shapes) {
    const Bounds b = bounds_of(shape.mesh);
    bounds.extend(b.lower);
    bounds.extend(b.upper);
  }
  return scene.shapes.empty() ? 1 : bounds.diagonal();
}

void add_shape_targets(Shape& shape, std::vector<Target>& targets) {
  const double step = 0.01 * bounds_of(shape.mesh).diagonal();
  for (int axis = 0; axis < 3; ++axis) {
    const std::string end(1, "xyz"[axis]);
    targets.push_back({{shape.id + ".translate." + end, "scene units", step},
                       Motion::kTranslate,
                       &shape,
                       axis,
                       "",
                       {}});
    targets.push_back(
        {{shape.id + ".rotate." + end, "radians", 0.01}, Motion::kRotate, &shape, axis, "", {}});
  }
  targets.push_back({{shape.id + ".scale", "factor", 0.01}, Motion::kScale, &shape, 0, "", {}});
  targets.push_back(
      {{shape.id + "." + kVertexPositions + "FILE", "times the vectors in FILE", 0.01},
       Motion::kVertices,
       &shape,
       0,
       "FILE",
       {}});
}

void add_sensor_targets(const Scene& scene, std::vector<Target>& targets) {
  for (int axis = 0; axis < 3; ++axis) {
    const std::string end(1, "xyz"[axis]);
    targets.push_back({{"sensor.translate." + end, "scene units", 0.01 * scene_size(scene)},
                       Motion::kCameraMove,
                       nullptr,
                       axis,
                       "",
                       {}});
    targets.push_back(
        {{"sensor.rotate." + end, "radians", 0.01}, Motion::kCameraTurn, nullptr, axis, "", {}});
  }
  targets.push_back({{"sensor.fov", "degrees", 0.01 * scene.camera.fov.v},
                     Motion::kFieldOfView,
                     nullptr,
                     0,
                     "",
                     {}});
}

// Values of an object with an id: a hundredth of the largest, or 0.01 where all are 0.
// size: of the scene.
void add_value_targets(const std::string& id, const std::vector<ParameterRef>& parameters,
                       std::vector<Target>& targets, double size = 0) {
  for (const ParameterRef& p : parameters) {
    double largest = 0;
    for (const Dual* v : p.values) largest = std::max(largest, std::fabs(v->v));
    ParameterInfo info{id + "." + p.name, "", 0.01 * (largest > 0 ? largest : 1)};
    if (p.unit == ParameterRef::Unit::kLength) info = {info.name, "scene units", 0.01 * size};
    if (p.unit == ParameterRef::Unit::kRadians) info = {info.name, "radians", 0.01};
    targets.push_back({info,
                       Motion::kValues,
                       nullptr,
                       0,
                       "",
                       p.values});
  }
}

std::vector<Target> all_targets(Scene& scene) {
  std::vector<Target> targets;
  for (Shape& shape : scene.shapes) {
    if (!shape.id.empty()) add_shape_targets(shape, targets);
  }
  add_sensor_targets(scene, targets);
  for (auto& [id, bsdf] : scene.bsdfs_by_id) add_value_targets(id, bsdf->parameters(), targets);
  for (Shape& shape : scene.shapes) {
    Rgb<Dual>& c = shape.radiance;
    if (shape.emitter_id.empty()) continue;
    add_value_targets(shape.emitter_id, {{"radiance", {&c.r, &c.g, &c.b}}}, targets);
  }
  if (scene.environment && !scene.environment_id.empty()) {
    add_value_targets(scene.environment_id, scene.environment->parameters(), targets);
  }
  for (const auto& light : scene.delta_lights) {
    if (light->id.empty()) continue;
    add_value_targets(light->id, light->parameters(), targets, scene_size(scene));
  }
  return targets;
}

// Levenshtein's distance: the fewest insertions, deletions and replacements of a character.
size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (size_t i = 0; i < a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i + 1;
    for (size_t j = 0; j < b.size(); ++j) {
      const size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

[[noreturn]] void fail_unknown(const Scene& scene, const std::string& name,
                               const std::vector<Target>& targets) {
  std::vector<std::string> names;
  for (const Target& t : targets) names.push_back(t.info.name);
  std::stable_sort(names.begin(), names.end(), [&](const std::string& a, const std::string& b) {
    return edit_distance(name, a) < edit_distance(name, b);
  });
  names.resize(std::min<size_t>(names.size(), 5));
  std::string message = "unknown parameter \"" + name + "\" (nearest: " + join(names) + ")";
  const auto nameless = [](const Shape& s) { return s.id.empty(); };
  const auto count = std::count_if(scene.shapes.begin(), scene.shapes.end(), nameless);
  if (count > 0) {
    message += "; " + std::to_string(count) + " of " + std::to_string(scene.shapes.size()) +
               " shapes have no id and cannot be named";
  }
  throw InputError({scene.file}, message);
}

Target resolve(Scene& scene, const std::string& name) {
  const std::vector<Target> targets = all_targets(scene);
  for (const Target& t : targets) {
    if (t.motion != Motion::kVertices) {
      if (t.info.name == name) return t;
      continue;
    }
    const std::string prefix = t.shape->id + "." + kVertexPositions;
    if (!name.starts_with(prefix) || name.size() == prefix.size()) continue;
    Target with_file = t;
    with_file.info.name = name;
    with_file.file = name.substr(prefix.size());
    return with_file;
  }
  fail_unknown(scene, name, targets);
}

// One vector per vertex of the mesh. Copies of a vertex must not come apart: the mesh would tear.
std::vector<Vec3d> read_velocities(const Target& target) {
  const Mesh& mesh = target.shape->mesh;
  std::vector<Vec3d> v = read_vertex_vectors(target.file);
  if (v.size() != mesh.positions.size()) {
    throw InputError({target.file}, "the file has " + std::to_string(v.size()) +
                                        " vectors, but the mesh of \"" + target.shape->id +
                                        "\" has " + std::to_string(mesh.positions.size()) +
                                        " vertices");
  }
  for (size_t i = 0; i < v.size(); ++i) {
    if (v[i] == v[mesh.weld[i]]) continue;
    throw InputError({target.file}, "vertices " + std::to_string(mesh.weld[i]) + " and " +
                                        std::to_string(i) + " (counted from 0) of \"" +
                                        target.shape->id +
                                        "\" are at the same position but move apart");
  }
  return v;
}

// Derivative of every vertex of the target's mesh.
std::vector<Vec3d> vertex_velocities(const Target& target) {
  const Mesh& mesh = target.shape->mesh;
  if (target.motion == Motion::kVertices) return read_velocities(target);
  const Vec3d center = bounds_of(mesh).center();
  const Vec3d axis = unit(target.axis);
  std::vector<Vec3d> velocities;
  velocities.reserve(mesh.positions.size());
  for (const Vec3f& position : mesh.positions) {
    const Vec3d arm = cast<double>(position) - center;
    velocities.push_back(target.motion == Motion::kTranslate ? axis
                         : target.motion == Motion::kRotate  ? cross(axis, arm)
                                                             : arm);
  }
  return velocities;
}

void add_to_lane(std::vector<Vec3<Lanes>>& tangents, int lane,
                 const std::vector<Vec3d>& velocities) {
  tangents.resize(velocities.size());
  for (size_t i = 0; i < velocities.size(); ++i) {
    for (int k = 0; k < 3; ++k) tangents[i][k][lane] += velocities[i][k];
  }
}

void seed_mesh(const Target& target, int lane) {
  Mesh& mesh = target.shape->mesh;
  add_to_lane(mesh.position_tangents, lane, vertex_velocities(target));
  if (mesh.normal_source == NormalSource::kGiven && target.motion == Motion::kRotate) {
    std::vector<Vec3d> turns;
    for (const Vec3d& n : mesh.normals) turns.push_back(cross(unit(target.axis), n));
    add_to_lane(mesh.normal_tangents, lane, turns);
  }
  update_shading_normals(mesh);
}

void seed_vector(Vec3<Dual>& v, int lane, const Vec3d& velocity) {
  for (int k = 0; k < 3; ++k) v[k].d[lane] += velocity[k];
}

// v turned by `angle` about a unit coordinate axis.
Vec3d turned(const Vec3d& v, int axis, double angle) {
  const int i = (axis + 1) % 3, j = (axis + 2) % 3;
  const double c = std::cos(angle), s = std::sin(angle);
  Vec3d r = v;
  r[i] = c * v[i] - s * v[j];
  r[j] = s * v[i] + c * v[j];
  return r;
}

void move_mesh(const Target& target, double step) {
  Mesh& mesh = target.shape->mesh;
  const Vec3d center = bounds_of(mesh).center();
  const bool rotates = target.motion == Motion::kRotate;
  std::vector<Vec3d> velocities;
  if (!rotates) velocities = vertex_velocities(target);
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3d p = cast<double>(mesh.positions[i]);
    mesh.positions[i] = cast<float>(rotates ? center + turned(p - center, target.axis, step)
                                            : p + velocities[i] * step);
  }
  if (rotates && mesh.normal_source == NormalSource::kGiven) {
    for (Vec3d& n : mesh.normals) n = turned(n, target.axis, step);
  }
  update_shading_normals(mesh);
}

void move_vector(Vec3<Dual>& v, const Vec3d& to) {
  for (int k = 0; k < 3; ++k) v[k].v = to[k];
}

}  // namespace

std::vector<ParameterInfo> list_parameters(const Scene& scene) {
  Scene copy = deep_copy(scene);  // targets point to numbers that may be changed
  std::vector<ParameterInfo> list;
  for (const Target& t : all_targets(copy)) list.push_back(t.info);
  return list;
}

ParameterInfo find_parameter(const Scene& scene, const std::string& name) {
  Scene copy = deep_copy(scene);
  const Target target = resolve(copy, name);
  ParameterInfo info = target.info;
  if (target.motion != Motion::kVertices) return info;
  double longest = 0;
  for (const Vec3d& v : read_velocities(target)) longest = std::max(longest, length(v));
  const double diagonal = bounds_of(target.shape->mesh).diagonal();
  info.natural_step = longest > 0 ? 0.01 * diagonal / longest : 0.01;
  return info;
}

void seed_parameter(Scene& scene, const std::string& name, int lane) {
  const Target target = resolve(scene, name);
  const Vec3d axis = unit(target.axis);
  Camera& camera = scene.camera;
  switch (target.motion) {
    case Motion::kTranslate:
    case Motion::kRotate:
    case Motion::kScale:
    case Motion::kVertices:
      seed_mesh(target, lane);
      break;
    case Motion::kCameraMove:
      seed_vector(camera.origin, lane, axis);
      break;
    case Motion::kCameraTurn:
      for (Vec3<Dual>* v : {&camera.left, &camera.up, &camera.forward}) {
        seed_vector(*v, lane, cross(axis, value(*v)));
      }
      break;
    case Motion::kFieldOfView:
      camera.fov.d[lane] += 1;
      break;
    case Motion::kValues:
      for (Dual* v : target.values) v->d[lane] += 1;
      break;
  }
}

Scene perturbed(const Scene& scene, const std::string& name, double step) {
  Scene copy = deep_copy(scene);
  const Target target = resolve(copy, name);
  Camera& camera = copy.camera;
  switch (target.motion) {
    case Motion::kTranslate:
    case Motion::kRotate:
    case Motion::kScale:
    case Motion::kVertices:
      move_mesh(target, step);
      break;
    case Motion::kCameraMove:
      camera.origin[target.axis].v += step;
      break;
    case Motion::kCameraTurn:
      for (Vec3<Dual>* v : {&camera.left, &camera.up, &camera.forward}) {
        move_vector(*v, turned(value(*v), target.axis, step));
      }
      break;
    case Motion::kFieldOfView:
      camera.fov.v += step;
      break;
    case Motion::kValues:
      for (Dual* v : target.values) v->v += step;
      break;
  }
  return copy;
}

}  // namespace limn
