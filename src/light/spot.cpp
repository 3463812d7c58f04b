// Spot lights: a cone of light along the local +Z axis.
#include <fmt/format.h>

#include "src/light/types.h"

namespace limn {
namespace {

// Differentiable angles in degrees, as in the file.
struct Cone {
  Dual cutoff;  // half-angle beyond which the light is black
  Dual beam;    // half-angle of full intensity; linear falloff up to the cutoff
};

// The square of this texture that touches the cone multiplies the intensity, with u along the local
// +X axis and v along +Y.
struct SpotTexture {
  std::shared_ptr<Texture> bitmap;  // null if there is none
  Vec3d x, y;                       // unit
};

class SpotLight final : public DeltaLight {
 public:
  SpotLight(const Vec3d& position, const Vec3d& axis, const Rgb<Dual>& intensity, const Cone& cone,
            SpotTexture texture)
      : position_{position.x, position.y, position.z},
        axis_(axis),
        intensity_(intensity),
        cone_(cone),
        texture_(std::move(texture)) {}

  std::optional<Arrival<double>> arriving(const Vec3<double>& p) const override { return at(p); }
  std::optional<Arrival<Dual>> arriving(const Vec3<Dual>& p) const override { return at(p); }
  LightOrigin origin() const override { return {position_}; }
  double power() const override {
    return luminance(value(intensity_)) * (texture_.bitmap ? texture_.bitmap->range().most : 1);
  }
  Texture* texture() const override { return texture_.bitmap.get(); }
  std::string texture_name() const override { return "texture"; }
  TexelMap::TexelWeights texel_weights(const Vec3d& p) const override {
    const auto arrival = untextured(p);
    if (!arrival) return {};
    return bitmap_weights(*texture_.bitmap, coordinates(arrival->wo), arrival->irradiance.r);
  }

  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list{power_parameter("intensity", intensity_),
                                   cone_parameter("cutoff_angle", cone_.cutoff),
                                   cone_parameter("beam_width", cone_.beam)};
    // The beam must stay narrower than the cutoff.
    list[1].least = std::nextafter(cone_.beam.v, 180);
    list[2].most = std::nextafter(cone_.cutoff.v, 0);
    append_vector_parameters("translate", position_, ParameterRef::Unit::kLength, list);
    append_vector_parameters("rotate", turn_, ParameterRef::Unit::kRadians, list);
    return list;
  }
  std::shared_ptr<DeltaLight> clone() const override {
    const auto copy = std::make_shared<SpotLight>(*this);
    if (texture_.bitmap) copy->texture_.bitmap = texture_.bitmap->clone();
    return copy;
  }
  std::string describe() const override {
    return fmt::format(
        "spot at ({:.6g}, {:.6g}, {:.6g}) along ({:.6g}, {:.6g}, {:.6g}), cutoff {:.6g} degrees, "
        "beam {:.6g} degrees, intensity {:g} {:g} {:g}{}",
        position_.x.v, position_.y.v, position_.z.v, axis_.x, axis_.y, axis_.z, cone_.cutoff.v,
        cone_.beam.v, intensity_.r.v, intensity_.g.v, intensity_.b.v,
        texture_.bitmap ? " times " + texture_.bitmap->describe() : "");
  }

 private:
  template <class S>
  std::optional<Arrival<S>> at(const Vec3<S>& p) const {
    std::optional<Arrival<S>> arrival = untextured(p);
    if (!arrival || !texture_.bitmap) return arrival;
    const TexturePoint<S> point{nullptr, FaceId(0), {}, coordinates(arrival->wo)};
    arrival->irradiance = arrival->irradiance * texture_.bitmap->eval(point);
    return arrival;
  }
  // Of the texture, in the direction -wo.
  template <class S>
  std::array<S, 2> coordinates(const Vec3<S>& wo) const {
    const S z = dot(wo, turned<S>(axis_, turn_)) * (2.0 * tan_of(as<S>(cone_.cutoff)));
    return {0.5 + dot(wo, turned<S>(texture_.x, turn_)) / z,
            0.5 + dot(wo, turned<S>(texture_.y, turn_)) / z};
  }
  template <class S>
  static S tan_of(const S& degrees) {
    using std::cos;
    using std::sin;
    const S a = degrees * (kPi / 180);
    return sin(a) / cos(a);
  }
  template <class S>
  std::optional<Arrival<S>> untextured(const Vec3<S>& p) const {
    std::optional<Arrival<S>> arrival = arrival_from(as<S>(position_), as<S>(intensity_), p);
    if (!arrival) return {};
    const S c = -dot(arrival->wo, turned<S>(axis_, turn_));
    const S degrees = angle(c) * (180 / kPi);
    if (!(value(degrees) < cone_.cutoff.v)) return {};
    if (value(degrees) <= cone_.beam.v) return arrival;
    const S width = as<S>(cone_.cutoff) - as<S>(cone_.beam);
    arrival->irradiance = arrival->irradiance * ((as<S>(cone_.cutoff) - degrees) / width);
    return arrival;
  }
  static ParameterRef cone_parameter(const char* name, Dual& degrees) {
    return {name, {&degrees}, ParameterRef::Unit::kValue, 0, 180};
  }
  static double angle(double c) { return std::acos(std::clamp(c, -1.0, 1.0)); }
  static Dual angle(const Dual& c) { return acos(Dual(std::clamp(c.v, -1.0, 1.0), c.d)); }

  Vec3<Dual> position_;
  Vec3d axis_;           // unit
  Vec3<Dual> turn_{};    // of the axis, see turned()
  Rgb<Dual> intensity_;  // [W/sr], on the axis
  Cone cone_;
  SpotTexture texture_;
};

}  // namespace

void read_spot(Properties& properties, Scene& scene, Shape*) {
  const double cutoff = properties.number("cutoff_angle", 20);
  if (!(cutoff > 0 && cutoff <= 180)) {
    properties.fail("cutoff_angle", "must lie in (0, 180] degrees");
  }
  const double beam = properties.number("beam_width", 0.75 * cutoff);
  if (!(beam >= 0 && beam < cutoff)) {
    properties.fail("beam_width",
                    "must be at least 0 and less than cutoff_angle: derivatives have no term for "
                    "a cone with a sharp boundary");
  }
  Vec3d axes[3];
  read_axes(properties, "a spot", axes);
  const Vec3d position = properties.transform("to_world").point({});
  SpotTexture texture{read_light_bitmap(properties, "texture"), axes[0], axes[1]};
  if (!texture.bitmap && properties.has("texture")) properties.fail("texture", "must be a bitmap");
  if (texture.bitmap && cutoff >= 90) {
    properties.fail("texture", "needs a cutoff_angle below 90 degrees");
  }
  scene.delta_lights.push_back(std::make_shared<SpotLight>(position, axes[2],
                                                           read_power(properties, "intensity"),
                                                           Cone{cutoff, beam}, std::move(texture)));
  scene.delta_lights.back()->id = properties.id();
  scene.delta_lights.back()->to_world = properties.transform("to_world");
}

}  // namespace limn
