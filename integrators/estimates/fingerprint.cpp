// What distinguishes scenes.
#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <numbers>

#include "limn/core/exposure.h"
#include "limn/core/light.h"
#include "limn/core/mesh_attribute.h"
#include "limn/core/parameter.h"
#include "limn/core/rng.h"
#include "limn/integrators/parts.h"

namespace limn {

namespace {

class Hash {
 public:
  void add(uint64_t bits) { state_ = mix_bits(state_ + bits); }
  void add(double number) { add(std::bit_cast<uint64_t>(number)); }
  void add(const Dual& number) { add(value(number)); }
  void add(const std::string& text) {
    add(uint64_t{text.size()});
    for (const char c : text) add(uint64_t{static_cast<unsigned char>(c)});
  }
  template <class T>
  void add(const Vec3<T>& v) {
    add(v.x);
    add(v.y);
    add(v.z);
  }
  void add(const Vec3f& v) { add(cast<double>(v)); }
  void add(const FaceIndices& face) {
    for (const uint32_t v : face) add(uint64_t{v});
  }
  template <class T>
  void add(const std::vector<T>& values) {
    add_all(values);
  }
  template <class T>
  void add(const SharedVector<T>& values) {
    add_all(values);
  }
  template <class Values>
  void add_all(const Values& values) {
    add(uint64_t{values.size()});
    for (const auto& v : values) add(v);
  }
  // Its kind and the values of its parameters.
  template <class T>
  void add_object(T& object) {
    add(object.describe());
    for (const ParameterRef& ref : object.parameters()) {
      for (const Dual* v : ref.values) add(*v);
    }
  }
  void add_texels(const TexelMap& map) {
    if (map.map().width == 0) return;
    for (const float texel : map.texels().data) add(double{texel});
  }
  // Of a shape that textures are read on.
  void add_textures(const Shape& shape) {
    const Mesh& mesh = shape.mesh;
    for (const Vec3f& place : mesh.uv_places) add(place);
    add(mesh.uv_ids);
    for (const auto& attribute : mesh.attributes) add_texels(*attribute);
    for (int k = 0; k < shape.bsdf->texture_count(); ++k) add_texels(shape.bsdf->texture(k));
    if (shape.radiance_texture) add_object(*shape.radiance_texture);
    if (shape.radiance_texture) add_texels(*shape.radiance_texture);
  }
  void add_environment(Environment& environment) {
    // One texel of many may lie between the directions.
    add_texels(environment);
    constexpr int kDirections = 4096;  // in a spiral
    for (int i = 0; i < kDirections; ++i) {
      const double z = 1 - (2 * i + 1.0) / kDirections;
      const double turn = std::numbers::pi * (3 - std::sqrt(5.0)) * i, r = std::sqrt(1 - z * z);
      const Rgb<double> c = environment.radiance(Vec3d{r * std::cos(turn), r * std::sin(turn), z});
      for (int k = 0; k < 3; ++k) add(c[k]);
    }
  }
  std::string text() const { return fmt::format("{:016x}", state_); }

 private:
  uint64_t state_ = 0;
};

void add_camera(const Scene& scene, Hash& hash) {
  const Camera& c = scene.camera;
  for (const auto& v : {c.origin, c.left, c.up, c.forward}) hash.add(v);
  for (const double v : {value(c.fov), c.x_factor, c.near_clip, c.far_clip, c.offset_x, c.offset_y})
    hash.add(v);
  if (c.is_orthographic()) {
    hash.add(c.half_width);
    hash.add(c.half_height);
  }
  if (c.has_lens()) {
    hash.add(value(c.aperture_radius));
    hash.add(value(c.focus_distance));
  }
  const Film& f = scene.film;
  for (const int v : {c.width, c.height, f.crop_x, f.crop_y, f.crop_width, f.crop_height,
                      int{f.sample_border}, static_cast<int>(f.filter.kind)})
    hash.add(static_cast<uint64_t>(v));
  hash.add(f.filter.radius);
  hash.add(f.filter.stddev);
  hash.add(f.filter.b);
  hash.add(f.filter.c);
}

void add_course(const Course& course, Hash& hash) {
  for (const Keyframe& key : course.keyframes) {
    hash.add(key.time);
    hash.add(key.place);
    for (int k = 0; k < 9; ++k) hash.add(key.scale * key.rotation.m[k / 3][k % 3]);
  }
  hash.add(course.velocity);
  hash.add(course.spin);
}

void add_exposure(const Scene& scene, Hash& hash) {
  const Exposure& exposure = *scene.exposure;
  hash.add(exposure.reference);
  hash.add(exposure.shutters[scene.sensor].open);
  hash.add(exposure.shutters[scene.sensor].close);
  add_course(exposure.cameras[scene.sensor], hash);
  for (const Course& course : exposure.shapes) add_course(course, hash);
}

}  // namespace

std::string fingerprint(const Scene& scene) {
  Hash hash;
  add_camera(scene, hash);
  if (is_moving(scene)) add_exposure(scene, hash);
  for (const int v :
       {scene.max_depth, scene.rr_depth, int{scene.hide_emitters}, static_cast<int>(scene.shading)})
    hash.add(static_cast<uint64_t>(v));
  for (const Shape& shape : scene.shapes) {
    hash.add(shape.id);
    hash.add(shape.mesh.positions);
    hash.add(shape.mesh.faces);
    hash.add(shape.mesh.normals);
    hash.add(shape.mesh.normal_ids);
    hash.add(uint64_t{shape.is_emitter});
    for (int k = 0; k < 3; ++k) hash.add(shape.radiance[k]);
    hash.add_object(*shape.bsdf);
    if (shape.mesh.textured) hash.add_textures(shape);
  }
  if (scene.environment) hash.add_environment(*scene.environment);
  for (const auto& light : scene.delta_lights) {
    hash.add(light->origin().v);
    hash.add_object(*light);
    if (light->texture()) hash.add_texels(*light->texture());
  }
  return hash.text();
}

std::string fingerprint(const Scene& scene, const std::vector<Parameter>& parameters) {
  Hash hash;
  for (const Parameter& parameter : parameters) {
    if (parameter.size > 1) continue;
    for (size_t s = 0; s < scene.shapes.size(); ++s) {
      hash.add(parameter.velocities(scene, ShapeId(s)));
    }
    for (const float v : parameter.texel_velocities(scene).data) hash.add(double{v});
  }
  return hash.text();
}

std::string fingerprint(const std::vector<double>& numbers) {
  Hash hash;
  hash.add(numbers);
  return hash.text();
}

}  // namespace limn
