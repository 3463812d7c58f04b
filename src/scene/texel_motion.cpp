// Motions of the texels of an environment map, a texture or an attribute of a mesh: along a field,
// or single texels.
#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <limits>

#include "limn/core/check.h"
#include "limn/core/environment.h"
#include "limn/core/mesh_attribute.h"
#include "src/base/text.h"
#include "src/scene/motion.h"

namespace limn {

namespace {

constexpr double kLargest = std::numeric_limits<float>::max();  // of a texel's value

// Texels in any copy of a scene, and the name of their array.
struct Texels {
  std::function<TexelMap*(Scene&)> find;
  std::string name;

  const TexelMap& in(const Scene& scene) const { return *find(const_cast<Scene&>(scene)); }
};

// What is looked up is linear in texels, so moves are exact up to float rounding.
class TexelMotion : public Motion {
 public:
  explicit TexelMotion(Texels texels) : texels_(std::move(texels)) {}

  TexelMap* texel_map(Scene& scene) const final { return texels_.find(scene); }
  Moved moved() const final { return {}; }
  void seed(Scene& scene, int lane, size_t component) const final {
    texel_map(scene)->add_texel_tangents(texel_velocities(scene, component), lane);
  }
  void move(Scene& scene, double step, size_t component) const final {
    Image texels = texel_map(scene)->texels();
    const Image velocities = texel_velocities(scene, component);
    for (size_t i = 0; i < texels.data.size(); ++i) {
      const double moved = double{texels.data[i]} + step * velocities.data[i];
      if (!(std::fabs(moved) <= kLargest)) {
        throw InputError({scene.file}, fmt::format("a step of {:g} along texels of \"{}\" is "
                                                   "too long: their values must be finite",
                                                   step, texels_.name));
      }
      texels.data[i] = static_cast<float>(moved);
    }
    texel_map(scene)->set_texels(texels);
  }

 protected:
  const Texels texels_;
};

class TexelField final : public TexelMotion {
 public:
  TexelField(Texels texels, Image field)
      : TexelMotion(std::move(texels)), field_(std::move(field)) {}
  Image texel_velocities(const Scene&, size_t) const override { return field_; }

 private:
  Image field_;  // H by W by 3
};

// Reads as many channels as the map has; grey changes all alike. A map of one row is stored as two.
Image read_texel_field(const TexelMap::Map& map, const std::string& file) {
  const Image image = read_exr(file);
  const bool one_row = image.height == 1 && map.height == 2;
  if (image.width != map.width || (image.height != map.height && !one_row)) {
    throw InputError({file}, fmt::format("the field has {} x {} texels, but the map "
                                         "{} x {}",
                                         image.width, image.height, map.width, map.height));
  }
  Image field(map.width, map.height, 3);
  const size_t pixels = static_cast<size_t>(image.width) * image.height;
  for (size_t i = 0; i < field.data.size(); ++i) {
    const size_t k = i % (3 * pixels);
    field.data[i] = image.channels == 3 ? image.data[k] : image.data[k / 3];
    if (std::isfinite(field.data[i])) continue;
    throw InputError({file}, fmt::format("the field is not finite in column {}, row {}",
                                         k / 3 % image.width, k / 3 / image.width));
  }
  return field;
}

// A hundredth of the texels' mean magnitude. The largest (a sun) would give too large a step.
double natural_step_of(const TexelMap::Map& map) { return map.mean > 0 ? 0.01 * map.mean : 0.01; }

class TexelArray final : public TexelMotion {
 public:
  using TexelMotion::TexelMotion;

  std::optional<Parameter> part(const Scene& scene, const Parameter& whole,
                                const std::string& rest) const override {
    if (rest.size() < 2) return std::nullopt;
    if (rest[0] == ':') {
      const std::string file = rest.substr(1);
      Parameter field = texel_field(scene, whole, read_texel_field(texels_.in(scene).map(), file));
      field.name = whole.name + rest;
      field.unit = "times the texels in FILE";
      return field;
    }
    return rest[0] == '.' ? component(scene, whole, rest.substr(1)) : std::nullopt;
  }
  std::vector<double> numbers(const Scene& scene) const override {
    const Image texels = texels_.in(scene).texels();
    return {texels.data.begin(), texels.data.end()};
  }
  void assign(Scene& scene, const std::string& name, const std::vector<double>& value,
              std::vector<std::string>*) const override {
    Image texels = texel_map(scene)->texels();
    const TexelMap::Map map = texel_map(scene)->map();
    check_numbers(scene, name, value, texels.data.size(), map.least, map.most);
    for (size_t i = 0; i < value.size(); ++i) texels.data[i] = static_cast<float>(value[i]);
    texel_map(scene)->set_texels(texels);
  }
  std::optional<Parameter> along(const Scene&, const Parameter& whole,
                                 const std::vector<double>& direction) const override {
    Image image(static_cast<int>(whole.array[1]), static_cast<int>(whole.array[0]), 3);
    for (size_t i = 0; i < direction.size(); ++i) image.data[i] = static_cast<float>(direction[i]);
    return field(whole, image);
  }
  std::string parts(const std::string& name) const override {
    return "\"" + name + ":FILE\" for a map of changes, \"" + name + ".0.0.r\" for one number";
  }
  Image texel_velocities(const Scene& scene, size_t component) const override {
    const TexelMap::Map map = texels_.in(scene).map();
    Image unit(map.width, map.height, 3);
    unit.data[component] = 1;
    return unit;
  }

  Parameter field(const Parameter& whole, const Image& field) const {
    const double step = whole.natural_step;
    double largest = 0;
    for (const float v : field.data) largest = std::max(largest, std::fabs(double{v}));
    return {whole.name + ":", "times the texels of the field", largest > 0 ? step / largest : 0.01,
            1, std::make_shared<TexelField>(texels_, field)};
  }

 private:
  static std::optional<Parameter> component(const Scene& scene, const Parameter& whole,
                                            const std::string& text) {
    std::vector<std::string_view> words = split(text, ".");
    if (words.size() == 2 && whole.array[0] == 1) words.insert(words.begin(), "0");
    if (words.size() != 3 || words[2].size() != 1) return std::nullopt;
    const std::optional<int64_t> row = parse_integer(words[0]), column = parse_integer(words[1]);
    const size_t channel = std::string_view("rgb").find(words[2][0]);
    if (!row || !column || channel > 2) return std::nullopt;
    const auto height = static_cast<int64_t>(whole.array[0]);
    const auto width = static_cast<int64_t>(whole.array[1]);
    if (*row < 0 || *row >= height || *column < 0 || *column >= width) {
      throw InputError({scene.file},
                       fmt::format("parameter \"{}.{}\": the map has rows 0 to {} and columns 0 "
                                   "to {}",
                                   whole.name, text, height - 1, width - 1));
    }
    const auto index = static_cast<size_t>(*row * width + *column) * 3 + channel;
    return Parameter{whole.name + "." + text, whole.unit, whole.natural_step, 1,
                     one_component(whole.motion, index)};
  }
};

void add_map(const Scene& scene, const Texels& texels, std::vector<Parameter>& list) {
  const TexelMap::Map map = texels.in(scene).map();
  if (map.width == 0) return;
  const auto height = static_cast<size_t>(map.height), width = static_cast<size_t>(map.width);
  list.push_back({texels.name, "", natural_step_of(map), 3 * height * width,
                  std::make_shared<TexelArray>(texels)});
  list.back().array = {height, width, 3};
  list.back().least = map.least;
  list.back().most = map.most;
}

// Attributes of its mesh, and the texture of the light that it emits.
void add_texels_of_shape(const Scene& scene, size_t s, std::vector<Parameter>& list) {
  const Shape& shape = scene.shapes[s];
  for (size_t k = 0; k < shape.mesh.attributes.size() && !shape.id.empty(); ++k) {
    const auto find = [s, k](Scene& copy) -> TexelMap* {
      return copy.shapes[s].mesh.attributes[k].get();
    };
    add_map(scene, {find, shape.id + "." + shape.mesh.attributes[k]->name()}, list);
  }
  if (shape.emitter_id.empty() || !shape.radiance_texture) return;
  const auto find = [s](Scene& copy) -> TexelMap* { return copy.shapes[s].radiance_texture.get(); };
  add_map(scene, {find, shape.emitter_id + ".radiance.data"}, list);
}

}  // namespace

Parameter texel_field(const Scene& scene, const Parameter& texels, const Image& field) {
  const TexelMap::Map map = texels.texel_map(scene)->map();
  CHECK_EQ(field.data.size(), 3 * static_cast<size_t>(map.width) * map.height);
  return dynamic_cast<const TexelArray&>(*texels.motion).field(texels, field);
}

void add_texel_parameters(const Scene& scene, std::vector<Parameter>& list) {
  for (size_t s = 0; s < scene.shapes.size(); ++s) add_texels_of_shape(scene, s, list);
  for (const auto& [id, bsdf] : scene.bsdfs_by_id) {
    for (int k = 0; k < bsdf->texture_count(); ++k) {
      const auto find = [id = id, k](Scene& copy) -> TexelMap* {
        return &copy.bsdfs_by_id.at(id)->texture(k);
      };
      add_map(scene, {find, id + "." + bsdf->texture_name(k) + ".data"}, list);
    }
  }
  for (size_t i = 0; i < scene.delta_lights.size(); ++i) {
    const DeltaLight& light = *scene.delta_lights[i];
    if (light.id.empty() || !light.texture()) continue;
    const auto find = [i](Scene& copy) -> TexelMap* { return copy.delta_lights[i]->texture(); };
    add_map(scene, {find, light.id + "." + light.texture_name() + ".data"}, list);
  }
  if (!scene.environment || scene.environment_id.empty()) return;
  const auto find = [](Scene& copy) -> TexelMap* { return copy.environment.get(); };
  add_map(scene, {find, scene.environment_id + ".data"}, list);
}

}  // namespace limn
