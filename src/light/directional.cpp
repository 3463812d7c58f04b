// Directional lights: parallel light from infinity.
#include <fmt/format.h>

#include "src/light/types.h"

namespace limn {
namespace {

class DirectionalLight final : public DeltaLight {
 public:
  // direction: unit, of light transport.
  DirectionalLight(const Vec3d& direction, const Rgb<Dual>& irradiance)
      : direction_(direction), irradiance_(irradiance) {}

  std::optional<Arrival<double>> arriving(const Vec3<double>&) const override {
    return Arrival<double>{-turned<double>(direction_, turn_), value(irradiance_)};
  }
  std::optional<Arrival<Dual>> arriving(const Vec3<Dual>&) const override {
    return Arrival<Dual>{-turned<Dual>(direction_, turn_), irradiance_};
  }
  LightOrigin origin() const override { return {turned<Dual>(direction_, turn_), true}; }
  double power() const override { return luminance(value(irradiance_)); }

  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list{power_parameter("irradiance", irradiance_)};
    append_vector_parameters("rotate", turn_, ParameterRef::Unit::kRadians, list);
    return list;
  }
  std::shared_ptr<DeltaLight> clone() const override {
    return std::make_shared<DirectionalLight>(*this);
  }
  std::string describe() const override {
    return fmt::format("directional along ({:.6g}, {:.6g}, {:.6g}), irradiance {:g} {:g} {:g}",
                       direction_.x, direction_.y, direction_.z, irradiance_.r.v, irradiance_.g.v,
                       irradiance_.b.v);
  }

 private:
  Vec3d direction_;
  Vec3<Dual> turn_{};     // of the direction, see turned()
  Rgb<Dual> irradiance_;  // [W / m^2], perpendicular to the direction
};

}  // namespace

void read_directional(Properties& properties, Scene& scene, Shape*) {
  if (properties.has("direction") && properties.has("to_world")) {
    properties.fail("to_world", "a direction is given by direction or by to_world, not by both");
  }
  const Vec3d z = properties.transform("to_world").vector({0, 0, 1});
  const Vec3d direction = properties.point("direction", z);
  const double size = length(direction);
  if (!(size > 0) || !std::isfinite(size)) {
    properties.fail(properties.has("direction") ? "direction" : "to_world",
                    "the direction has no length, or no finite one");
  }
  scene.delta_lights.push_back(
      std::make_shared<DirectionalLight>(direction / size, read_power(properties, "irradiance")));
  scene.delta_lights.back()->id = properties.id();
  Matrix4& to_world = scene.delta_lights.back()->to_world;
  to_world = properties.transform("to_world");
  if (!properties.has("direction")) return;
  const Frame frame(direction / size);
  for (int k = 0; k < 3; ++k) {
    to_world.m[k][0] = frame.s[k];
    to_world.m[k][1] = frame.t[k];
    to_world.m[k][2] = frame.n[k];
  }
}

}  // namespace limn
