// Keyframes from transforms.
#include "src/scene_file/scene_sensor.h"

#include <algorithm>
#include <cmath>

#include "src/scene/rotation.h"

namespace limn {
namespace {

double number_of(const ObjectDescription& object, const std::string& name) {
  const auto found = object.properties.find(name);
  if (found == object.properties.end()) return 0;
  if (const double* v = std::get_if<double>(&found->second.value)) return *v;
  const int64_t* v = std::get_if<int64_t>(&found->second.value);
  return v ? static_cast<double>(*v) : 0;  // others are reported where the sensor is read
}

const ObjectDescription* first_sensor(const SceneDescription& description) {
  for (const auto& object : description.objects) {
    if (object->tag != "sensor") continue;
    if (object->type != "batch") return object.get();
    for (const ChildDescription& child : object->children) {
      if (child.object->tag == "sensor") return child.object.get();
    }
  }
  return nullptr;
}

Vec3d column(const Matrix4& m, int k) { return {m.m[0][k], m.m[1][k], m.m[2][k]}; }

// A keyframe relative to the first, whose inverse is given.
Keyframe keyframe(const TimedTransform& at, const Matrix4& first_inverse) {
  constexpr double kDigits = 1e-4;  // of angles and scales, as files with few digits have them
  Keyframe key{at.time, column(at.transform, 3), at.transform * first_inverse};
  key.scale = std::cbrt(
      determinant(column(key.rotation, 0), column(key.rotation, 1), column(key.rotation, 2)));
  bool similar = key.scale > 0;
  for (int k = 0; k < 3; ++k) {
    const Vec3d a = column(key.rotation, k) / key.scale;
    const Vec3d b = column(key.rotation, (k + 1) % 3) / key.scale;
    similar = similar && std::fabs(length(a) - 1) <= kDigits && std::fabs(dot(a, b)) <= kDigits;
  }
  if (!similar) {
    throw InputError(at.where,
                     "<animation>: keyframes may differ by rotations, translations and uniform "
                     "scales alone");
  }
  // Exactly a rotation.
  for (auto& row : key.rotation.m) row[3] = 0;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) key.rotation.m[i][k] /= key.scale;
  }
  key.rotation = rotation_by(rotation_vector(key.rotation));
  if (std::fabs(key.scale - 1) < 1e-12) key.scale = 1;  // rounding of the inverse
  return key;
}

}  // namespace

double reference_time(const SceneDescription& description) {
  const ObjectDescription* sensor = first_sensor(description);
  if (!sensor) return 0;
  const double open = number_of(*sensor, "shutter_open");
  return open + 0.5 * (number_of(*sensor, "shutter_close") - open);
}

Shutter read_shutter(Properties& p) {
  Shutter shutter{p.number("shutter_open", 0), p.number("shutter_close", 0)};
  if (shutter.close < shutter.open) p.fail("shutter_close", "must not be before shutter_open");
  return shutter;
}

Matrix4 read_course(DescribedProperties& p, double time, Course& course) {
  const Animation* animation = p.animation("to_world");
  if (!animation) return p.transform("to_world");
  const Matrix4& first = animation->front().transform;
  Matrix4 inverse;
  try {
    inverse = first.inverse();
  } catch (const std::domain_error&) {
    throw InputError(animation->front().where, "<animation>: the transform is not invertible");
  }
  for (const TimedTransform& at : *animation) course.keyframes.push_back(keyframe(at, inverse));
  for (size_t k = 0; k + 1 < course.keyframes.size(); ++k) {
    const Matrix4 &a = course.keyframes[k].rotation, &b = course.keyframes[k + 1].rotation;
    course.keyframes[k].turn = rotation_vector(b * transposed(a));
  }
  return course.since_first(time) * first;
}

}  // namespace limn
