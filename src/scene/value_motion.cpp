// Parameters of BSDFs and emitters: values to which the step is added, and where delta lights are.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "limn/core/framed_light.h"
#include "src/scene/motion.h"

namespace limn {

namespace {

// Accesses the values in any copy of the scene: one number, or three channels that change together.
using Values = std::function<ParameterRef(Scene&)>;

class ValueMotion final : public Motion {
 public:
  // weights: how far each value goes in a step; none: as far as the step.
  explicit ValueMotion(Values values, const Moved& moved = {}, std::vector<double> weights = {})
      : values_(std::move(values)), moved_(moved), weights_(std::move(weights)) {}
  Moved moved() const override { return moved_; }
  void seed(Scene& scene, int lane, size_t) const override {
    const ParameterRef here = values_(scene);
    for (size_t k = 0; k < here.values.size(); ++k) here.values[k]->d[lane] += weight(k);
  }
  void move(Scene& scene, double step, size_t) const override {
    const ParameterRef here = values_(scene);
    for (size_t k = 0; k < here.values.size(); ++k) here.values[k]->v += weight(k) * step;
    if (here.changed) here.changed();
  }
  std::vector<double> numbers(const Scene& scene) const override {
    std::vector<double> all;
    // Read only: a const variant of ParameterRef would be a second type.
    for (const Dual* v : values_(const_cast<Scene&>(scene)).values) all.push_back(v->v);
    return all;
  }
  void assign(Scene& scene, const std::string& name, const std::vector<double>& value,
              std::vector<std::string>*) const override {
    const ParameterRef here = values_(scene);
    std::vector<double> numbers = value;
    if (numbers.size() == 1) numbers.resize(here.values.size(), numbers[0]);
    check_numbers(scene, name, numbers, here.values.size(), here.least, here.most);
    for (size_t k = 0; k < numbers.size(); ++k) here.values[k]->v = numbers[k];
    if (here.changed) here.changed();
  }
  std::optional<Parameter> part(const Scene&, const Parameter& whole,
                                const std::string& rest) const override {
    const size_t channel = std::string("rgb").find(rest.substr(std::min<size_t>(1, rest.size())));
    if (!whole.colour || rest.size() != 2 || rest[0] != '.' || channel == std::string::npos) {
      return std::nullopt;
    }
    Parameter one = whole;
    one.name += rest;
    one.colour = false;
    one.motion = std::make_shared<ValueMotion>([values = values_, channel](Scene& scene) {
      ParameterRef ref = values(scene);
      ref.values = {ref.values[channel]};
      return ref;
    });
    return one;
  }
  std::optional<Parameter> along(const Scene&, const Parameter& whole,
                                 const std::vector<double>& direction) const override {
    if (!whole.colour) return std::nullopt;
    Parameter one = whole;
    one.colour = false;
    one.unit = fmt::format("times ({})", fmt::join(direction, ", "));
    double largest = 0;
    for (const double v : direction) largest = std::max(largest, std::fabs(v));
    if (largest > 0) one.natural_step /= largest;
    one.motion = std::make_shared<ValueMotion>(values_, moved_, direction);
    return one;
  }

 private:
  double weight(size_t k) const { return weights_.empty() ? 1 : weights_[k]; }

  Values values_;
  Moved moved_;
  std::vector<double> weights_;
};

// The natural step is a hundredth of the largest value, or 0.01 if all are 0.
Parameter value_parameter(const std::string& name, const std::vector<double>& now,
                          const Values& values, const Moved& moved = {}) {
  double largest = 0;
  for (const double v : now) largest = std::max(largest, std::fabs(v));
  Parameter parameter{name, "", 0.01 * (largest > 0 ? largest : 1), 1,
                      std::make_shared<ValueMotion>(values, moved)};
  parameter.colour = now.size() == 3;
  return parameter;
}

// size: of the scene; used for lengths only.
void set_unit(ParameterRef::Unit unit, double size, Parameter& parameter) {
  if (unit == ParameterRef::Unit::kValue) return;
  const bool length = unit == ParameterRef::Unit::kLength;
  parameter.unit = length ? "scene units" : "radians";
  parameter.natural_step = length ? 0.01 * size : 0.01;
}

// Light comes from another place, or from another direction at all points alike, or ends elsewhere.
Moved moved_by(ParameterRef::Unit unit, const DeltaLight& light) {
  const bool framed = dynamic_cast<const FramedLight*>(&light) != nullptr;
  const bool turns = unit == ParameterRef::Unit::kRadians;
  return {.delta_lights = unit == ParameterRef::Unit::kLength ||
                          (turns && (framed || light.origin().infinite))};
}

// Adds the named values of an object. owner: finds the object in a copy of the scene; light: what
// it is, if that is a delta light.
template <class Owner>
void add_values(const std::string& id, const std::vector<ParameterRef>& values, const Owner& owner,
                std::vector<Parameter>& list, const DeltaLight* light = nullptr, double size = 0) {
  for (size_t k = 0; k < values.size(); ++k) {
    std::vector<double> now;
    for (const Dual* v : values[k].values) now.push_back(v->v);
    Parameter p = value_parameter(
        id + "." + values[k].name, now,
        [owner, k](Scene& scene) { return owner(scene)->parameters()[k]; },
        light ? moved_by(values[k].unit, *light) : Moved{});
    set_unit(values[k].unit, size, p);
    p.least = values[k].least;
    p.most = values[k].most;
    list.push_back(p);
  }
}

}  // namespace

void add_bsdf_parameters(const Scene& scene, std::vector<Parameter>& list) {
  for (const auto& entry : scene.bsdfs_by_id) {
    const std::string& id = entry.first;
    const auto owner = [id](Scene& copy) { return copy.bsdfs_by_id.at(id); };
    add_values(id, entry.second->parameters(), owner, list);
  }
}

void add_emitter_parameters(const Scene& scene, std::vector<Parameter>& list) {
  for (size_t i = 0; i < scene.shapes.size(); ++i) {
    const Shape& shape = scene.shapes[i];
    if (shape.emitter_id.empty() || shape.radiance_texture) continue;
    const Rgb<double> c = value(shape.radiance);
    list.push_back(
        value_parameter(shape.emitter_id + ".radiance", {c.r, c.g, c.b}, [i](Scene& copy) {
          Rgb<Dual>& radiance = copy.shapes[i].radiance;
          return ParameterRef{
              "radiance", {&radiance.r, &radiance.g, &radiance.b}, ParameterRef::Unit::kValue, 0};
        }));
    list.back().least = 0;
  }
  if (scene.environment && !scene.environment_id.empty()) {
    const auto owner = [](Scene& copy) { return copy.environment; };
    add_values(scene.environment_id, scene.environment->parameters(), owner, list);
  }
  for (size_t i = 0; i < scene.delta_lights.size(); ++i) {
    DeltaLight& light = *scene.delta_lights[i];
    if (light.id.empty()) continue;
    const auto owner = [i](Scene& copy) { return copy.delta_lights[i]; };
    std::vector<ParameterRef> values = light.parameters();
    // Of what moves the borders of texels only the power, which comes first, is left.
    if (light.texture() && light.texture()->discontinuous_between_texels()) values.resize(1);
    add_values(light.id, values, owner, list, &light, scene_size(scene));
  }
}

}  // namespace limn
