// Projectors: a frame of light from a point. As in Mitsuba, the irradiance of a plane at distance z
// before it is pi / z^2 times `irradiance` on the axis.
#include <fmt/format.h>

#include <limits>

#include "limn/core/names.h"
#include "src/light/types.h"

namespace limn {
namespace {

// The frame's axes, as those of a camera: +Z along the light, +X to the left, +Y up.
struct Axes {
  Vec3d left, up, forward;  // orthonormal
};

class Projector final : public DeltaLight {
 public:
  // half: the tangent of half the field of view, in either direction.
  Projector(const Vec3d& position, const Axes& axes, const Rgb<Dual>& irradiance, double half)
      : position_{position.x, position.y, position.z},
        axes_(axes),
        irradiance_(irradiance),
        half_(half) {}

  std::optional<Arrival<double>> arriving(const Vec3<double>& p) const override { return at(p); }
  std::optional<Arrival<Dual>> arriving(const Vec3<Dual>& p) const override { return at(p); }
  LightOrigin origin() const override { return {position_}; }
  // At a corner of the frame.
  double power() const override {
    return luminance(value(irradiance_)) * kPi * std::pow(1 + 2 * half_ * half_, 1.5);
  }

  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list{power_parameter("irradiance", irradiance_)};
    append_vector_parameters("translate", position_, ParameterRef::Unit::kLength, list);
    append_vector_parameters("rotate", turn_, ParameterRef::Unit::kRadians, list);
    return list;
  }
  std::shared_ptr<DeltaLight> clone() const override { return std::make_shared<Projector>(*this); }
  std::string describe() const override {
    const Vec3d& axis = axes_.forward;
    return fmt::format(
        "projector at ({:.6g}, {:.6g}, {:.6g}) along ({:.6g}, {:.6g}, {:.6g}), fov {:.6g} degrees, "
        "irradiance {:g} {:g} {:g}",
        position_.x.v, position_.y.v, position_.z.v, axis.x, axis.y, axis.z,
        std::atan(half_) * 360 / kPi, irradiance_.r.v, irradiance_.g.v, irradiance_.b.v);
  }

 private:
  template <class S>
  std::optional<Arrival<S>> at(const Vec3<S>& p) const {
    using std::sqrt;
    const Vec3<S> from = p - as<S>(position_);
    const S z = dot(from, turned<S>(axes_.forward, turn_));
    if (!(value(z) > 0)) return {};
    for (const Vec3d& side : {axes_.left, axes_.up}) {
      const S across = dot(from, turned<S>(side, turn_));
      if (!(std::fabs(value(across)) <= half_ * value(z))) return {};
    }
    const S distance = sqrt(length_squared(from));
    return Arrival<S>{-from / distance, as<S>(irradiance_) * (kPi * distance / (z * z * z))};
  }

  Vec3<Dual> position_;
  Axes axes_;
  Vec3<Dual> turn_{};  // of the axes, see turned()
  Rgb<Dual> irradiance_;
  double half_;
};

// The tangent of half the field of view. The frame is square, so most axes agree.
double read_half_width(Properties& p) {
  const std::string axis = lower_case(p.string("fov_axis", "x"));
  static const std::vector<std::string> kAxes = {"diagonal", "larger", "smaller", "x", "y"};
  if (std::find(kAxes.begin(), kAxes.end(), axis) == kAxes.end()) {
    p.fail("fov_axis", unknown_name("axis", axis, kAxes));
  }
  if (!p.has("fov")) p.fail("parameter \"fov\" is missing");
  const double fov = p.number("fov", 0);
  if (!(fov > 0 && fov < 180)) p.fail("fov", "must lie between 0 and 180 degrees");
  return std::tan(fov * (kPi / 360)) * (axis == "diagonal" ? std::sqrt(0.5) : 1);
}

}  // namespace

void read_projector(Properties& properties, Scene& scene, Shape*) {
  Vec3d axes[3];
  read_axes(properties, "a projector", axes);
  const Matrix4 to_world = properties.transform("to_world");
  const double size = length(Vec3d{to_world.m[0][2], to_world.m[1][2], to_world.m[2][2]});
  if (std::fabs(size - 1) > 1e-3) {
    properties.fail("to_world", "a projector can be moved and rotated, not scaled");
  }
  const double scale = properties.number("scale", 1);
  if (!(scale >= 0)) properties.fail("scale", "must not be negative");
  Rgb<Dual> irradiance = read_power(properties, "irradiance");
  for (int c = 0; c < 3; ++c) irradiance[c] = irradiance[c] * scale;
  scene.delta_lights.push_back(
      std::make_shared<Projector>(to_world.point({}), Axes{axes[0], axes[1], axes[2]}, irradiance,
                                  read_half_width(properties)));
  scene.delta_lights.back()->id = properties.id();
}

}  // namespace limn
