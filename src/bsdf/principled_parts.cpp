// Bounds and readers of the principled BSDFs.
#include "src/bsdf/principled_parts.h"

#include <fmt/format.h>

#include <algorithm>

#include "src/bsdf/types.h"

namespace limn::principled {
namespace {

class PrincipledLobe final : public LobeModel {
 public:
  constexpr PrincipledLobe(bool flat, bool coat) : flat_(flat), coat_(coat) {}
  Vec3d axis(const Vec3d& n, const Vec3d& wi) const override { return ggx_lobe().axis(n, wi); }
  double width(const LobeSummary& lobe) const override { return ggx_lobe().width(lobe); }
  std::optional<LtcRow> ltc(const LobeSummary& lobe) const override { return ggx_lobe().ltc(lobe); }
  double bound(const LobeSummary& lobe, double cos_i, double cos_o,
               double cos_axis) const override {
    double sum = ggx_lobe().bound(lobe, cos_i, cos_o, cos_axis);
    // 1.25 cos_o / (cos_o + cos_i) + 0.625 cos_o, where base_color is kFlat of `diffuse` at most.
    if (flat_) sum += lobe.diffuse / kPi * std::min(1.0, cos_o * (1 + 1 / cos_i));
    // GTR1 is (1 - a^2) / (-ln a^2) / (pi (a^2 cos^2 + sin^2)) of the half vector, which is at
    // least half as far from the normal as wo from the mirror direction; 0.001 <= a <= 0.1.
    if (coat_) {
      const double sin2 = 0.5 * std::max(0.0, 1 - cos_axis);
      sum += 0.25 * cos_o / (-std::log(0.01) * kPi * (1e-6 + (1 - 1e-6) * sin2));
    }
    return sum;
  }

 private:
  bool flat_, coat_;
};
constexpr PrincipledLobe kPlain{false, false}, kFlatLook{true, false}, kCoated{false, true},
    kBoth{true, true};

}  // namespace

const LobeModel& lobe_model(bool flat, bool coat) {
  return flat ? (coat ? kBoth : kFlatLook) : (coat ? kCoated : kPlain);
}

double bound_of_base(double color, double roughness, double sheen, double sheen_tint, bool flat) {
  const double retro = 2 * roughness;
  // Of a bilinear function of two Schlick weights in [0, 1], the largest corner.
  const double rough = std::max({1.0, 0.5 + retro, 0.25 + retro + retro * retro});
  return color * std::max(rough, flat ? kFlat : 0) + kPi * sheen * std::max(1.0, sheen_tint);
}

ConstantOrTexture read_number(Properties& properties, const char* name, double absent,
                              double most) {
  if (auto texture = read_texture(properties, name, most)) return texture;
  const double number = properties.number_or_colour(name, absent);
  if (!(number >= 0 && number <= most)) {
    properties.fail(name, fmt::format("must lie in [0, {:g}]", most));
  }
  return number;
}

double read_rate(Properties& properties, const char* name) {
  const double rate = properties.number(name, 1);
  if (!(rate >= 0)) properties.fail(name, "must not be negative");
  return rate;
}

}  // namespace limn::principled
