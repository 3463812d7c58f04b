// Caps around the directions where an environment's own samples crowd.
#include "integrators/lights/bright_patches.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace limn {
namespace {

// None of these is tuned.
constexpr int kGrid = 96;         // squared: the directions that are drawn
constexpr int kCandidates = 192;  // of which this many are tried for centers
constexpr size_t kMostPatches = 4;
constexpr int kMostTries = 8;
constexpr double kWidest = 8 * kPi / 180;  // of a patch [rad]
constexpr double kRing = 1.1;              // of a ring's inner radius: its outer one
constexpr double kRim = 1.0 / 16;     // brightness of a ring that belongs to a cap, over its core's
constexpr double kLeastShare = 0.01;  // of the environment's light
constexpr double kLeastContrast = 16;  // over the environment's mean
constexpr double kLeastSquare = 2;     // over that of a uniform environment of the same light

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

// A cap of constant radiance, as bright as what is there beyond the surroundings' mean.
struct Cap {
  double angle = 0, flux = 0;
  double square = 0;  // the integral of its squared radiance
};

// The one around the axis that holds most of the integral of squared radiance, which is what makes
// samples uneven: for a disc of light the disc, also where it is small and its glow is wide.
Cap cap_around(const std::vector<Drawn>& drawn, const Vec3d& axis, double least_flux) {
  std::vector<std::pair<double, double>> near;  // angle, flux
  constexpr double kOuter = 1.25 * kWidest;
  const double outer_cosine = std::cos(kOuter);
  double inside = 0, outside = 0;
  for (const Drawn& d : drawn) {
    if (dot(d.w, axis) < outer_cosine) continue;
    const double angle = angle_between(d.w, axis);
    if (angle < kWidest) {
      near.emplace_back(angle, d.flux);
      inside += d.flux;
    } else {
      outside += d.flux;
    }
  }
  if (inside < 0.999 * least_flux) return {};  // beyond rounding: no cap here has enough
  std::sort(near.begin(), near.end());
  const double around = outside / (solid_angle(kOuter) - solid_angle(kWidest));
  Cap best;
  double flux = 0;
  for (const auto& [angle, one] : near) {
    flux += one;
    const double wide = solid_angle(angle), beyond = flux - around * wide;
    if (flux < least_flux || !(angle > 0) || !(beyond > 0)) continue;
    const double square = beyond * beyond / wide;
    if (square > best.square) best = {angle, flux, square};
  }
  return best;
}

double flux_within(const std::vector<Drawn>& drawn, const Vec3d& axis, double angle) {
  double flux = 0;
  for (const Drawn& d : drawn) {
    if (angle_between(d.w, axis) <= angle) flux += d.flux;
  }
  return flux;
}

// Wider by rings as long as these are as bright as `least`, and none far brighter than the one
// before it: there is another sun.
Cap with_rim(const std::vector<Drawn>& drawn, const Vec3d& axis, Cap cap, double least) {
  constexpr double kOtherSun = 2;  // not tuned
  double before = cap.flux / solid_angle(cap.angle);
  while (cap.angle * kRing <= kWidest) {
    const double wider = cap.angle * kRing, flux = flux_within(drawn, axis, wider);
    const double ring = solid_angle(wider) - solid_angle(cap.angle);
    const double luminance = (flux - cap.flux) / ring;
    if (luminance < least || luminance > kOtherSun * before) break;
    before = luminance;
    cap.angle = wider;
    cap.flux = flux;
  }
  return cap;
}

// To the middle of the light within the angle.
Vec3d centered(const std::vector<Drawn>& drawn, const Vec3d& axis, double angle) {
  const double cosine = std::cos(angle);
  Vec3d sum{};
  for (const Drawn& d : drawn) {
    if (dot(d.w, axis) >= cosine) sum += d.w * d.flux;
  }
  return length_squared(sum) > 0 ? normalize(sum) : axis;
}

Vec3d brightest_axis(const std::vector<Drawn>& drawn, double least_flux) {
  Vec3d axis = drawn[0].w;
  Cap best;
  const auto try_axis = [&](const Vec3d& w) {
    const Cap cap = cap_around(drawn, w, least_flux);
    if (!(cap.square > best.square)) return;
    best = cap;
    axis = w;
  };
  // Odd, or candidates would come from few of the grid's columns and miss what lies in others.
  const size_t step = drawn.size() / kCandidates | 1;
  for (size_t i = 0; i < drawn.size(); i += step) {
    if (best.square == 0 || dot(drawn[i].w, axis) < std::cos(best.angle)) try_axis(drawn[i].w);
  }
  for (int i = 0; i < 3; ++i) try_axis(centered(drawn, axis, 1.5 * best.angle));
  return axis;
}

DirectionCap cap_of(const Vec3d& axis, double angle) {
  return {axis, std::sin(angle), std::cos(angle)};
}

// What glows around a sun: as bright as a sixteenth of what is nearest, and as a patch must be.
// Weighed like the sun it would take nearly all samples; left to the rest, which is drawn without a
// look at what stands before it, it would rule the error there.
std::optional<BrightPatch> glow_around(const std::vector<Drawn>& drawn, const Vec3d& axis,
                                       const Cap& sun, double uniform) {
  const double nearest = flux_within(drawn, axis, kRing * sun.angle) - sun.flux;
  const double ring = solid_angle(kRing * sun.angle) - solid_angle(sun.angle);
  const double least = std::max(kRim * nearest / ring, kLeastContrast * uniform);
  const Cap whole = with_rim(drawn, axis, sun, least);
  const double flux = whole.flux - sun.flux;
  const double wide = solid_angle(whole.angle) - solid_angle(sun.angle);
  // A narrow one is the sun's rim, blurred by texels: its edges are the sun's.
  if (wide < solid_angle(sun.angle)) return {};
  if (!(flux * flux > kLeastSquare * 4 * kPi * uniform * uniform * wide)) return {};
  return BrightPatch{cap_of(axis, whole.angle), flux / wide, std::cos(sun.angle)};
}

std::vector<BrightPatch> first_patches(const Environment& environment, size_t most) {
  std::vector<BrightPatch> patches;
  if (environment.is_uniform()) return patches;
  std::vector<Drawn> drawn = draw(environment);
  double total = 0;
  for (const Drawn& d : drawn) total += d.flux;
  const double uniform = total / (4 * kPi);
  size_t suns = 0;
  for (int i = 0; i < kMostTries && suns < most && !drawn.empty(); ++i) {
    const Vec3d axis = brightest_axis(drawn, kLeastShare * total);
    const Cap core = cap_around(drawn, axis, kLeastShare * total);
    if (!(core.square >= kLeastSquare * uniform * total)) break;
    if (core.flux < kLeastContrast * uniform * solid_angle(core.angle)) break;
    // The rim of a sun is soft, by haze or by the map's texels.
    const Cap whole = with_rim(drawn, axis, core, kRim * core.flux / solid_angle(core.angle));
    const DirectionCap cap = cap_of(axis, whole.angle);
    const auto is_apart = [&](const DirectionCap& from_others) {
      return std::all_of(patches.begin(), patches.end(), [&](const BrightPatch& other) {
        return angle_between(axis, other.cap.axis) >
               std::asin(from_others.sine) + std::asin(other.cap.sine);
      });
    };
    const auto glow = glow_around(drawn, axis, whole, uniform);
    const bool glows = glow && is_apart(glow->cap);
    // What is left around a patch is none, but hides others.
    if (is_apart(cap)) {
      patches.push_back({cap, whole.flux / solid_angle(whole.angle)});
      if (glows) patches.push_back(*glow);
      ++suns;
    }
    std::erase_if(drawn, [&](const Drawn& d) { return (glows ? glow->cap : cap).holds(d.w); });
  }
  return patches;
}

}  // namespace

std::vector<BrightPatch> find_bright_patches(const Environment& environment) {
  return first_patches(environment, kMostPatches);
}

bool has_bright_patch(const Environment& environment) {
  return !first_patches(environment, 1).empty();
}

}  // namespace limn
