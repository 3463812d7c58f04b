// The share of a cap's light that is not hidden.
#include "integrators/interpolation/gloss.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

constexpr int kCapSides = 12;  // Not tuned.

// Mirror directions turn twice as fast as normals of facets.
double power_of(double alpha) { return std::max(1.0, (2 / (alpha * alpha) - 2) / 4); }

// The part of light that is scattered, over four directions of the lobe.
Rgb<double> albedo(const Scattering<double>& scattering) {
  Rgb<double> sum;
  for (int k = 0; k < 4; ++k) {
    const auto wo =
        scattering.bsdf().sample(scattering.normal(), scattering.wi(), 0.25 + 0.5 * (k % 2),
                                 0.25 + 0.5 * (k / 2), scattering.at());
    if (!wo) continue;
    const double pdf = scattering.bsdf().pdf_solid_angle(scattering.normal(), scattering.wi(), *wo,
                                                         scattering.at());
    if (pdf > 0) sum += scattering.eval(*wo) * (0.25 / pdf);
  }
  return sum;
}

}  // namespace

Gloss::Gloss(const Environment& sky, double alpha, double share)
    : power_(power_of(alpha)), cap_(std::pow(1 - share, 1 / (power_ + 1))), sky_(sky, power_) {}

Rgb<double> Gloss::radiance(const RadianceTables& tables, const Scattering<double>& scattering,
                            DirectionLoops& loops) const {
  const Vec3d& n = scattering.normal();
  const Vec3d r = normalize(n * (2 * dot(n, scattering.wi())) - scattering.wi());
  const Frame frame(r);
  DirectionLoops cap;
  const double out = std::sqrt(std::fmax(0, 1 - cap_ * cap_));
  for (int i = 0; i < kCapSides; ++i) {
    const double phi = 2 * kPi * i / kCapSides;
    cap.directions.push_back(frame.to_world({out * std::cos(phi), out * std::sin(phi), cap_}));
  }
  cap.close();
  for (int i = 0; i < kCapSides; ++i) {
    loops.cut(cross(cap.directions[i], cap.directions[(i + 1) % kCapSides]), r);
  }
  const auto in_cap = [&](const DirectionLoops& region) {
    const SkyLight light = tables.light(region);
    const Rgb<double> whole{light.all[0], light.all[1], light.all[2]};
    return light.along(r) - whole * cap_;
  };
  const Rgb<double> seen = in_cap(loops), all = in_cap(cap);
  Rgb<double> result = albedo(scattering) * sky_.radiance(r);
  for (int c = 0; c < 3; ++c) {
    result[c] *= all[c] > 0 ? std::clamp(seen[c] / all[c], 0.0, 1.0) : 0;
  }
  return result;
}

}  // namespace limn
