// Point lights: the same intensity in all directions.
#include <fmt/format.h>

#include "src/light/types.h"

namespace limn {
namespace {

class PointLight final : public DeltaLight {
 public:
  PointLight(const Vec3d& position, const Rgb<Dual>& intensity)
      : position_{position.x, position.y, position.z}, intensity_(intensity) {}

  std::optional<Arrival<double>> arriving(const Vec3<double>& p) const override { return at(p); }
  std::optional<Arrival<Dual>> arriving(const Vec3<Dual>& p) const override { return at(p); }
  LightOrigin origin() const override { return {position_}; }
  double power() const override { return luminance(value(intensity_)); }

  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list{power_parameter("intensity", intensity_)};
    append_vector_parameters("translate", position_, ParameterRef::Unit::kLength, list);
    return list;
  }
  std::shared_ptr<DeltaLight> clone() const override { return std::make_shared<PointLight>(*this); }
  std::string describe() const override {
    return fmt::format("point at ({:.6g}, {:.6g}, {:.6g}), intensity {:g} {:g} {:g}", position_.x.v,
                       position_.y.v, position_.z.v, intensity_.r.v, intensity_.g.v,
                       intensity_.b.v);
  }

 private:
  template <class S>
  std::optional<Arrival<S>> at(const Vec3<S>& p) const {
    return arrival_from(as<S>(position_), as<S>(intensity_), p);
  }

  Vec3<Dual> position_;
  Rgb<Dual> intensity_;  // [W/sr]
};

}  // namespace

void read_point(Properties& properties, Scene& scene, Shape*) {
  if (properties.has("position") && properties.has("to_world")) {
    properties.fail("to_world", "a point is placed by position or by to_world, not by both");
  }
  const Vec3d origin = properties.transform("to_world").point({});
  const Vec3d position = properties.point("position", origin);
  scene.delta_lights.push_back(
      std::make_shared<PointLight>(position, read_power(properties, "intensity")));
  scene.delta_lights.back()->id = properties.id();
  Matrix4& to_world = scene.delta_lights.back()->to_world;
  to_world = properties.transform("to_world");
  if (properties.has("position"))
    for (int k = 0; k < 3; ++k) to_world.m[k][3] = position[k];
}

}  // namespace limn
