// The light sources at infinity.
#include "limn/core/environment.h"

#include <fmt/format.h>

#include "limn/core/properties.h"
#include "src/light/environment_map.h"

namespace limn {
namespace {

class ConstantEnvironment final : public Environment {
 public:
  explicit ConstantEnvironment(const Rgb<double>& radiance)
      : radiance_{radiance.r, radiance.g, radiance.b} {}

  Rgb<double> radiance(const Vec3<double>&) const override { return value(radiance_); }
  Rgb<Dual> radiance(const Vec3<Dual>&) const override { return radiance_; }
  Vec3d sample(double u1, double u2) const override {
    const double z = 1 - 2 * u1;
    const double r = std::sqrt(std::max(0.0, 1 - z * z));
    return {r * std::cos(2 * kPi * u2), r * std::sin(2 * kPi * u2), z};
  }
  double pdf_solid_angle(const Vec3d&) const override { return 1 / (4 * kPi); }
  bool is_uniform() const override { return true; }
  double mean_luminance() const override { return luminance(value(radiance_)); }

  std::vector<ParameterRef> parameters() override {
    return {{"radiance", {&radiance_.r, &radiance_.g, &radiance_.b}}};
  }
  std::shared_ptr<Environment> clone() const override {
    return std::make_shared<ConstantEnvironment>(*this);
  }
  std::string describe() const override {
    return fmt::format("constant, radiance {:g} {:g} {:g}", radiance_.r.v, radiance_.g.v,
                       radiance_.b.v);
  }

 private:
  Rgb<Dual> radiance_;
};

// A map turned by the columns of a rotation. Copies share the texels, which never change.
class MapEnvironment final : public Environment {
 public:
  MapEnvironment(std::shared_ptr<const EnvironmentMap> map, const Vec3d axes[3], double scale,
                 std::string file)
      : map_(std::move(map)),
        axes_{axes[0], axes[1], axes[2]},
        scale_(scale),
        file_(std::move(file)) {}

  Rgb<double> radiance(const Vec3<double>& d) const override {
    return map_->radiance(map_from_world(d)) * scale_.v;
  }
  Rgb<Dual> radiance(const Vec3<Dual>& d) const override {
    return map_->radiance(map_from_world(d)) * scale_;
  }
  Vec3d sample(double u1, double u2) const override {
    const Vec3d v = map_->sample(u1, u2);
    return axes_[0] * v.x + axes_[1] * v.y + axes_[2] * v.z;
  }
  double pdf_solid_angle(const Vec3d& d) const override {
    return map_->pdf_solid_angle(map_from_world(d));
  }
  bool is_uniform() const override { return false; }
  double mean_luminance() const override { return map_->mean_luminance() * scale_.v; }

  std::vector<ParameterRef> parameters() override { return {{"scale", {&scale_}}}; }
  std::shared_ptr<Environment> clone() const override {
    return std::make_shared<MapEnvironment>(*this);
  }
  std::string describe() const override {
    return fmt::format("envmap, {} ({} x {}), scale {:g}", file_, map_->width(), map_->height(),
                       scale_.v);
  }

 private:
  template <class S>
  Vec3<S> map_from_world(const Vec3<S>& d) const {
    return {dot(d, axes_[0]), dot(d, axes_[1]), dot(d, axes_[2])};
  }

  std::shared_ptr<const EnvironmentMap> map_;
  Vec3d axes_[3];  // of the map, in the world
  Dual scale_;
  std::string file_;
};

std::shared_ptr<Environment> read_constant(Properties& properties) {
  const Rgb<double> radiance = properties.rgb("radiance", grey(1.0));
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(radiance[i])) properties.fail("radiance", "must be finite");
  }
  return make_constant_environment(radiance);
}

// Directions only: a rotation, or a reflection, perhaps with one factor for all axes.
void read_axes(Properties& properties, Vec3d axes[3]) {
  const Matrix4 m = properties.transform("to_world");
  for (int c = 0; c < 3; ++c) axes[c] = {m.m[0][c], m.m[1][c], m.m[2][c]};
  const double size2 = length_squared(axes[0]);
  constexpr double kDigits = 1e-4;  // of matrices written out by hand
  for (int c = 0; c < 3; ++c) {
    const double across = dot(axes[c], axes[(c + 1) % 3]);
    if (!(std::fabs(across) <= kDigits * size2 &&
          std::fabs(length_squared(axes[c]) - size2) <= kDigits * size2 && size2 > 0)) {
      properties.fail("to_world", "an envmap can be rotated, not sheared or scaled unevenly");
    }
  }
  axes[0] = normalize(axes[0]);
  axes[1] = normalize(axes[1] - axes[0] * dot(axes[0], axes[1]));
  const Vec3d third = cross(axes[0], axes[1]);
  axes[2] = dot(third, axes[2]) > 0 ? third : -third;
}

void check_finite(const Image& image, const std::string& file) {
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      for (int c = 0; c < image.channels; ++c) {
        if (std::isfinite(image.at(x, y, c))) continue;
        throw InputError(SourceLocation{file},
                         fmt::format("the environment map's pixel (column {}, row {}) is not "
                                     "finite",
                                     x, y));
      }
    }
  }
}

std::shared_ptr<Environment> read_envmap(Properties& properties) {
  const std::string file = properties.file("filename");
  const double scale = properties.number("scale", 1);
  if (!std::isfinite(scale)) properties.fail("scale", "must be finite");
  Vec3d axes[3];
  read_axes(properties, axes);
  if (properties.boolean("mis_compensation", false)) {
    properties.fail("mis_compensation", "is not supported (it changes the noise alone)");
  }
  const Image image = read_exr(file);
  check_finite(image, file);
  return std::make_shared<MapEnvironment>(std::make_shared<EnvironmentMap>(image), axes, scale,
                                          file);
}

}  // namespace

std::shared_ptr<Environment> make_constant_environment(const Rgb<double>& radiance) {
  return std::make_shared<ConstantEnvironment>(radiance);
}

std::shared_ptr<Environment> make_environment(Properties& properties) {
  if (properties.type() == "constant") return read_constant(properties);
  if (properties.type() == "envmap") return read_envmap(properties);
  throw InputError(properties.where(), "unknown environment emitter type \"" + properties.type() +
                                           "\" (known: constant, envmap)");
}

}  // namespace limn
