// A checkerboard: two colours in squares of half a unit of texture coordinates.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "src/texture/types.h"

namespace limn {
namespace {

class Checkerboard final : public Texture {
 public:
  Checkerboard(const Rgb<double>& color0, const Rgb<double>& color1, const UvTransform& to_uv)
      : colors_{constant(color0), constant(color1)}, to_uv_(to_uv) {}

  Rgb<double> eval(const TexturePoint<double>& point) const override { return lookup(point); }
  Rgb<Dual> eval(const TexturePoint<Dual>& point) const override { return lookup(point); }
  // Numbers have the colours the other way round, as in Mitsuba 3.9.1.
  std::shared_ptr<Texture> for_numbers() const override {
    const auto copy = std::make_shared<Checkerboard>(*this);
    copy->of_numbers_ = true;
    for (int i = 0; i < 2; ++i) {
      const double y = number_of(value(colors_[1 - i]));
      copy->colors_[i] = {y, y, y};
    }
    return copy;
  }

  Rgb<double> mean() const override {
    const Rgb<double> sum = value(colors_[0]) + value(colors_[1]);
    return (of_numbers_ ? grey(sum.r) : sum) * 0.5;
  }
  Range range() const override {
    Range range{colors_[0].r.v, colors_[0].r.v};
    for (const Rgb<Dual>& color : colors_) {
      for (int c = 0; c < (of_numbers_ ? 1 : 3); ++c) {
        range.least = std::min(range.least, color[c].v);
        range.most = std::max(range.most, color[c].v);
      }
    }
    return range;
  }
  bool add_discontinuities(const std::array<std::array<double, 2>, 3>& uv, size_t most,
                           Discontinuities& lines) const override {
    return add_grid_lines(uv, to_uv_, {2, 2}, most, lines);
  }
  bool has_period_one() const override { return to_uv_.keeps_integers(); }
  std::vector<ParameterRef> parameters() override {
    const auto ref = [this](const char* name, Rgb<Dual>& c) {
      // Colours above 1 are those of a lamp.
      const double most = range().most > 1 ? std::numeric_limits<float>::max() : 1;
      std::vector<Dual*> values{&c.r};
      if (!of_numbers_) values.insert(values.end(), {&c.g, &c.b});
      return ParameterRef{name, std::move(values), ParameterRef::Unit::kValue, 0, most};
    };
    // For numbers, the colours' places are exchanged.
    return {ref("color0", colors_[of_numbers_ ? 1 : 0]),
            ref("color1", colors_[of_numbers_ ? 0 : 1])};
  }
  std::shared_ptr<Texture> clone() const override { return std::make_shared<Checkerboard>(*this); }
  std::string describe() const override {
    const Rgb<double> a = value(colors_[0]), b = value(colors_[1]);
    return fmt::format("checkerboard of {:g} {:g} {:g} and {:g} {:g} {:g}{}", a.r, a.g, a.b, b.r,
                       b.g, b.b, to_uv_.describe());
  }

 private:
  static Rgb<Dual> constant(const Rgb<double>& c) { return {c.r, c.g, c.b}; }
  template <class S>
  Rgb<S> lookup(const TexturePoint<S>& point) const {
    const std::array<double, 2> uv = to_uv_(std::array{value(point.uv[0]), value(point.uv[1])});
    const auto second_half = [](double t) { return t - std::floor(t) > 0.5; };
    const Rgb<Dual>& color = colors_[second_half(uv[0]) == second_half(uv[1]) ? 0 : 1];
    return as<S>(of_numbers_ ? grey(color.r) : color);
  }

  Rgb<Dual> colors_[2];  // of numbers, r alone
  UvTransform to_uv_;
};

Rgb<double> read_color(Properties& properties, const char* name, double absent) {
  if (properties.texture(name)) {
    properties.fail(name, "a texture inside a checkerboard is not supported: use <rgb>");
  }
  const Rgb<double> c = properties.rgb(name, grey(absent));
  for (int i = 0; i < 3; ++i) {
    if (!(c[i] >= 0)) properties.fail(name, "a colour must not be negative");
  }
  return c;
}

}  // namespace

std::shared_ptr<Texture> read_checkerboard(Properties& properties) {
  const Rgb<double> color0 = read_color(properties, "color0", 0.4);
  const Rgb<double> color1 = read_color(properties, "color1", 0.2);
  return std::make_shared<Checkerboard>(color0, color1, read_to_uv(properties));
}

}  // namespace limn
