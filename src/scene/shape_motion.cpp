// Motions of a shape's vertices: rigid, scaling, along a field, single vertices.
#include <algorithm>
#include <utility>

#include "limn/core/check.h"
#include "limn/core/exposure.h"
#include "limn/core/mesh.h"
#include "src/base/text.h"
#include "src/mesh/mesh_build.h"
#include "src/scene/motion.h"

namespace limn {

namespace {

// A fit must not shrink a shape to a point, from which no step would recover.
constexpr double kLeastScale = 0.01;  // not tuned

void add_to_lane(Tangents& tangents, int lane, const std::vector<Vec3d>& velocities) {
  Tangents sums;
  sums.reserve(velocities.size());
  for (size_t i = 0; i < velocities.size(); ++i) {
    Vec3<Lanes> sum = i < tangents.size() ? tangents[i] : Vec3<Lanes>{};
    for (int k = 0; k < 3; ++k) sum[k][lane] += velocities[i][k];
    sums.push_back(sum);
  }
  tangents = std::move(sums);
}

// Linear motion that leaves normals from the file unchanged; subclasses override.
class ShapeMotion : public Motion {
 public:
  explicit ShapeMotion(ShapeId shape) : shape_(shape) {}

  Moved moved() const final { return {.vertices = true}; }
  void seed(Scene& scene, int lane, size_t component) const final {
    Mesh& mesh = scene.shapes[shape_.index()].mesh;
    add_to_lane(mesh.position_tangents, lane, vertex_velocities(scene.shape(shape_), component));
    if (mesh.normal_source == NormalSource::kGiven) seed_given_normals(mesh, lane);
    update_shading_tangents(mesh);
    const Vec3d shift = shift_per_unit();
    if (Course* course = course_of(scene, shift)) {
      for (int k = 0; k < 3; ++k) course->shift[k][lane] += shift[k];
    }
  }
  void move(Scene& scene, double step, size_t component) const final {
    Shape& shape = scene.shapes[shape_.index()];
    move_vertices(shape, step, component);
    update_shading_normals(shape.mesh);
    const Vec3d shift = shift_per_unit();
    if (Course* course = course_of(scene, shift)) course->translate(shift * step);
  }
  std::vector<Vec3d> velocities(const Scene& scene, ShapeId shape, size_t component) const final {
    if (shape != shape_) return {};
    return vertex_velocities(scene.shape(shape_), component);
  }

 protected:
  virtual Vec3d shift_per_unit() const { return {}; }
  virtual std::vector<Vec3d> vertex_velocities(const Shape& shape, size_t component) const = 0;
  virtual void seed_given_normals(Mesh&, int /*lane*/) const {}
  virtual void move_vertices(Shape& shape, double step, size_t component) const {
    const std::vector<Vec3d> velocities = vertex_velocities(shape, component);
    SharedVector<Vec3f>& positions = shape.mesh.positions;
    for (size_t i = 0; i < positions.size(); ++i) {
      positions[i] = cast<float>(cast<double>(positions[i]) + velocities[i] * step);
    }
  }

 private:
  // That a shift moves as a whole; what else moves a shape is carried along.
  Course* course_of(Scene& scene, const Vec3d& shift) const {
    if (!scene.exposure || shift == Vec3d{}) return nullptr;
    return &own_exposure(scene).shapes[shape_.index()];
  }

  ShapeId shape_;
};

class ShapeTranslation final : public ShapeMotion {
 public:
  ShapeTranslation(ShapeId shape, int axis, const Pivot& start)
      : ShapeMotion(shape), axis_(axis), start_(start) {}

 protected:
  std::vector<Vec3d> vertex_velocities(const Shape& shape, size_t) const override {
    return std::vector<Vec3d>(shape.mesh.positions.size(), unit_vector(axis_));
  }
  Vec3d shift_per_unit() const override { return unit_vector(axis_); }
  void move_vertices(Shape& shape, double step, size_t component) const override {
    ShapeMotion::move_vertices(shape, step, component);
    shape.pivot = shape.pivot.value_or(start_);
    shape.pivot->center += shift_per_unit() * step;
  }

 private:
  int axis_;
  Pivot start_;  // of shapes that have none yet
};

// Rotation about the shape's pivot: the center of a shape's bounds would change as it rotates.
class ShapeRotation final : public ShapeMotion {
 public:
  ShapeRotation(ShapeId shape, int axis, const Pivot& start)
      : ShapeMotion(shape), axis_(axis), start_(start) {}

 protected:
  std::vector<Vec3d> vertex_velocities(const Shape& shape, size_t) const override {
    const Vec3d center = shape.pivot.value_or(start_).center;
    std::vector<Vec3d> velocities;
    velocities.reserve(shape.mesh.positions.size());
    for (const Vec3f& p : shape.mesh.positions) {
      velocities.push_back(cross(unit_vector(axis_), cast<double>(p) - center));
    }
    return velocities;
  }
  void seed_given_normals(Mesh& mesh, int lane) const override {
    std::vector<Vec3d> turns;
    for (const Vec3d& n : std::as_const(mesh).normals)
      turns.push_back(cross(unit_vector(axis_), n));
    add_to_lane(mesh.normal_tangents, lane, turns);
  }
  void move_vertices(Shape& shape, double step, size_t) const override {
    shape.pivot = shape.pivot.value_or(start_);
    const Vec3d center = shape.pivot->center;
    for (Vec3f& p : shape.mesh.positions) {
      p = cast<float>(center + turned(cast<double>(p) - center, axis_, step));
    }
    if (shape.mesh.normal_source != NormalSource::kGiven) return;
    for (Vec3d& n : shape.mesh.normals) n = turned(n, axis_, step);
  }

 private:
  int axis_;
  Pivot start_;
};

// Scaling about the same pivot, in units of the initial size.
class ShapeScaling final : public ShapeMotion {
 public:
  ShapeScaling(ShapeId shape, const Pivot& start) : ShapeMotion(shape), start_(start) {}

 protected:
  std::vector<Vec3d> vertex_velocities(const Shape& shape, size_t) const override {
    const Pivot pivot = shape.pivot.value_or(start_);
    std::vector<Vec3d> velocities;
    velocities.reserve(shape.mesh.positions.size());
    for (const Vec3f& p : shape.mesh.positions) {
      velocities.push_back((cast<double>(p) - pivot.center) / pivot.size);
    }
    return velocities;
  }
  void move_vertices(Shape& shape, double step, size_t component) const override {
    ShapeMotion::move_vertices(shape, step, component);
    shape.pivot = shape.pivot.value_or(start_);
    shape.pivot->size += step;
  }

 private:
  Pivot start_;
};

class VertexField final : public ShapeMotion {
 public:
  VertexField(ShapeId shape, std::vector<Vec3d> field)
      : ShapeMotion(shape), field_(std::move(field)) {}

 protected:
  std::vector<Vec3d> vertex_velocities(const Shape& shape, size_t) const override {
    CHECK_EQ(shape.mesh.positions.size(), field_.size());
    return field_;
  }

 private:
  std::vector<Vec3d> field_;  // V
};

// Copies of a vertex must not separate and tear the mesh.
void check_copies(const std::string& file, const Shape& shape, const std::vector<Vec3d>& field) {
  for (size_t i = 0; i < field.size(); ++i) {
    const uint32_t first = shape.mesh.weld[i];
    if (field[i] == field[first]) continue;
    throw InputError({file}, "vertices " + std::to_string(first) + " and " + std::to_string(i) +
                                 " (counted from 0) of \"" + shape.id +
                                 "\" are at the same position but move apart");
  }
}

// Reads one vector per vertex.
std::vector<Vec3d> read_field(const Shape& shape, const std::string& file) {
  const Mesh& mesh = shape.mesh;
  std::vector<Vec3d> v = read_vertex_vectors(file);
  if (v.size() != mesh.positions.size()) {
    throw InputError({file}, "the file has " + std::to_string(v.size()) +
                                 " vectors, but the mesh of \"" + shape.id + "\" has " +
                                 std::to_string(mesh.positions.size()) + " vertices");
  }
  check_copies(file, shape, v);
  return v;
}

void check_vertex(const Scene& scene, const std::string& name, int64_t vertex, size_t count) {
  if (vertex >= 0 && vertex < static_cast<int64_t>(count)) return;
  throw InputError({scene.file}, "parameter \"" + name + "\": the mesh has vertices 0 to " +
                                     std::to_string(count - 1));
}

// All vertex coordinates. A component moves its vertex with all copies; the derivative along a
// field is the sum over first copies (weld[i] == i).
class VertexArray final : public ShapeMotion {
 public:
  explicit VertexArray(ShapeId shape) : ShapeMotion(shape), shape_(shape) {}

  std::optional<Parameter> part(const Scene& scene, const Parameter& whole,
                                const std::string& rest) const override {
    if (rest.size() < 2) return std::nullopt;
    if (rest[0] == ':') return field(scene, whole, rest.substr(1));
    if (rest[0] == '.') return component(scene, whole, rest.substr(1));
    return std::nullopt;
  }
  std::vector<double> numbers(const Scene& scene) const override {
    std::vector<double> all;
    for (const Vec3f& p : scene.shape(shape_).mesh.positions) {
      for (int k = 0; k < 3; ++k) all.push_back(static_cast<double>(p[k]));
    }
    return all;
  }
  void assign(Scene& scene, const std::string& name, const std::vector<double>& value,
              std::vector<std::string>* warnings) const override {
    Shape& shape = scene.shapes[shape_.index()];
    check_numbers(scene, name, value, 3 * shape.mesh.positions.size(), -kLargestCoordinate,
                  kLargestCoordinate);
    std::vector<Vec3f> positions;
    for (size_t i = 0; i < value.size(); i += 3) {
      positions.push_back(cast<float>(Vec3d{value[i], value[i + 1], value[i + 2]}));
    }
    shape.mesh = moved_mesh(shape.mesh, std::move(positions), shape.where, warnings);
    shape.pivot.reset();
  }
  std::optional<Parameter> along(const Scene& scene, const Parameter&,
                                 const std::vector<double>& direction) const override {
    std::vector<Vec3d> field;
    for (size_t i = 0; i < direction.size(); i += 3) {
      field.push_back({direction[i], direction[i + 1], direction[i + 2]});
    }
    check_copies(scene.file, scene.shape(shape_), field);
    return vertex_field(scene, shape_, std::move(field));
  }
  std::string parts(const std::string& name) const override {
    return "\"" + name + ":FILE\" for a field of vectors, \"" + name + ".0.x\" for one number";
  }

 protected:
  std::vector<Vec3d> vertex_velocities(const Shape& shape, size_t component) const override {
    const Mesh& mesh = shape.mesh;
    std::vector<Vec3d> velocities(mesh.positions.size());
    const uint32_t root = mesh.weld[component / 3];
    for (size_t i = root; i < velocities.size(); ++i) {
      if (mesh.weld[i] == root) velocities[i] = unit_vector(static_cast<int>(component % 3));
    }
    return velocities;
  }

 private:
  Parameter field(const Scene& scene, const Parameter& whole, const std::string& file) const {
    Parameter field = vertex_field(scene, shape_, read_field(scene.shape(shape_), file));
    field.name = whole.name + ":" + file;
    field.unit = "times the vectors in FILE";
    return field;
  }

  static std::optional<Parameter> component(const Scene& scene, const Parameter& whole,
                                            const std::string& text) {
    const std::vector<std::string_view> words = split(text, ".");
    if (words.size() != 2 || words[1].size() != 1) return std::nullopt;
    const std::optional<int64_t> vertex = parse_integer(words[0]);
    const size_t axis = std::string_view("xyz").find(words[1][0]);
    if (!vertex || axis > 2) return std::nullopt;
    check_vertex(scene, whole.name + "." + text, *vertex, whole.size / 3);
    const size_t component = static_cast<size_t>(*vertex) * 3 + axis;
    return Parameter{whole.name + "." + text, whole.unit, whole.natural_step, 1,
                     one_component(whole.motion, component)};
  }

  ShapeId shape_;
};

// Displacement of all vertices along their normals. A component moves its vertex with all copies.
class VertexDisplacement final : public ShapeMotion {
 public:
  // held: V fixed normals; if empty, those of the current mesh.
  explicit VertexDisplacement(ShapeId shape, std::vector<Vec3d> held = {})
      : ShapeMotion(shape), shape_(shape), held_(std::move(held)) {}

  std::shared_ptr<const Motion> held(const Scene& scene) const override {
    return std::make_shared<VertexDisplacement>(shape_, of(scene.shape(shape_).mesh));
  }
  std::vector<Vec3d> directions(const Scene& scene) const override {
    return of(scene.shape(shape_).mesh);
  }
  std::optional<Parameter> part(const Scene& scene, const Parameter& whole,
                                const std::string& rest) const override {
    if (rest.size() < 2 || rest[0] != '.') return std::nullopt;
    const std::optional<int64_t> vertex = parse_integer(rest.substr(1));
    if (!vertex) return std::nullopt;
    check_vertex(scene, whole.name + rest, *vertex, whole.size);
    return Parameter{whole.name + rest, whole.unit, whole.natural_step, 1,
                     one_component(held(scene), static_cast<size_t>(*vertex))};
  }
  std::optional<Parameter> along(const Scene& scene, const Parameter&,
                                 const std::vector<double>& direction) const override {
    std::vector<Vec3d> field = directions(scene);
    for (size_t i = 0; i < field.size(); ++i) field[i] = field[i] * direction[i];
    check_copies(scene.file, scene.shape(shape_), field);
    return vertex_field(scene, shape_, std::move(field));
  }
  std::string parts(const std::string& name) const override {
    return "\"" + name + ".0\" for one number";
  }

 protected:
  std::vector<Vec3d> vertex_velocities(const Shape& shape, size_t component) const override {
    const Mesh& mesh = shape.mesh;
    std::vector<Vec3d> velocities = of(mesh);
    for (size_t i = 0; i < velocities.size(); ++i) {
      if (mesh.weld[i] != mesh.weld[component]) velocities[i] = {};
    }
    return velocities;
  }

 private:
  std::vector<Vec3d> of(const Mesh& mesh) const {
    return held_.empty() ? displacement_directions(mesh) : held_;
  }

  ShapeId shape_;
  std::vector<Vec3d> held_;
};

}  // namespace

Parameter vertex_field(const Scene& scene, ShapeId shape, std::vector<Vec3d> field) {
  double longest = 0;
  for (const Vec3d& v : field) longest = std::max(longest, length(v));
  const double diagonal = bounds_of(scene.shape(shape).mesh).diagonal();
  return {scene.shape(shape).id + ".vertex_positions:", "times the vectors of the field",
          longest > 0 ? 0.01 * diagonal / longest : 0.01, 1,
          std::make_shared<VertexField>(shape, std::move(field))};
}

void add_shape_parameters(const Scene& scene, std::vector<Parameter>& list) {
  for (uint32_t i = 0; i < scene.shapes.size(); ++i) {
    const ShapeId id(i);
    const Shape& shape = scene.shape(id);
    if (shape.id.empty()) continue;
    const Bounds bounds = bounds_of(shape.mesh);
    const double step = 0.01 * bounds.diagonal();
    const Pivot pivot = shape.pivot.value_or(Pivot{bounds.center()});
    for (int axis = 0; axis < 3; ++axis) {
      const std::string end(1, "xyz"[axis]);
      list.push_back({shape.id + ".translate." + end, "scene units", step, 1,
                      std::make_shared<ShapeTranslation>(id, axis, pivot)});
      list.push_back({shape.id + ".rotate." + end, "radians", 0.01, 1,
                      std::make_shared<ShapeRotation>(id, axis, pivot)});
    }
    list.push_back({shape.id + ".scale", "factor", 0.01 * pivot.size, 1,
                    std::make_shared<ShapeScaling>(id, pivot)});
    list.back().least = kLeastScale - pivot.size;
    list.push_back({shape.id + ".vertex_positions", "scene units", step,
                    3 * shape.mesh.positions.size(), std::make_shared<VertexArray>(id)});
    list.back().array = {shape.mesh.positions.size(), 3};
    list.push_back({shape.id + ".displacement", "scene units", step, shape.mesh.positions.size(),
                    std::make_shared<VertexDisplacement>(id)});
    list.back().array = {shape.mesh.positions.size()};
    list.back().repeats = true;
  }
}

}  // namespace limn
