// Constant environments: the same radiance from all directions.
#include <fmt/format.h>

#include "src/base/angles.h"
#include "src/light/types.h"

namespace limn {
namespace {

class ConstantEnvironment final : public Environment {
 public:
  explicit ConstantEnvironment(const Rgb<double>& radiance)
      : radiance_{radiance.r, radiance.g, radiance.b} {}

  Rgb<double> radiance(const Vec3<double>&) const override { return value(radiance_); }
  Rgb<Dual> radiance(const Vec3<Dual>&) const override { return radiance_; }
  void sample_directions(std::span<const Numbers> u, std::span<Drawn> drawn) const override {
    for (size_t i = 0; i < u.size(); ++i) {
      const double z = 1 - 2 * u[i][0];
      const double r = std::sqrt(std::max(0.0, 1 - z * z));
      const SinCos azimuth = sin_cos_of_turns(u[i][1]);
      drawn[i] = {{r * azimuth.cos, r * azimuth.sin, z}, kDensity, {}};
    }
  }
  double pdf_solid_angle(const Vec3d&) const override { return kDensity; }
  void look(const Vec3d&, const std::array<double, 2>&, Sight<double>& sight) const override {
    sight = {value(radiance_), kDensity};
  }
  void look(const Vec3d&, const std::array<double, 2>&, Sight<Dual>& sight) const override {
    sight = {radiance_, kDensity};
  }
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
  static constexpr double kDensity = 1 / (4 * kPi);

  Rgb<Dual> radiance_;
};

}  // namespace

std::shared_ptr<Environment> make_constant_environment(const Rgb<double>& radiance) {
  return std::make_shared<ConstantEnvironment>(radiance);
}

void read_constant(Properties& properties, Scene& scene, Shape*) {
  const Rgb<double> radiance = properties.rgb("radiance", grey(1.0));
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(radiance[i])) properties.fail("radiance", "must be finite");
  }
  scene.environment = make_constant_environment(radiance);
}

}  // namespace limn
