// Which numbers of a scene get slots, and what becomes of their derivatives.
#include "integrators/backward/parameter_slots.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <utility>

#include "limn/core/check.h"
#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/parameter.h"
#include "limn/core/tangent.h"

namespace limn {

namespace {

// Whether a parameter moves vertices that velocities() does not tell, as shutter times do.
bool moves_unknown(const Scene& scene, const Parameter& parameter) {
  if (!moved_by({&parameter, 1}).vertices) return false;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    if (!parameter.velocities(scene, ShapeId(s)).empty()) return false;
  }
  return true;
}

// The object among a BSDF and those inside it that acts on one side; null if that is black.
std::shared_ptr<Bsdf> object_of(const std::shared_ptr<Bsdf>& bsdf, const Bsdf* side) {
  if (bsdf.get() == side) return bsdf;
  for (const std::shared_ptr<Bsdf>& nested : bsdf->nested())
    if (auto found = object_of(nested, side)) return found;
  Bsdf* const back = const_cast<Bsdf*>(bsdf->side(false));  // NOLINT: a part of it
  return back == side ? std::shared_ptr<Bsdf>(bsdf, back) : nullptr;
}

// What scatters in a scene, each once: copies of the scene have them in the same order.
std::vector<std::shared_ptr<Bsdf>> scatterers(const Scene& scene) {
  std::vector<std::shared_ptr<Bsdf>> list;
  std::set<const Bsdf*> found;
  for (const Shape& shape : scene.shapes) {
    for (const bool front : {false, true}) {
      const Bsdf* side = shape.bsdf->side(front);
      if (!side) continue;
      auto object = object_of(shape.bsdf, side);
      CHECK(object != nullptr);
      if (found.insert(object.get()).second) list.push_back(object);
    }
  }
  return list;
}

std::array<Dual*, kCameraSlots> camera_numbers(Camera& c) {
  return {&c.origin.x, &c.origin.y,        &c.origin.z,      &c.left.x,
          &c.left.y,   &c.left.z,          &c.up.x,          &c.up.y,
          &c.up.z,     &c.forward.x,       &c.forward.y,     &c.forward.z,
          &c.fov,      &c.aperture_radius, &c.focus_distance};
}

// Copies of an object whose lanes carry its parameters with a slot, four of them each.
template <class T>
SeededCopies<T> seeded_copies(const T& object, const std::vector<ChannelSlots>& slots) {
  SeededCopies<T> copies;
  int lane = kLanes;
  const auto seed = [&](size_t k, const std::vector<size_t>& channels, const ChannelSlots& to) {
    if (to == ChannelSlots{}) return;
    if (lane == kLanes) {
      copies.push_back({object.clone(), {}});
      lane = 0;
    }
    const std::vector<ParameterRef> parameters = copies.back().object->parameters();
    for (const size_t channel : channels) parameters[k].values[channel]->d[lane] = 1;
    copies.back().slots[lane++] = to;
  };
  if (std::all_of(slots.begin(), slots.end(), [](const auto& s) { return s == ChannelSlots{}; })) {
    return copies;
  }
  const std::shared_ptr<T> unseeded = object.clone();
  const std::vector<ParameterRef> parameters = unseeded->parameters();
  for (size_t k = 0; k < slots.size(); ++k) {
    if (parameters[k].values.size() == 1) {
      seed(k, {0}, slots[k]);
    } else if (!parameters[k].mixes_channels) {
      seed(k, {0, 1, 2}, slots[k]);
    } else {
      for (size_t c = 0; c < 3; ++c) seed(k, {c}, {slots[k][c], slots[k][c], slots[k][c]});
    }
  }
  if (9 + 3 * kLanes * static_cast<int>(copies.size()) > detail::Jacobian::kMost) {
    throw InputError(
        fmt::format("one material or light has {} parameters, too many for reverse mode at once: "
                    "name fewer of them",
                    parameters.size()));
  }
  return copies;
}

}  // namespace

std::vector<Parameter> reverse_parameters(const Scene& scene, const BackwardOptions& options) {
  if (!options.found.empty()) return options.found;
  std::vector<Parameter> parameters;
  if (options.parameters.empty()) {
    parameters = list_parameters(scene);
    std::erase_if(parameters,
                  [&](const Parameter& p) { return p.repeats || moves_unknown(scene, p); });
    return parameters;
  }
  for (const std::string& name : options.parameters)
    parameters.push_back(find_parameter_or_array(scene, name));
  return parameters;
}

// The values of a scene that a parameter may move, in an order that all copies share.
class ParameterSlots::Values {
 public:
  // Of the camera, then of emitting shapes, of BSDFs, the environment and the lights.
  static std::vector<Dual*> of(Scene& scene) {
    std::vector<Dual*> values;
    for (Dual* v : camera_numbers(scene.camera)) values.push_back(v);
    for (Shape& shape : scene.shapes) {
      for (int c = 0; c < 3; ++c) values.push_back(&shape.radiance[c]);
    }
    const auto add = [&](auto& object) {
      for (const ParameterRef& ref : object.parameters()) {
        values.insert(values.end(), ref.values.begin(), ref.values.end());
      }
    };
    for (const auto& bsdf : scatterers(scene)) add(*bsdf);
    if (scene.environment) add(*scene.environment);
    for (const auto& light : scene.delta_lights) add(*light);
    return values;
  }
};

ParameterSlots::ParameterSlots(const Scene& scene, std::vector<Parameter> parameters,
                               const std::optional<double>& time)
    : parameters_(std::move(parameters)),
      time_(time),
      scene_(deep_copy(scene)),
      size_(scene.shapes.empty() ? 1 : bounds_of(scene).diagonal()) {
  if (time_) set_time(scene_, *time_);
  slots_.scene = &scene_;
  slots_.meshes.resize(scene.shapes.size());
  free_.shapes.assign(scene.shapes.size(), false);
  for (const Parameter& parameter : parameters_) {
    dependences_.push_back(dependence_of(scene, parameter));
  }
  add_shapes(scene);
  add_values(scene);
  add_texels();
}

std::vector<size_t> ParameterSlots::sizes() const {
  std::vector<size_t> sizes;
  for (const Parameter& parameter : parameters_) sizes.push_back(parameter.numbers());
  return sizes;
}

uint32_t ParameterSlots::take(uint32_t count, double unit) {
  const uint32_t first = slots_.count;
  slots_.count += count;
  units_.resize(slots_.count, static_cast<float>(unit));
  return first;
}

ParameterSlots::Dependence ParameterSlots::dependence_of(const Scene& scene,
                                                         const Parameter& parameter) const {
  if (moves_unknown(scene, parameter)) {
    throw InputError({scene.file},
                     "the parameter \"" + parameter.name + "\" has no reverse mode: use gradient");
  }
  Dependence dependence;
  dependence.texels = parameter.texel_map(scene_);
  if (parameter.array.size() == 3) return dependence;
  if (parameter.array.empty()) {
    const Image velocity = parameter.texel_velocities(scene);
    for (uint32_t k = 0; k < velocity.data.size(); ++k) {
      if (velocity.data[k] != 0) dependence.texel_velocity.emplace_back(k, velocity.data[k]);
    }
  }
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    if (parameter.velocities(scene, ShapeId(s)).empty()) continue;
    if (time_ && parameter.size == 1) dependence.velocity = velocities_now(scene, parameter, s);
    dependence.shape = ShapeId(s);
    dependence.directions = parameter.directions(scene);
    if (scene.shapes[s].mesh.normal_source != NormalSource::kGiven || parameter.size > 1) break;
    Scene copy = deep_copy(scene);
    parameter.seed(copy, 0);
    if (time_) set_time(copy, *time_);
    for (const Vec3<Lanes> d : copy.shapes[s].mesh.normal_tangents) {
      dependence.normal_velocity.push_back({d.x[0], d.y[0], d.z[0]});
    }
    break;
  }
  return dependence;
}

// The velocities of a shape's vertices at the time, by a parameter of one number.
std::vector<Vec3d> ParameterSlots::velocities_now(const Scene& scene, const Parameter& parameter,
                                                  uint32_t shape) const {
  Scene copy = deep_copy(scene);
  parameter.seed(copy, 0);
  set_time(copy, *time_);
  std::vector<Vec3d> velocities;
  for (const Vec3<Lanes> d : copy.shapes[shape].mesh.position_tangents) {
    velocities.push_back({d.x[0], d.y[0], d.z[0]});
  }
  return velocities;
}

void ParameterSlots::add_shapes(const Scene& scene) {
  gathers_.resize(scene.shapes.size());
  for (size_t i = 0; i < dependences_.size(); ++i) {
    const ShapeId shape = dependences_[i].shape;
    if (!shape.valid()) continue;
    free_.shapes[shape.index()] = true;
    gathers_[shape.index()].parameters.push_back(i);
  }
  const Vec3<Lanes> axes{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    if (!free_.shapes[s]) continue;
    Mesh& mesh = scene_.shapes[s].mesh;
    const auto count = static_cast<uint32_t>(mesh.positions.size());
    mesh.position_tangents.assign(count, axes);
    MeshSlots& slots = slots_.meshes[s];
    slots.positions = take(3 * count, size_);
    gathers_[s].copies.resize(count);
    if (time_) gathers_[s].back = pulls_back(scene, ShapeId(s), *time_);
    for (const uint32_t root : mesh.weld) ++gathers_[s].copies[root];
    slots.directions = take(3 * static_cast<uint32_t>(mesh.u_directions.size()));
    if (mesh.normal_source == NormalSource::kFace) continue;
    slots.normals = take(3 * static_cast<uint32_t>(mesh.normals.size()));
    gathers_[s].normals.emplace(mesh);
  }
}

// The slot of every value of the scene; 0 for those that no parameter moves.
std::vector<uint32_t> ParameterSlots::take_values(const Scene& scene) {
  // Meshes are no part of what is looked at.
  Scene hull = deep_copy(scene);
  for (Shape& shape : hull.shapes) shape.mesh = {};
  Scene copy = deep_copy(hull);
  std::vector<Dual*> values = Values::of(copy);
  std::vector<uint32_t> slot_of(values.size(), 0);
  for (size_t i = 0; i < parameters_.size(); ++i) {
    if (dependences_[i].shape.valid() || dependences_[i].texels) continue;
    if (time_) {
      copy = deep_copy(hull);
      values = Values::of(copy);
    }
    parameters_[i].seed(copy, 0);
    if (time_) set_time(copy, *time_);
    for (size_t k = 0; k < values.size(); ++k) {
      if (values[k]->d[0] == 0) continue;
      if (k < kCameraSlots) {
        if (slots_.camera == 0) {
          slots_.camera = take(kCameraSlots);
          std::fill_n(units_.begin() + slots_.camera, 3, static_cast<float>(size_));
        }
        slot_of[k] = slots_.camera + static_cast<uint32_t>(k);
      }
      if (slot_of[k] == 0) slot_of[k] = take(1);
      // The channels of a colour are the values that it moves, in their order; once for each object
      // that has them, as the two sides of glass do.
      const size_t number = parameters_[i].colour ? dependences_[i].weights.size() % 3 : 0;
      dependences_[i].weights.push_back({slot_of[k], values[k]->d[0], number});
    }
    for (Dual* v : values) v->d[0] = 0;  // some are in the list twice
  }
  free_.camera = slots_.camera != 0;
  return slot_of;
}

void ParameterSlots::add_values(const Scene& scene) {
  const std::vector<uint32_t> slot_of = take_values(scene);
  size_t next = kCameraSlots;
  const auto slots_of = [&](auto& object) {
    std::vector<ChannelSlots> slots;
    for (const ParameterRef& ref : object.parameters()) {
      const size_t count = ref.values.size();
      const auto at = [&](size_t channel) { return slot_of[next + std::min(channel, count - 1)]; };
      slots.push_back({at(0), at(1), at(2)});
      next += count;
    }
    return slots;
  };
  for (size_t s = 0; s < scene_.shapes.size(); ++s, next += 3) {
    slots_.radiance.push_back({slot_of[next], slot_of[next + 1], slot_of[next + 2]});
  }
  slots_.bsdfs.resize(scene_.shapes.size());
  for (const auto& bsdf : scatterers(scene_)) {
    auto copies = std::make_unique<SeededCopies<Bsdf>>(seeded_copies<Bsdf>(*bsdf, slots_of(*bsdf)));
    if (copies->empty()) continue;
    for (size_t s = 0; s < scene_.shapes.size(); ++s) {
      for (const bool front : {false, true}) {
        if (scene_.shapes[s].bsdf->side(front) == bsdf.get()) slots_.bsdfs[s][front] = copies.get();
      }
    }
    slots_.bsdf_copies.push_back(std::move(copies));
  }
  if (scene_.environment) {
    slots_.environment =
        seeded_copies<Environment>(*scene_.environment, slots_of(*scene_.environment));
  }
  for (const auto& light : scene_.delta_lights) {
    auto copies = seeded_copies<DeltaLight>(*light, slots_of(*light));
    if (!copies.empty()) slots_.lights.emplace_back(light.get(), std::move(copies));
  }
  CHECK_EQ(next, slot_of.size());
}

void ParameterSlots::add_texels() {
  for (const Dependence& dependence : dependences_) {
    if (!dependence.texels || slots_.of(dependence.texels) != 0) continue;
    const TexelMap::Map map = dependence.texels->map();
    const uint32_t first = take(3 * static_cast<uint32_t>(map.width * map.height));
    slots_.texels.emplace_back(dependence.texels, first);
  }
}

std::vector<std::vector<double>> ParameterSlots::gather(const std::vector<double>& sums) const {
  std::vector<std::vector<double>> values;
  for (const Parameter& parameter : parameters_) values.emplace_back(parameter.numbers());
  for (size_t i = 0; i < parameters_.size(); ++i) {
    for (const Weight& w : dependences_[i].weights) values[i][w.number] += sums[w.slot] * w.weight;
    if (!dependences_[i].texels) continue;
    const double* texels = &sums[slots_.of(dependences_[i].texels)];
    if (parameters_[i].size > 1) values[i].assign(texels, texels + parameters_[i].size);
    for (const auto& [k, v] : dependences_[i].texel_velocity) values[i][0] += texels[k] * v;
  }
  for (uint32_t s = 0; s < free_.shapes.size(); ++s) {
    if (free_.shapes[s]) gather_shape(ShapeId(s), sums, values);
  }
  return values;
}

void ParameterSlots::gather_shape(ShapeId shape, const std::vector<double>& sums,
                                  std::vector<std::vector<double>>& values) const {
  const Mesh& mesh = scene_.shape(shape).mesh;
  const MeshSlots& slots = slots_.mesh(shape);
  const auto vectors = [&](uint32_t first, size_t count) {
    std::vector<Vec3d> list(count);
    for (size_t i = 0; i < count; ++i) {
      const double* at = &sums[first + 3 * i];
      list[i] = {at[0], at[1], at[2]};
    }
    return list;
  };
  std::vector<Vec3d> positions = vectors(slots.positions, mesh.positions.size()), normals;
  if (slots.normals != 0) {
    normals = vectors(slots.normals, mesh.normals.size());
    gathers_[shape.index()].normals->pull_back(normals, positions);
  }
  pull_back_u_directions(mesh, vectors(slots.directions, mesh.u_directions.size()), positions);
  const std::vector<uint32_t>& copies = gathers_[shape.index()].copies;
  // By vertices at the reference time.
  std::vector<Vec3d> of_vertices = positions;
  if (const auto& back = gathers_[shape.index()].back) {
    for (Vec3d& d : of_vertices) d = back->vector(d);
  }
  for (const size_t i : gathers_[shape.index()].parameters) {
    const Dependence& dependence = dependences_[i];
    for (size_t v = 0; v < dependence.directions.size(); ++v) {
      const uint32_t root = mesh.weld[v];
      values[i][v] = dot(of_vertices[root], dependence.directions[v]) / copies[root];
    }
    if (!dependence.directions.empty()) continue;
    if (parameters_[i].size > 1) {
      for (size_t v = 0; v < mesh.weld.size(); ++v) {
        const uint32_t root = mesh.weld[v];
        for (int k = 0; k < 3; ++k) values[i][3 * v + k] = of_vertices[root][k] / copies[root];
      }
      continue;
    }
    // Copies move together: the first one stands for all. Velocities are made anew: kept for all
    // parameters of large meshes, they would be a quarter of the memory.
    const std::vector<Vec3d> velocity =
        time_ ? dependence.velocity : parameters_[i].velocities(scene_, shape);
    double sum = 0;
    for (size_t v = 0; v < velocity.size(); ++v)
      if (velocity[v] != Vec3d{}) sum += dot(positions[v], velocity[v]);
    for (size_t n = 0; n < dependence.normal_velocity.size(); ++n) {
      sum += dot(normals[n], dependence.normal_velocity[n]);
    }
    values[i][0] += sum;
  }
}

}  // namespace limn
