// Places of shapes, lights and cameras as matrices.
#include "tools/python/to_world.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "limn/core/bounds.h"
#include "limn/core/camera_pose.h"
#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/light.h"
#include "limn/core/parameter.h"

namespace limn::python {

namespace {

constexpr std::string_view kEnding = ".to_world";
constexpr double kRounding = 1e-6;  // of what counts as a rotation, not tuned

// What a name stands for: one of these.
struct Object {
  bool camera = false, environment = false;
  std::optional<size_t> shape = {}, light = {};
};

std::optional<Object> find_object(const Scene& scene, const std::string& name) {
  if (!name.ends_with(kEnding)) return std::nullopt;
  const std::string id = name.substr(0, name.size() - kEnding.size());
  for (size_t i = 0; i < scene.shapes.size(); ++i) {
    const Shape& shape = scene.shapes[i];
    if (shape.id == id || (shape.is_emitter && shape.emitter_id == id)) return Object{.shape = i};
  }
  for (size_t i = 0; i < scene.delta_lights.size(); ++i) {
    if (scene.delta_lights[i]->id == id) return Object{.light = i};
  }
  if (scene.environment && scene.environment_id == id && scene.environment->grid()) {
    return Object{.environment = true};
  }
  const bool selected =
      scene.sensor < scene.sensors.size() && !id.empty() && scene.sensors[scene.sensor].id == id;
  if (selected || id == "sensor") return Object{.camera = true};
  return std::nullopt;
}

Matrix4 translation(const Vec3d& by) {
  Matrix4 m;
  for (int k = 0; k < 3; ++k) m.m[k][3] = by[k];
  return m;
}

Matrix4 of_columns(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  Matrix4 m;
  for (int k = 0; k < 3; ++k) {
    m.m[k][0] = a[k];
    m.m[k][1] = b[k];
    m.m[k][2] = c[k];
  }
  return m;
}

Vec3d column(const Matrix4& a, int k) { return {a.m[0][k], a.m[1][k], a.m[2][k]}; }
double determinant_of(const Matrix4& a) {
  return dot(column(a, 0), cross(column(a, 1), column(a, 2)));
}

bool is_rotation(const Matrix4& a) {
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      if (std::fabs(dot(column(a, i), column(a, k)) - (i == k)) > kRounding) return false;
    }
  }
  return determinant_of(a) > 0;
}

void add_product(Matrix4& sum, const Vec3d& a, const Vec3d& b) {
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) sum.m[i][k] += a[i] * b[k];
  }
}

Vec3d mean_of(const SharedVector<Vec3f>& points) {
  Vec3d sum;
  for (const Vec3f& p : points) sum += cast<double>(p);
  return sum / static_cast<double>(points.size());
}

// The normal of the plane that points lie in, of their second moments; none if they fill space or
// lie on a line. rounding: of the moments across it.
std::optional<Vec3d> plane_normal(const Matrix4& moments, double rounding) {
  const double size = moments.m[0][0] + moments.m[1][1] + moments.m[2][2];
  if (determinant_of(moments) > size * size * std::max(1e-12 * size, rounding)) return std::nullopt;
  Vec3d longest;
  for (int k = 0; k < 3; ++k) {
    const Vec3d n = cross(column(moments, k), column(moments, (k + 1) % 3));
    if (length(n) > length(longest)) longest = n;
  }
  if (!(length(longest) > 1e-12 * size * size)) return std::nullopt;
  return longest / length(longest);
}

// By least squares, what leads from points to points; nothing if no affine map does, up to the
// rounding of floats. Out of the plane of flat shapes it scales as within.
std::optional<Matrix4> affine_between(const SharedVector<Vec3f>& from,
                                      const SharedVector<Vec3f>& to) {
  if (from.size() != to.size() || from.empty()) return std::nullopt;
  if (from == to) return Matrix4{};
  const Vec3d start = mean_of(from), end = mean_of(to);
  Matrix4 moments{{}}, mixed{{}};
  moments.m[3][3] = 1;
  constexpr double kFloats = 3e-7;  // of coordinates, a few roundings; not tuned
  double rounding = 0;
  for (size_t i = 0; i < from.size(); ++i) {
    const Vec3d p = cast<double>(from[i]) - start, q = cast<double>(to[i]) - end;
    add_product(moments, p, p);
    add_product(mixed, q, p);
    rounding += kFloats * kFloats * length_squared(cast<double>(from[i]));
  }
  const std::optional<Vec3d> normal = plane_normal(moments, rounding);
  if (normal) {
    const double size = moments.m[0][0] + moments.m[1][1] + moments.m[2][2];
    add_product(moments, *normal * size, *normal);
  }
  Matrix4 linear;
  try {
    linear = mixed * moments.inverse();
  } catch (const std::domain_error&) {
    return std::nullopt;
  }
  if (normal) {
    const Vec3d other = std::fabs(normal->x) < 0.5 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
    const Vec3d u = cross(*normal, other) / length(cross(*normal, other)), v = cross(*normal, u);
    const Vec3d area = cross(linear.vector(u), linear.vector(v));
    add_product(linear, area / std::sqrt(length(area)), *normal);
  }
  linear.m[3][3] = 1;
  const Matrix4 map = translation(end) * linear * translation(-start);
  double largest = 0, widest = 0, worst = 0;
  for (size_t i = 0; i < from.size(); ++i) {
    const Vec3d q = cast<double>(to[i]);
    worst = std::max(worst, length(map.point(cast<double>(from[i])) - q));
    largest = std::max(largest, length(q));
    widest = std::max(widest, length(q - end));
  }
  const double most = 1e-5 * widest + kFloats * largest;
  if (!(worst <= most) || !(determinant_of(map) > 0)) return std::nullopt;
  return map;
}

Dual* number(const std::vector<ParameterRef>& list, const char* name, int axis) {
  for (const ParameterRef& p : list) {
    if (p.name == name + std::string{'.', "xyz"[axis]}) return p.values[0];
  }
  return nullptr;
}

// The three numbers NAME.x, NAME.y, NAME.z of a light; zeros if it has none.
Vec3d vector_of(DeltaLight& light, const char* name) {
  Vec3d v;
  const auto list = light.parameters();
  for (int k = 0; k < 3; ++k) {
    if (const Dual* x = number(list, name, k)) v[k] = x->v;
  }
  return v;
}

bool has_vector(DeltaLight& light, const char* name) {
  return number(light.parameters(), name, 0) != nullptr;
}

void set_vector(DeltaLight& light, const char* name, const Vec3d& v) {
  const auto list = light.parameters();
  for (int k = 0; k < 3; ++k) {
    if (Dual* x = number(list, name, k)) x->v = v[k];
  }
}

// By angles about the world axes, x first, and back.
Matrix4 rotation_by_angles(const Vec3d& angles) {
  Matrix4 all;
  for (int axis = 0; axis < 3; ++axis) {
    const int i = (axis + 1) % 3, j = (axis + 2) % 3;
    const double c = std::cos(angles[axis]), s = std::sin(angles[axis]);
    Matrix4 one;
    one.m[i][i] = one.m[j][j] = c;
    one.m[i][j] = -s;
    one.m[j][i] = s;
    all = one * all;
  }
  return all;
}

Vec3d angles_of(const Matrix4& r) {
  const double level = std::hypot(r.m[0][0], r.m[1][0]);
  const double y = std::atan2(-r.m[2][0], level);
  if (level < 1e-12) return {0, y, std::atan2(-r.m[0][1], r.m[1][1])};
  return {std::atan2(r.m[2][1], r.m[2][2]), y, std::atan2(r.m[1][0], r.m[0][0])};
}

Matrix4 light_to_world(DeltaLight& light, const Vec3d& first) {
  return translation(vector_of(light, "translate")) *
         rotation_by_angles(vector_of(light, "rotate")) * translation(-first);
}

// As the file gives it.
Matrix4 file_to_world(const Scene& scene, const History& history, const Object& object) {
  if (object.light) return scene.delta_lights[*object.light]->to_world;
  if (object.environment) return history.first->environment;
  return scene.shapes[*object.shape].to_world;
}

Matrix4 axes_of(const Environment& environment) {
  const Environment::Grid grid = *environment.grid();
  return of_columns(grid.quarter, grid.pole, -grid.zero);
}

Bounds bounds_of_faces(const Mesh& mesh, const SharedVector<Vec3f>& positions) {
  Bounds bounds;
  for (const FaceIndices& face : mesh.faces) {
    for (const uint32_t v : face) bounds.extend(cast<double>(positions[v]));
  }
  return bounds;
}

// Where a shape's transform begins.
FirstPlaces::ShapePlace start_of(const Shape& shape, const History& history, size_t i) {
  const FirstPlaces::ShapePlace& first = history.first->shapes[i];
  if (affine_between(first.positions, shape.mesh.positions)) return first;
  return {shape.mesh.positions, shape.mesh.normals};
}

struct Failure {
  const Scene& scene;
  const std::string& name;
  [[noreturn]] void operator()(const std::string& message) const {
    throw InputError({scene.file}, "\"" + name + "\" " + message);
  }
};

// moved: from where the file has it.
void place_shape(Scene& scene, History& history, size_t i, const Matrix4& moved,
                 const Failure& fail, std::vector<std::string>* warnings) {
  Shape& shape = scene.shapes[i];
  if (scene.exposure) {
    const Course& course = scene.exposure->shapes[i];
    if (!course.keyframes.empty() || course.moves()) {
      fail("moves while a shutter is open: its animation, velocity and spin say where it is");
    }
  }
  const FirstPlaces::ShapePlace start = start_of(shape, history, i);
  std::vector<double> positions;
  for (const Vec3f& p : start.positions) {
    const Vec3d q = moved.point(cast<double>(p));
    positions.insert(positions.end(), {q.x, q.y, q.z});
  }
  const Vec3d center = bounds_of_faces(shape.mesh, start.positions).center();
  find_parameter_or_array(scene, shape.id + ".vertex_positions").assign(scene, positions, warnings);
  Mesh& mesh = shape.mesh;
  if (mesh.normal_source == NormalSource::kGiven && start.normals.size() == mesh.normals.size()) {
    for (size_t k = 0; k < start.normals.size(); ++k) {
      const Vec3d n = moved.normal(start.normals[k]);
      mesh.normals[k] = n / length(n);
    }
    update_shading_normals(mesh);
  }
  const Vec3d now = moved.point(center);
  shape.pivot = Pivot{now, std::cbrt(determinant_of(moved))};
  if (scene.exposure) {
    Course& course = own_exposure(scene).shapes[i];
    course.translate(now - course.center);
  }
  for (int k = 0; k < 3; ++k) {
    history.moved[shape.id + ".translate." + "xyz"[k]] = (now - center)[k];
  }
  auto first = std::make_shared<FirstPlaces>(*history.first);
  first->shapes[i] = start;
  history.first = first;
}

// The axes of a transform without their lengths, z first, and its place.
Matrix4 rigid(const Matrix4& a) {
  const Vec3d z = normalize(column(a, 2));
  const Vec3d x = normalize(column(a, 0) - z * dot(z, column(a, 0)));
  return translation(column(a, 3)) * of_columns(x, cross(z, x), z);
}

// As files have it: spots and projectors may be scaled evenly.
void check_even(const Matrix4& a, const Failure& fail) {
  const double size2 = length_squared(column(a, 0));
  for (int k = 0; k < 3; ++k) {
    const double across = dot(column(a, k), column(a, (k + 1) % 3));
    if (std::fabs(across) > 1e-4 * size2 ||
        std::fabs(length_squared(column(a, k)) - size2) > 1e-4 * size2) {
      fail("can be moved and rotated, not sheared or scaled unevenly");
    }
  }
}

void place_light(DeltaLight& light, const Matrix4& to_world, const Failure& fail) {
  const Vec3d position = column(to_world, 3);
  for (int k = 0; k < 3; ++k) {
    if (std::fabs(position[k]) > kLargestCoordinate) fail("would be too far away");
  }
  if (has_vector(light, "rotate")) {
    if (has_vector(light, "translate")) check_even(to_world, fail);
    set_vector(light, "rotate", angles_of(rigid(to_world) * rigid(light.to_world).inverse()));
  }
  set_vector(light, "translate", position);
}

void place_environment(Scene& scene, const History& history, const Matrix4& moved,
                       const Failure& fail) {
  if (determinant_of(history.first->environment) < 0)
    fail("is mirrored in the file: turn it there");
  if (!is_rotation(moved)) fail("can be rotated, not scaled or mirrored");
  const Matrix4 axes = moved * history.first->environment;
  if (length(column(axes, 1) - Vec3d{0, 1, 0}) > kRounding) {
    fail("turns about the y axis alone: write other rotations into the file");
  }
  const double degrees = std::atan2(-axes.m[2][0], axes.m[0][0]) * (180 / M_PI);
  Environment& environment = *scene.environment;
  const double scale = environment.parameters().at(0).values[0]->v;
  scene.environment = make_map_environment(environment.texels(), scale, degrees, "turned");
}

}  // namespace

History::History(const Scene& scene) {
  FirstPlaces places;
  for (const Shape& shape : scene.shapes) {
    places.shapes.push_back({shape.mesh.positions, shape.mesh.normals});
  }
  for (const auto& light : scene.delta_lights) {
    places.lights.push_back(vector_of(*light, "translate"));
  }
  if (scene.environment && scene.environment->grid()) {
    places.environment = axes_of(*scene.environment);
  }
  first = std::make_shared<const FirstPlaces>(std::move(places));
}

void History::forget(const Scene& scene, size_t shape) {
  auto places = std::make_shared<FirstPlaces>(*first);
  places->shapes[shape] = {scene.shapes[shape].mesh.positions, scene.shapes[shape].mesh.normals};
  first = places;
  placed.erase(shape);
}

bool names_place(const Scene& scene, const std::string& name) {
  return find_object(scene, name).has_value();
}

Matrix4 to_world(const Scene& scene, const History& history, const std::string& name) {
  const Object object = find_object(scene, name).value();
  if (object.camera) return camera_to_world(scene);
  const Matrix4 file = file_to_world(scene, history, object);
  if (object.light) {
    return light_to_world(*scene.delta_lights[*object.light],
                          history.first->lights[*object.light]) *
           file;
  }
  if (object.environment) return axes_of(*scene.environment);
  const SharedVector<Vec3f>& positions = scene.shapes[*object.shape].mesh.positions;
  const auto placed = history.placed.find(*object.shape);
  if (placed != history.placed.end() && placed->second.positions == positions) {
    return placed->second.to_world;
  }
  const auto map = affine_between(history.first->shapes[*object.shape].positions, positions);
  return map.value_or(Matrix4{}) * file;
}

void place(Scene& scene, History& history, const std::string& name, const Matrix4& to_world,
           std::vector<std::string>* warnings) {
  const Object object = find_object(scene, name).value();
  const Failure fail{scene, name};
  for (const auto& row : to_world.m) {
    for (const double x : row) {
      if (!std::isfinite(x)) fail("is a matrix of finite numbers");
    }
  }
  if (object.camera) {
    scene.camera = place_camera(scene, to_world);
    return;
  }
  const auto& last = to_world.m[3];
  if (last[0] != 0 || last[1] != 0 || last[2] != 0 || last[3] != 1) {
    fail("has the last row 0, 0, 0, 1");
  }
  // From where the file has it.
  const Matrix4 file = file_to_world(scene, history, object);
  if (object.light) {
    if (!(determinant_of(to_world) * determinant_of(file) > 0)) fail("must not mirror or flatten");
    place_light(*scene.delta_lights[*object.light], to_world, fail);
    return;
  }
  const Matrix4 moved = to_world * file.inverse();
  if (!(determinant_of(moved) > 0)) fail("must not mirror or flatten");
  if (object.environment) {
    place_environment(scene, history, moved, fail);
  } else {
    place_shape(scene, history, *object.shape, moved, fail, warnings);
    history.placed[*object.shape] = {to_world,
                                     std::as_const(scene).shapes[*object.shape].mesh.positions};
  }
}

}  // namespace limn::python
