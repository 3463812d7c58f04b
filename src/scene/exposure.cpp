// Courses of shapes and cameras, and scenes at a time.
#include "limn/core/exposure.h"

#include <algorithm>

#include "limn/core/error.h"
#include "limn/core/face_overlaps.h"
#include "src/scene/rotation.h"

namespace limn {
namespace {

// By keyframes: the pose at a time, and its rates.
struct KeyPose {
  Vec3d place;
  Matrix4 rotation;
  double scale = 1;
  Vec3d velocity, spin;
  double growth = 0;
};

KeyPose key_pose(const std::vector<Keyframe>& keys, double time) {
  if (keys.empty()) return {};
  const auto after =
      std::find_if(keys.begin(), keys.end(), [&](const Keyframe& key) { return key.time > time; });
  if (after == keys.begin() || after == keys.end()) {
    const Keyframe& end = after == keys.end() ? keys.back() : keys.front();
    return {end.place, end.rotation, end.scale, {}, {}, 0};
  }
  const Keyframe &a = after[-1], &b = *after;
  const double span = b.time - a.time, s = (time - a.time) / span;
  const double scale = a.scale + s * (b.scale - a.scale);
  return {a.place + (b.place - a.place) * s,
          rotation_by(a.turn * s) * a.rotation,
          scale,
          (b.place - a.place) / span,
          a.turn / span,
          (b.scale - a.scale) / span / scale};
}

// A point x of the reference time is at center + linear (x - start).
struct Placing {
  Vec3d start, center;
  Matrix4 linear, rotation;
  double since;  // the reference time
  // How points y move with time: velocity + spin x (y - center) + growth (y - center).
  Vec3d velocity, spin;
  double growth;
  Vec3d turns[3];  // per unit of each axis of the course's spin, a rotation vector

  Vec3d point(const Vec3d& x) const { return center + linear.vector(x - start); }
};

Placing place_at(const Course& course, double reference, double time) {
  const KeyPose from = key_pose(course.keyframes, reference);
  const KeyPose to = key_pose(course.keyframes, time);
  Placing at;
  at.since = time - reference;
  const Vec3d turn = value(course.spin) * at.since;
  const Matrix4 spun = rotation_by(turn);
  Matrix4 turned = to.rotation * transposed(from.rotation);
  const double scale = to.scale / from.scale;
  const Vec3d arm = turned.vector(course.center - from.place) * scale;
  at.start = course.center;
  at.center = to.place + arm + value(course.velocity) * at.since;
  at.rotation = spun * turned;
  at.linear = at.rotation;
  for (auto& row : at.linear.m) {
    for (int k = 0; k < 3; ++k) row[k] *= scale;
  }
  at.velocity = to.velocity + cross(to.spin, arm) + arm * to.growth + value(course.velocity);
  at.spin = value(course.spin) + spun.vector(to.spin);
  at.growth = to.growth;
  for (int k = 0; k < 3; ++k) at.turns[k] = turn_per_component(turn, k) * at.since;
  return at;
}

Vec3<Lanes> times(const Vec3d& v, const Lanes& d) { return {d * v.x, d * v.y, d * v.z}; }
Vec3<Lanes> lanes_of(const Vec3<Dual>& v) { return {v.x.d, v.y.d, v.z.d}; }
Vec3<Lanes> apply(const Matrix4& m, const Vec3<Lanes>& v) {
  Vec3<Lanes> r;
  for (int i = 0; i < 3; ++i) r[i] = v.x * m.m[i][0] + v.y * m.m[i][1] + v.z * m.m[i][2];
  return r;
}
bool is_still(const Vec3<Lanes>& v) { return is_zero(v.x) && is_zero(v.y) && is_zero(v.z); }

// What moves along a course, at a time with derivatives of its own.
class Carrier {
 public:
  Carrier(const Course& course, double reference, const Dual& time)
      : course_(course), time_(time.d), at_(place_at(course, reference, time.v)) {
    const Vec3<Lanes> velocity = lanes_of(course.velocity);
    of_all_ = velocity * at_.since + course.shift - apply(at_.linear, course.shift);
    seeded_ = !is_zero(time_) || !is_still(velocity) || !is_still(course.shift) ||
              !is_still(lanes_of(course.spin));
  }
  const Placing& at() const { return at_; }
  // Whether the course has derivatives itself.
  bool seeded() const { return seeded_; }

  // Of a point at y now; d: its derivatives at the reference time.
  Vec3<Lanes> tangent(const Vec3d& y, const Vec3<Lanes>& d) const {
    const Vec3d arm = y - at_.center;
    return apply(at_.linear, d) + of_all_ + turned(arm) +
           times(at_.velocity + arm * at_.growth, time_);
  }
  // The same of a unit vector.
  Vec3<Lanes> unit_tangent(const Vec3d& n, const Vec3<Lanes>& d) const {
    return apply(at_.rotation, d) + turned(n);
  }

 private:
  Vec3<Lanes> turned(const Vec3d& arm) const {
    Vec3<Lanes> sum = times(cross(at_.spin, arm), time_);
    for (int k = 0; k < 3; ++k) sum += times(cross(at_.turns[k], arm), course_.spin[k].d);
    return sum;
  }

  const Course& course_;
  Lanes time_;
  Placing at_;
  Vec3<Lanes> of_all_;
  bool seeded_;
};

void carry(Mesh& mesh, const Carrier& carrier) {
  const bool seeded = carrier.seeded();
  if (seeded) {
    mesh.position_tangents.resize(mesh.positions.size());
    if (mesh.normal_source == NormalSource::kGiven)
      mesh.normal_tangents.resize(mesh.normals.size());
  }
  Tangents positions, normals;
  positions.reserve(mesh.positions.size());
  normals.reserve(mesh.normals.size());
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3d y = carrier.at().point(cast<double>(mesh.positions[i]));
    mesh.positions[i] = cast<float>(y);
    if (!mesh.position_tangents.empty())
      positions.push_back(carrier.tangent(y, mesh.position_tangents[i]));
  }
  for (size_t i = 0; i < mesh.normals.size() && mesh.normal_source == NormalSource::kGiven; ++i) {
    mesh.normals[i] = carrier.at().rotation.vector(mesh.normals[i]);
    if (!mesh.normal_tangents.empty())
      normals.push_back(carrier.unit_tangent(mesh.normals[i], mesh.normal_tangents[i]));
  }
  mesh.position_tangents = std::move(positions);
  if (mesh.normal_source == NormalSource::kGiven) mesh.normal_tangents = std::move(normals);
  if (!mesh.positions.empty()) update_shading_normals(mesh);
}

Vec3<Dual> dual(const Vec3d& v, const Vec3<Lanes>& d) {
  return {{v.x, d.x}, {v.y, d.y}, {v.z, d.z}};
}

void carry(Camera& camera, const Carrier& carrier) {
  const Vec3d origin = carrier.at().point(value(camera.origin));
  camera.origin = dual(origin, carrier.tangent(origin, lanes_of(camera.origin)));
  for (Vec3<Dual>* axis : {&camera.left, &camera.up, &camera.forward}) {
    const Vec3d now = carrier.at().rotation.vector(value(*axis));
    *axis = dual(now, carrier.unit_tangent(now, lanes_of(*axis)));
  }
}

// Whether a box is clear of all faces of a mesh, and not near to them.
bool is_clear(Bounds box, const Mesh& mesh, const Vec3d& viewer) {
  const Bounds bounds = bounds_of(mesh);
  constexpr double kNear = 0x1p-18;  // twice the blur of near faces
  const double far = length(viewer) + length(bounds.lower) + length(bounds.upper);
  const Vec3d margin = Vec3d{1, 1, 1} * (kNear * far);
  box = {box.lower - margin, box.upper + margin};
  const auto meets = [&](const Bounds& other) {
    for (int k = 0; k < 3; ++k) {
      if (box.lower[k] > other.upper[k] || box.upper[k] < other.lower[k]) return false;
    }
    return true;
  };
  if (!meets(bounds)) return true;
  return std::ranges::none_of(mesh.faces, [&](const FaceIndices& face) {
    Bounds corners;
    for (const uint32_t v : face) corners.extend(cast<double>(mesh.positions[v]));
    return meets(corners);
  });
}

Dual time_of(const Scene& scene, double u) {
  const Shutter& shutter = scene.exposure->shutters[scene.sensor];
  return shutter.open * (1 - u) + shutter.close * u;
}

// A camera turns about its pinhole, wherever that has been put.
Course course_of_camera(const Scene& scene) {
  Course course = scene.exposure->cameras[scene.sensor];
  course.center = value(scene.camera.origin);
  return course;
}

}  // namespace

bool Course::moves() const {
  const bool free = !(value(velocity) == Vec3d{}) || !(value(spin) == Vec3d{});
  return free || std::any_of(keyframes.begin(), keyframes.end(), [&](const Keyframe& key) {
           return !(key.place == keyframes[0].place) || key.scale != 1 || !(key.turn == Vec3d{});
         });
}

void Course::translate(const Vec3d& by) {
  center += by;
  for (Keyframe& key : keyframes) key.place += by;
}

Matrix4 Course::since_first(double time) const {
  const KeyPose pose = key_pose(keyframes, time);
  Matrix4 m = pose.rotation;
  const Vec3d start = keyframes.empty() ? Vec3d{} : keyframes[0].place;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) m.m[i][k] *= pose.scale;
  }
  const Vec3d moved = pose.place - m.vector(start);
  for (int i = 0; i < 3; ++i) m.m[i][3] = moved[i];
  return m;
}

bool is_moving(const Scene& scene) {
  if (!scene.exposure) return false;
  const Exposure& exposure = *scene.exposure;
  const Shutter& shutter = exposure.shutters[scene.sensor];
  if (shutter.open.v == exposure.reference && shutter.close.v == exposure.reference) return false;
  const auto moves = [](const Course& course) { return course.moves(); };
  return moves(exposure.cameras[scene.sensor]) ||
         std::any_of(exposure.shapes.begin(), exposure.shapes.end(), moves);
}

void check_still(const Scene& scene, const std::string& what,
                 std::span<const Parameter> parameters) {
  if (!needs_times(scene, parameters)) return;
  throw InputError({scene.file}, what +
                                     " cannot take a scene in which something moves while the "
                                     "shutter is open: shutter_close must be shutter_open");
}

Scene at_time(const Scene& scene, double u) {
  Scene there = scene;
  set_time(there, u);
  return there;
}

bool is_apart(const Scene& scene, const std::vector<bool>& moving) {
  const Vec3d viewer = value(scene.camera.origin);
  for (size_t s = 0; s < scene.shapes.size(); ++s) {
    if (!moving[s]) continue;
    Bounds box = bounds_of(scene.shapes[s].mesh);
    constexpr double kMargin = 1e-3;  // of its size, far above rounding; not tuned
    const Vec3d margin = Vec3d{1, 1, 1} * (kMargin * box.diagonal());
    box = {box.lower - margin, box.upper + margin};
    for (size_t other = 0; other < scene.shapes.size(); ++other) {
      if (other != s && !is_clear(box, scene.shapes[other].mesh, viewer)) return false;
    }
  }
  return true;
}

void set_time(Scene& scene, double u) {
  if (!scene.exposure) return;
  const Exposure& exposure = *scene.exposure;
  const Dual time = time_of(scene, u);
  for (size_t s = 0; s < scene.shapes.size(); ++s) {
    const Course& course = exposure.shapes[s];
    const Carrier carrier(course, exposure.reference, time);
    if (course.moves() || carrier.seeded()) carry(scene.shapes[s].mesh, carrier);
  }
  const Course course = course_of_camera(scene);
  const Carrier carrier(course, exposure.reference, time);
  if (course.moves() || carrier.seeded()) carry(scene.camera, carrier);
  if (!exposure.no_overlaps) return;
  std::vector<bool> moving;
  for (const Course& own : exposure.shapes) moving.push_back(own.moves());
  if (!is_apart(scene, moving)) own_exposure(scene).no_overlaps = nullptr;
}

void share_between_times(Scene& scene, int threads) {
  own_exposure(scene).kept_shapes = make_kept_shapes();
  const auto faces = std::make_shared<const CoincidentFaces>(scene, threads);
  if (faces->copies.empty() && faces->overlaps.empty()) own_exposure(scene).no_overlaps = faces;
}

Matrix4 pulls_back(const Scene& scene, ShapeId shape, double u) {
  if (!scene.exposure) return {};
  const Exposure& exposure = *scene.exposure;
  const Course& course = exposure.shapes[shape.index()];
  return transposed(place_at(course, exposure.reference, time_of(scene, u).v).linear);
}

Exposure& own_exposure(Scene& scene) {
  if (scene.exposure.use_count() > 1) scene.exposure = std::make_shared<Exposure>(*scene.exposure);
  return *scene.exposure;
}

}  // namespace limn
