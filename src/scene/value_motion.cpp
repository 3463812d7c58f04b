// Values of BSDFs and emitters: numbers that grow by the step.
#include <algorithm>
#include <cmath>
#include <functional>

#include "src/scene/motion.h"
#include "src/scene/motion_lists.h"

namespace limn {

namespace {

// The values in any copy of the scene: one number, or three channels that grow together (grey).
using Values = std::function<std::vector<Dual*>(Scene&)>;

class ValueMotion final : public Motion {
 public:
  explicit ValueMotion(Values values) : values_(std::move(values)) {}
  void seed(Scene& scene, int lane, size_t) const override {
    for (Dual* v : values_(scene)) v->d[lane] += 1;
  }
  void move(Scene& scene, double step, size_t) const override {
    for (Dual* v : values_(scene)) v->v += step;
  }

 private:
  Values values_;
};

// A step of a hundredth of the largest value, or 0.01 where all are 0.
Parameter value_parameter(const std::string& name, const std::vector<double>& now,
                          const Values& values) {
  double largest = 0;
  for (const double v : now) largest = std::max(largest, std::fabs(v));
  return {name, "", 0.01 * (largest > 0 ? largest : 1), 1, std::make_shared<ValueMotion>(values)};
}

// The values of an object that has them under names. owner: finds that object in a copy.
template <class Owner>
void add_values(const std::string& id, const std::vector<ParameterRef>& values, const Owner& owner,
                std::vector<Parameter>& list) {
  for (size_t k = 0; k < values.size(); ++k) {
    std::vector<double> now;
    for (const Dual* v : values[k].values) now.push_back(v->v);
    list.push_back(value_parameter(id + "." + values[k].name, now, [owner, k](Scene& scene) {
      return owner(scene)->parameters()[k].values;
    }));
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
    if (shape.emitter_id.empty()) continue;
    const Rgb<double> c = value(shape.radiance);
    list.push_back(
        value_parameter(shape.emitter_id + ".radiance", {c.r, c.g, c.b}, [i](Scene& copy) {
          Rgb<Dual>& radiance = copy.shapes[i].radiance;
          return std::vector<Dual*>{&radiance.r, &radiance.g, &radiance.b};
        }));
  }
  if (scene.environment && !scene.environment_id.empty()) {
    const auto owner = [](Scene& copy) { return copy.environment; };
    add_values(scene.environment_id, scene.environment->parameters(), owner, list);
  }
}

}  // namespace limn
