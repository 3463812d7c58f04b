// BSDF sampling against the density that it reports, and energy.
#include <gtest/gtest.h>

#include <algorithm>

#include "limn/core/rng.h"
#include "support/bsdf_cases.h"
#include "support/chi_square.h"
#include "support/quadrature.h"

namespace limn {
namespace {

using test::around;
using test::BsdfCase;
using test::integrate;

constexpr int kRings = 14;
constexpr int kSectors = 10;
const double kPolarAngles[] = {0.0, 0.8, 1.3, 1.55};
const Vec3d kNormal = normalize(Vec3d{0.3, -0.5, 0.6});

// Polar coordinates (theta, phi) around the mirror direction, phi = 0 towards the normal. The
// radial coordinate t in [0, 1] spends half of itself on the lobe: theta = s t / (1 - t (1 - s /
// pi)).
struct MirrorFrame {
  Vec3d axis, x, y;
  double normal_angle;  // between axis and normal
  double s;

  MirrorFrame(const Vec3d& n, const Vec3d& wi, double alpha) : s(std::min(2 * alpha, 1.5)) {
    axis = normalize(n * (2 * dot(n, wi)) - wi);
    const Vec3d side = n - axis * dot(n, axis);
    normal_angle = std::atan2(length(side), dot(n, axis));
    x = length(side) > 1e-9 ? normalize(side) : Frame(axis).s;
    y = cross(axis, x);
  }
  double theta(double t) const { return s * t / (1 - t * (1 - s / kPi)); }
  double theta_slope(double t) const {
    const double q = 1 - t * (1 - s / kPi);
    return s / (q * q);
  }
  double t(double angle) const { return angle / (s + angle * (1 - s / kPi)); }
  Vec3d direction(double angle, double phi) const {
    return axis * std::cos(angle) + (x * std::cos(phi) + y * std::sin(phi)) * std::sin(angle);
  }
  // Directions at this angle lie above the surface for |phi| < horizon(angle).
  double horizon(double angle) const {
    const double c = -std::cos(angle) * std::cos(normal_angle);
    const double q = std::sin(angle) * std::sin(normal_angle);
    return c >= q ? 0 : c <= -q ? kPi : std::acos(c / q);
  }
  int bin(const Vec3d& w) const {
    const double angle = std::atan2(length(cross(axis, w)), dot(axis, w));
    const double phi = std::atan2(dot(y, w), dot(x, w));
    const int ring = std::clamp(static_cast<int>(t(angle) * kRings), 0, kRings - 1);
    const int sector =
        std::clamp(static_cast<int>((phi + kPi) / (2 * kPi) * kSectors), 0, kSectors - 1);
    return ring * kSectors + sector;
  }
};

// The integral of f over each bin, cut at the horizon, where densities jump.
template <class F>
std::vector<double> integrate_bins(const MirrorFrame& frame, F f) {
  // Seen at a grazing angle a lobe is narrower across than along by the cosine.
  const int panels = static_cast<int>(std::ceil(0.5 / std::cos(frame.normal_angle)));
  std::vector<double> bins;
  for (int ring = 0; ring < kRings; ++ring) {
    std::vector<double> cuts = {static_cast<double>(ring) / kRings, (ring + 1.0) / kRings};
    for (double kink : {kPi / 2 - frame.normal_angle, kPi / 2 + frame.normal_angle}) {
      const double t = frame.t(kink);
      if (t > cuts.front() && t < cuts.back()) cuts.insert(cuts.end() - 1, t);
    }
    for (int sector = 0; sector < kSectors; ++sector) {
      const double low = 2 * kPi * sector / kSectors - kPi;
      const double high = low + 2 * kPi / kSectors;
      const auto over_phi = [&](double t) {
        const double angle = frame.theta(t);
        const double limit = frame.horizon(angle);
        const double a = std::max(low, -limit), b = std::min(high, limit);
        if (a >= b) return 0.0;
        const auto at = [&](double phi) { return f(frame.direction(angle, phi)); };
        return integrate(at, a, b, panels) * std::sin(angle) * frame.theta_slope(t);
      };
      double sum = 0;
      for (size_t i = 0; i + 1 < cuts.size(); ++i) {
        sum += integrate(over_phi, cuts[i], cuts[i + 1], 4);
      }
      bins.push_back(sum);
    }
  }
  return bins;
}

double total(const std::vector<double>& v) {
  double sum = 0;
  for (double x : v) sum += x;
  return sum;
}

// Draws that fall below the surface are the last bin: together with the others it says that the
// density of visible normals integrates to one (the weak white furnace).
TEST(BsdfSampling, MatchesItsDensity) {
  constexpr int kSamples = 100000;
  const std::vector<BsdfCase> cases = test::bsdf_cases(false);
  const double threshold =
      test::sidak_threshold(0.01, static_cast<int>(cases.size() * std::size(kPolarAngles)));
  for (const BsdfCase& c : cases) {
    for (double polar : kPolarAngles) {
      const Vec3d wi = around(kNormal, polar, 0.7);
      const MirrorFrame frame(kNormal, wi, c.alpha);
      std::vector<double> expected = integrate_bins(
          frame, [&](const Vec3d& wo) { return c.bsdf->pdf_solid_angle(kNormal, wi, wo); });
      expected.push_back(std::max(0.0, 1 - total(expected)));
      for (double& e : expected) e *= kSamples;
      std::vector<double> observed(expected.size(), 0);
      Rng rng(1, 2, 3);
      for (int i = 0; i < kSamples; ++i) {
        const double u1 = rng.uniform();
        const double u2 = rng.uniform();
        const auto wo = c.bsdf->sample(kNormal, wi, u1, u2);
        ++observed[wo ? static_cast<size_t>(frame.bin(*wo)) : observed.size() - 1];
      }
      const test::ChiSquare result = test::chi_square_test(observed, expected);
      EXPECT_GT(result.p_value, threshold)
          << c.name << " at " << polar << ": chi-square " << result.statistic << " with "
          << result.degrees_of_freedom << " degrees of freedom";
    }
  }
}

// At normal incidence reflection falls below the surface where the facet tilts by more than 45
// degrees: with probability alpha^2 / (1 + alpha^2) for GGX, exp(-1 / alpha^2) for Beckmann.
TEST(BsdfSampling, DensityAtNormalIncidenceHasClosedForm) {
  for (const BsdfCase& c : test::bsdf_cases(false)) {
    if (!c.conductor) continue;
    const MirrorFrame frame(kNormal, kNormal, c.alpha);
    const double sum = total(integrate_bins(
        frame, [&](const Vec3d& wo) { return c.bsdf->pdf_solid_angle(kNormal, kNormal, wo); }));
    const double a2 = c.alpha * c.alpha;
    EXPECT_NEAR(sum, c.beckmann ? -std::expm1(-1 / a2) : 1 / (1 + a2), 1e-8) << c.name;
  }
}

// The reflected energy, by quadrature and by sampling, is the same and at most the bound; all of
// it returns from a smooth perfect mirror.
TEST(BsdfSampling, EnergyIsBoundedAndAgreesWithQuadrature) {
  constexpr int kSamples = 40000;
  for (bool copper : {false, true}) {
    for (const BsdfCase& c : test::bsdf_cases(copper)) {
      for (double polar : kPolarAngles) {
        const Vec3d wi = around(kNormal, polar, 0.7);
        const MirrorFrame frame(kNormal, wi, c.alpha);
        const double exact = total(integrate_bins(
            frame, [&](const Vec3d& wo) { return c.bsdf->eval(kNormal, wi, wo).b; }));
        double sum = 0, sum2 = 0;
        Rng rng(5, 6, 7);
        for (int i = 0; i < kSamples; ++i) {
          const double u1 = rng.uniform();
          const double u2 = rng.uniform();
          const auto wo = c.bsdf->sample(kNormal, wi, u1, u2);
          if (!wo) continue;
          const BsdfValue v = c.bsdf->eval_with_pdf(kNormal, wi, *wo);
          sum += v.value.b / v.pdf;
          sum2 += v.value.b / v.pdf * (v.value.b / v.pdf);
        }
        const double mean = sum / kSamples;
        const double error = std::sqrt(std::max(0.0, sum2 / kSamples - mean * mean) / kSamples);
        EXPECT_NEAR(mean, exact, 4.5 * error + 1e-5) << c.name << " at " << polar;
        EXPECT_LE(exact, c.bsdf->lobe().albedo + 1e-8) << c.name << " at " << polar;
        if (c.conductor && !copper && c.alpha == 0.001 && polar < 1.4) {
          EXPECT_GT(exact, 0.9999) << c.name;
        }
      }
    }
  }
}

// Of all directions, half of them in the lobe: with the cosines of one direction.
TEST(BsdfSampling, LobesBoundTheValue) {
  Rng rng(8, 9, 10);
  for (bool copper : {false, true}) {
    for (const BsdfCase& c : test::bsdf_cases(copper)) {
      for (int i = 0; i < 2000; ++i) {
        const Vec3d wi = around(kNormal, 1.57 * rng.uniform(), 2 * kPi * rng.uniform());
        const double u1 = rng.uniform(), u2 = rng.uniform();
        Vec3d wo = around(kNormal, 1.57 * u1, 2 * kPi * u2);
        if (i % 2 == 0) wo = c.bsdf->sample(kNormal, wi, u1, u2).value_or(wo);
        const LobeSummary lobe = c.bsdf->lobe();
        const Vec3d n = c.bsdf->scattering_normal(kNormal, wi, nullptr);
        if (!(dot(n, wo) > 0)) continue;
        const double cos_axis = dot(lobe.model->axis(n, wi), wo);
        const double bound =
            lobe.model->bound(lobe, dot(n, wi), dot(n, wo), std::min(1.0, cos_axis));
        const Rgb<double> f = c.bsdf->eval(kNormal, wi, wo);
        // D magnifies the rounding of cosines, and so does division by them.
        const double rounding = 1e-14 / (c.alpha * c.alpha) + 1e-15 / dot(n, wo);
        EXPECT_LE(max_channel(f), bound * (1 + rounding)) << c.name;
      }
    }
  }
}

}  // namespace
}  // namespace limn
