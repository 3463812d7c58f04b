// Deep copies of scenes, and the choice of a sensor.
#include "limn/core/scene.h"

#include "limn/core/exposure.h"
#include "limn/core/mesh_attribute.h"

namespace limn {

namespace {

using BsdfCopies = std::map<const Bsdf*, std::shared_ptr<Bsdf>>;

// Copies a BSDF once, nested BSDFs included, so that sharing is preserved.
std::shared_ptr<Bsdf> copy_once(const std::shared_ptr<Bsdf>& original, BsdfCopies& copies) {
  const auto found = copies.find(original.get());
  if (found != copies.end()) return found->second;
  std::shared_ptr<Bsdf> copy = original->clone();
  const std::span<std::shared_ptr<Bsdf>> from = original->nested();
  const std::span<std::shared_ptr<Bsdf>> to = copy->nested();
  for (size_t i = 0; i < from.size(); ++i) to[i] = copy_once(from[i], copies);
  copies[original.get()] = copy;
  return copy;
}

}  // namespace

Bounds bounds_of(const Scene& scene) {
  Bounds bounds;
  for (const Shape& shape : scene.shapes) {
    const Bounds b = bounds_of(shape.mesh);
    bounds.extend(b.lower);
    bounds.extend(b.upper);
  }
  return bounds;
}

const Shape* find_smooth(const Scene& scene) {
  for (const Shape& shape : scene.shapes) {
    for (const bool front : {true, false}) {
      const Bsdf* side = shape.bsdf->side(front);
      if (side && (side->lobes().smooth || side->lobes().through)) return &shape;
    }
  }
  return nullptr;
}

Scene deep_copy(const Scene& scene) {
  Scene copy = scene;
  BsdfCopies copies;
  for (Shape& shape : copy.shapes) {
    shape.bsdf = copy_once(shape.bsdf, copies);
    if (shape.radiance_texture) shape.radiance_texture = shape.radiance_texture->clone();
    for (auto& attribute : shape.mesh.attributes) {
      attribute = std::make_shared<MeshAttribute>(*attribute);
    }
  }
  for (auto& [id, bsdf] : copy.bsdfs_by_id) bsdf = copy_once(bsdf, copies);
  if (scene.environment) copy.environment = scene.environment->clone();
  for (auto& light : copy.delta_lights) light = light->clone();
  if (scene.exposure) copy.exposure = std::make_shared<Exposure>(*scene.exposure);
  return copy;
}

std::string sensor_names(const Scene& scene) {
  std::string names;
  for (size_t i = 0; i < scene.sensors.size(); ++i) {
    names += (i > 0 ? ", " : "") + std::to_string(i);
    const std::string& id = scene.sensors[i].id;
    if (!id.empty()) names += " or \"" + id + "\"";
  }
  return names;
}

std::string sensor_name(const Scene& scene) {
  const bool has_id =
      scene.sensor < scene.sensors.size() && !scene.sensors[scene.sensor].id.empty();
  return has_id ? scene.sensors[scene.sensor].id : std::to_string(scene.sensor);
}

void use_sensor(Scene& scene, const std::string& name) {
  const std::vector<Sensor>& sensors = scene.sensors;
  // Indices take precedence: an id may look like the index of another sensor.
  size_t at = 0;
  while (at < sensors.size() && name != std::to_string(at)) ++at;
  if (at == sensors.size() && !name.empty()) {
    at = 0;
    while (at < sensors.size() && name != sensors[at].id) ++at;
  }
  if (at < sensors.size()) {
    const Sensor sensor = sensors[at];
    scene.sensor = at;
    scene.camera = sensor.camera;
    scene.film = sensor.film;
    scene.sample_count = sensor.sample_count;
    scene.seed = sensor.seed;
    return;
  }
  throw InputError({scene.file},
                   "there is no sensor \"" + name + "\" (known: " + sensor_names(scene) + ")");
}

void resize_film(Scene& scene, int width, int height) {
  const Film& film = scene.film;
  if (film.crop_width != scene.camera.width || film.crop_height != scene.camera.height) {
    throw InputError(film.where, "a film with a crop window cannot be resized");
  }
  if (width < 1) throw FieldError("width", "must be at least 1");
  if (height < 1) throw FieldError("height", "must be at least 1");
  check_film_size({scene.file}, width, height, "lower width and height");
  const auto resize = [=](auto& sensor) {
    sensor.camera.width = width;
    sensor.camera.height = height;
    sensor.camera.half_height = sensor.camera.half_square * height / width;
    sensor.film.crop_width = width;
    sensor.film.crop_height = height;
  };
  resize(scene);
  if (scene.sensor < scene.sensors.size()) resize(scene.sensors[scene.sensor]);
}

void set_shading(Scene& scene, ShadingModel model) {
  scene.shading = model;
  const bool mitsuba = model == ShadingModel::kMitsuba;
  for (const Shape& shape : scene.shapes) shape.bsdf->set_mitsuba_shading(mitsuba);
}

void set_mesh(Scene& scene, ShapeId shape, std::vector<Vec3f> positions,
              std::vector<FaceIndices> faces, std::vector<std::string>* warnings) {
  Shape& changed = scene.shapes[shape.index()];
  if (changed.mesh.textured) {
    throw InputError(changed.where,
                     "a new mesh has no texture coordinates, which the material of "
                     "this shape needs");
  }
  changed.pivot.reset();
  changed.to_world = {};
  changed.mesh =
      make_mesh(std::move(positions), std::move(faces),
                changed.mesh.normal_source == NormalSource::kFace, changed.where, warnings);
}

}  // namespace limn
