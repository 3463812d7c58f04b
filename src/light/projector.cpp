// Projectors: a frame of light from a point. As in Mitsuba, the irradiance of a plane at distance z
// before it is pi / z^2 times `irradiance` on the axis. A texture fills the frame, with u from +X
// to -X and v from +Y to -Y.
#include <fmt/format.h>

#include "limn/core/framed_light.h"
#include "limn/core/names.h"
#include "src/light/types.h"

namespace limn {
namespace {

// The frame's axes, as those of a camera: +Z along the light, +X to the left, +Y up.
struct Axes {
  Vec3d left, up, forward;  // orthonormal
};

// Tangents of half the field of view.
struct HalfFrame {
  double x, y;
};

class Projector final : public FramedLight {
 public:
  // texture: null, or it multiplies the irradiance.
  Projector(const Vec3d& position, const Axes& axes, const Rgb<Dual>& irradiance,
            std::shared_ptr<Texture> texture, const HalfFrame& half)
      : position_{position.x, position.y, position.z},
        axes_(axes),
        irradiance_(irradiance),
        texture_(std::move(texture)),
        half_(half) {}

  std::optional<Arrival<double>> arriving(const Vec3<double>& p) const override { return at(p); }
  std::optional<Arrival<Dual>> arriving(const Vec3<Dual>& p) const override { return at(p); }
  LightOrigin origin() const override { return {position_}; }
  std::array<Vec3<Dual>, 4> corners() const override {
    std::array<Vec3<Dual>, 4> corners;
    const double sides[4][2] = {{1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
    for (int k = 0; k < 4; ++k) {
      const Vec3d &a = axes_.left, &b = axes_.up;
      corners[k] = turned<Dual>(
          axes_.forward + a * (sides[k][0] * half_.x) + b * (sides[k][1] * half_.y), turn_);
    }
    return corners;
  }
  // At a corner of the frame.
  double power() const override {
    const double corner = 1 + half_.x * half_.x + half_.y * half_.y;
    return luminance(value(irradiance_)) * kPi * std::pow(corner, 1.5) *
           (texture_ ? texture_->range().most : 1);
  }
  Texture* texture() const override { return texture_.get(); }
  std::string texture_name() const override { return "irradiance"; }
  TexelMap::TexelWeights texel_weights(const Vec3d& p) const override {
    const auto seen = find<double>(p);
    if (!seen) return {};
    return bitmap_weights(*texture_, seen->uv, irradiance_.r.v * seen->factor);
  }

  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list{power_parameter(texture_ ? "scale" : "irradiance", irradiance_)};
    append_vector_parameters("translate", position_, ParameterRef::Unit::kLength, list);
    append_vector_parameters("rotate", turn_, ParameterRef::Unit::kRadians, list);
    return list;
  }
  std::shared_ptr<DeltaLight> clone() const override {
    const auto copy = std::make_shared<Projector>(*this);
    if (texture_) copy->texture_ = texture_->clone();
    return copy;
  }
  std::string describe() const override {
    const Vec3d& axis = axes_.forward;
    return fmt::format(
        "projector at ({:.6g}, {:.6g}, {:.6g}) along ({:.6g}, {:.6g}, {:.6g}), fov {:.6g} degrees, "
        "irradiance {:g} {:g} {:g}{}",
        position_.x.v, position_.y.v, position_.z.v, axis.x, axis.y, axis.z,
        std::atan(half_.x) * 360 / kPi, irradiance_.r.v, irradiance_.g.v, irradiance_.b.v,
        texture_ ? " times " + texture_->describe() : "");
  }

 private:
  // A point in the frame.
  template <class S>
  struct Seen {
    Vec3<S> wo;           // unit, towards the light
    S factor;             // of the irradiance
    std::array<S, 2> uv;  // of the texture
  };
  template <class S>
  std::optional<Seen<S>> find(const Vec3<S>& p) const {
    using std::sqrt;
    const Vec3<S> from = p - as<S>(position_);
    const S z = dot(from, turned<S>(axes_.forward, turn_));
    if (!(value(z) > 0)) return {};
    const S x = dot(from, turned<S>(axes_.left, turn_)), y = dot(from, turned<S>(axes_.up, turn_));
    if (!(std::fabs(value(x)) <= half_.x * value(z))) return {};
    if (!(std::fabs(value(y)) <= half_.y * value(z))) return {};
    const S distance = sqrt(length_squared(from));
    return Seen<S>{-from / distance,
                   kPi * distance / (z * z * z),
                   {0.5 - x / (z * (2 * half_.x)), 0.5 - y / (z * (2 * half_.y))}};
  }
  template <class S>
  std::optional<Arrival<S>> at(const Vec3<S>& p) const {
    const auto seen = find(p);
    if (!seen) return {};
    const Rgb<S> irradiance = as<S>(irradiance_) * seen->factor;
    if (!texture_) return Arrival<S>{seen->wo, irradiance};
    return Arrival<S>{
        seen->wo, irradiance * texture_->eval(TexturePoint<S>{nullptr, FaceId(0), {}, seen->uv})};
  }

  Vec3<Dual> position_;
  Axes axes_;
  Vec3<Dual> turn_{};  // of the axes, see turned()
  Rgb<Dual> irradiance_;
  std::shared_ptr<Texture> texture_;
  HalfFrame half_;
};

// Tangents of half the field of view. aspect: width over height of the frame.
HalfFrame read_half_frame(Properties& p, double aspect) {
  std::string axis = lower_case(p.string("fov_axis", "x"));
  static const std::vector<std::string> kAxes = {"diagonal", "larger", "smaller", "x", "y"};
  if (std::find(kAxes.begin(), kAxes.end(), axis) == kAxes.end()) {
    p.fail("fov_axis", unknown_name("axis", axis, kAxes));
  }
  // Without fov that of a lens of 50 mm before a film of 36 by 24 mm, along its diagonal, as
  // Mitsuba has it.
  if (!p.has("fov")) axis = "diagonal";
  const double of_lens = 2 * std::atan(std::hypot(36.0, 24.0) / 100) * (180 / kPi);
  const double fov = p.number("fov", of_lens);
  if (!(fov > 0 && fov < 180)) p.fail("fov", "must lie between 0 and 180 degrees");
  double x = std::tan(fov * (kPi / 360));
  if (axis == "diagonal") x *= aspect / std::hypot(1, aspect);
  if (axis == "y" || (axis == "smaller" && aspect > 1) || (axis == "larger" && aspect < 1)) {
    x *= aspect;
  }
  return {x, x / aspect};
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
  std::shared_ptr<Texture> texture = read_light_bitmap(properties, "irradiance");
  double aspect = 1;
  if (texture) aspect = static_cast<double>(texture->map().width) / texture->map().height;
  Rgb<Dual> irradiance{1, 1, 1};
  if (!texture) irradiance = read_power(properties, "irradiance");
  for (int c = 0; c < 3; ++c) irradiance[c] = irradiance[c] * scale;
  scene.delta_lights.push_back(
      std::make_shared<Projector>(to_world.point({}), Axes{axes[0], axes[1], axes[2]}, irradiance,
                                  std::move(texture), read_half_frame(properties, aspect)));
  scene.delta_lights.back()->id = properties.id();
  scene.delta_lights.back()->to_world = to_world;
}

}  // namespace limn
