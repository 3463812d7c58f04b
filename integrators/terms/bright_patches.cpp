// Caps around the directions where an environment's own samples crowd.
#include "integrators/terms/bright_patches.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// None of these is tuned.
constexpr int kGrid = 96;         // squared: the directions that are drawn
constexpr int kCandidates = 192;  // of which this many are tried for centers
constexpr size_t kMostPatches = 4;
constexpr double kWindow = 4 * kPi / 180;  // of the search [rad]
constexpr double kWidest = 8 * kPi / 180;  // of a patch [rad]
constexpr double kKept = 0.97;             // of what the widest one has beyond its surroundings
constexpr double kMargin = 1.1;            // of the angle that holds it
constexpr double kLeastShare = 0.1;        // of the environment's light
constexpr double kLeastContrast = 16;      // over the environment's mean

struct Drawn {
  Vec3d w;
  double flux;  // luminance over density [W / m^2]
};

// A point of the unit square for each cell of a grid, stratified, with the cells' corners left out
// of step by the golden ratio: a map's own cells are then met at all their places.
std::vector<Drawn> draw(const Environment& environment) {
  std::vector<Drawn> drawn;
  constexpr double kGolden = 0.6180339887498949, kSilver = 0.4142135623730951;
  for (int i = 0; i < kGrid * kGrid; ++i) {
    const double u = (i % kGrid + std::fmod((i + 1) * kGolden, 1.0)) / kGrid;
    const double v = (i / kGrid + std::fmod((i + 1) * kSilver, 1.0)) / kGrid;
    const auto [w, pdf, place] = environment.sample_direction(u, v);
    const double density = pdf * kGrid * kGrid;
    const double value = luminance(environment.radiance(w));
    if (density > 0 && value > 0) drawn.push_back({w, value / density});
  }
  return drawn;
}

double solid_angle(double angle) { return 4 * kPi * std::pow(std::sin(0.5 * angle), 2); }

double angle_between(const Vec3d& a, const Vec3d& b) {
  return 2 * std::asin(std::min(1.0, 0.5 * length(a - b)));
}

// The flux within the window around an axis, as a vector: its length is the flux, nearly.
Vec3d flux_around(const std::vector<Drawn>& drawn, const Vec3d& axis) {
  const double cosine = std::cos(kWindow);
  Vec3d sum{};
  for (const Drawn& d : drawn) {
    if (dot(d.w, axis) >= cosine) sum += d.w * d.flux;
  }
  return sum;
}

Vec3d brightest_axis(const std::vector<Drawn>& drawn) {
  Vec3d best{};
  // Odd, or candidates would come from few of the grid's columns and miss what lies in others.
  const size_t step = drawn.size() / kCandidates | 1;
  for (size_t i = 0; i < drawn.size(); i += step) {
    const Vec3d around = flux_around(drawn, drawn[i].w);
    if (length_squared(around) > length_squared(best)) best = around;
  }
  // Towards the middle of the light.
  for (int i = 0; i < 3; ++i) best = flux_around(drawn, normalize(best));
  return normalize(best);
}

// The least angle around the axis that holds nearly all that is there beyond the brightness of the
// surroundings, and the flux within it.
struct Extent {
  double angle = 0, flux = 0;
};
Extent extent_around(const std::vector<Drawn>& drawn, const Vec3d& axis) {
  std::vector<std::pair<double, double>> near;  // angle, flux
  double widest = 0, rim = 0;
  constexpr double kRim = 1.25 * kWidest;
  for (const Drawn& d : drawn) {
    const double angle = angle_between(d.w, axis);
    if (angle < kWidest) {
      near.emplace_back(angle, d.flux);
      widest += d.flux;
    } else if (angle < kRim) {
      rim += d.flux;
    }
  }
  std::sort(near.begin(), near.end());
  const double around = rim / (solid_angle(kRim) - solid_angle(kWidest));
  const double wanted = kKept * (widest - around * solid_angle(kWidest));
  Extent extent;
  for (const auto& [angle, flux] : near) {
    extent.flux += flux;
    extent.angle = angle;
    if (extent.flux - around * solid_angle(angle) >= wanted) break;
  }
  extent.angle = std::min(kMargin * extent.angle, kWidest);
  return extent;
}

}  // namespace

std::vector<BrightPatch> find_bright_patches(const Environment& environment) {
  std::vector<BrightPatch> patches;
  if (environment.is_uniform()) return patches;
  std::vector<Drawn> drawn = draw(environment);
  double total = 0;
  for (const Drawn& d : drawn) total += d.flux;
  while (patches.size() < kMostPatches && !drawn.empty()) {
    const Vec3d axis = brightest_axis(drawn);
    const Extent extent = extent_around(drawn, axis);
    if (!(extent.angle > 0) || extent.flux < kLeastShare * total) break;
    const double mean = extent.flux / solid_angle(extent.angle);
    if (mean < kLeastContrast * total / (4 * kPi)) break;
    for (const BrightPatch& other : patches) {
      const double apart = angle_between(axis, other.cap.axis);
      if (apart <= extent.angle + std::asin(other.cap.sine)) return patches;
    }
    const DirectionCap cap{axis, std::sin(extent.angle), std::cos(extent.angle)};
    patches.push_back({cap, mean});
    std::erase_if(drawn, [&](const Drawn& d) { return cap.holds(d.w); });
  }
  return patches;
}

}  // namespace limn
