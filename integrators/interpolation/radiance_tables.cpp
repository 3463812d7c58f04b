// Summed tables over azimuth and polar angle, and slanted segments through them.
#include "integrators/interpolation/radiance_tables.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "limn/core/memory.h"

namespace limn {
namespace {

// How fast light counts as above a segment, per cell of its distance: tests find it again.
constexpr double kSharpness = 1;
constexpr double kLongest = 8;  // cells of a segment. Not tuned.

double sum_of(const SkyLight::Colour& c) { return double{c[0]} + c[1] + c[2]; }

}  // namespace

Vec3d mean_direction(const DirectionLoops& loops) {
  Vec3d sum;
  loops.for_segments([&](const Vec3d& a, const Vec3d& b) {
    const Vec3d s = cross(a, b);
    const double sine = length(s);
    if (sine > 0) sum += s * (0.5 * std::atan2(sine, dot(a, b)) / sine);
  });
  return sum;
}

void DirectionLoops::cut(const Vec3d& normal, const Vec3d& around) {
  DirectionLoops whole;
  std::swap(whole, *this);
  const auto add = [&](const Vec3d& w) { directions.push_back(w); };
  const Vec3d middle = normalize(around - normal * (dot(normal, around) / length_squared(normal)));
  size_t loop = 1;
  uint32_t i = 0;
  const auto finish = [&] {
    while (loop < whole.starts.size() && whole.starts[loop] <= i) close(), ++loop;
  };
  whole.for_segments([&](const Vec3d& a, const Vec3d& b) {
    const double at_a = dot(normal, a), at_b = dot(normal, b);
    if (at_a >= 0) add(a);
    if ((at_a >= 0) != (at_b >= 0)) add(normalize(a + (b - a) * (at_a / (at_a - at_b))));
    if (at_a >= 0 && at_b < 0) add(middle);
    ++i;
    finish();
  });
}

RadianceTables::RadianceTables(const Environment::Grid& grid, int columns, int rows,
                               const std::function<Rgb<double>(const Vec3d&)>& radiance)
    : grid_(grid),
      turns_right_(determinant(grid.zero, grid.quarter, grid.pole) > 0 ? 1 : -1),
      columns_(columns),
      rows_(rows) {
  const size_t stride = static_cast<size_t>(columns) + 1;
  require_memory({}, static_cast<double>(stride) * (rows + 1) * sizeof(SkyLight),
                 "the tables over the environment's map", "use a smaller map, or another method");
  cells_.resize(stride * (rows + 1));
  // Two points of Gauss along each side of a cell.
  const double points[] = {0.5 - std::sqrt(1.0 / 12), 0.5 + std::sqrt(1.0 / 12)};
  const double area = 2 * kPi / columns * (kPi / rows) / 4;
  std::vector<std::array<double, 12>> above(stride);
  for (int j = 0; j < rows; ++j) {
    std::array<double, 12> left{};
    for (int i = 0; i < columns; ++i) {
      for (int k = 0; k < 4; ++k) {
        const double phi = (i + points[k % 2]) * (2 * kPi / columns);
        const double theta = (j + points[k / 2]) * (kPi / rows), sine = std::sin(theta);
        const Vec3d around = grid.zero * std::cos(phi) + grid.quarter * std::sin(phi);
        const Vec3d w = grid.pole * std::cos(theta) + around * sine;
        const Rgb<double> light = radiance(w) * (area * sine);
        for (int c = 0; c < 3; ++c) {
          left[c] += light[c] * w.x, left[3 + c] += light[c] * w.y;
          left[6 + c] += light[c] * w.z, left[9 + c] += light[c];
        }
      }
      std::array<double, 12>& sums = above[i + 1];
      for (int k = 0; k < 12; ++k) sums[k] += left[k];
      const auto colour = [&](int k) {
        return SkyLight::Colour{static_cast<float>(sums[k]), static_cast<float>(sums[k + 1]),
                                static_cast<float>(sums[k + 2]), 0};
      };
      cells_[(j + 1) * stride + i + 1] = {colour(0), colour(3), colour(6), colour(9)};
    }
  }
}

RadianceTables::Place RadianceTables::place(const Vec3d& w) const {
  const double turn = std::atan2(dot(w, grid_.quarter), dot(w, grid_.zero)) / (2 * kPi);
  const double c = std::clamp(dot(w, grid_.pole), -1.0, 1.0);
  return {(turn < 0 ? turn + 1 : turn) * columns_, std::acos(c) * (rows_ / kPi)};
}

// phi from -columns to 2 columns: whole turns are added.
SkyLight RadianceTables::sum(double phi, double theta) const {
  const size_t stride = static_cast<size_t>(columns_) + 1;
  const int row = std::clamp(static_cast<int>(theta), 0, rows_ - 1);
  const auto v = static_cast<float>(theta - row);
  const SkyLight* cells = &cells_[row * stride];
  int turns = 0;
  if (phi < 0) phi += columns_, turns = -1;
  if (phi > columns_) phi -= columns_, turns = 1;
  const int column = std::clamp(static_cast<int>(phi), 0, columns_ - 1);
  const auto u = static_cast<float>(phi - column);
  const auto across = [&](int i) { return cells[i] * (1 - v) + cells[stride + i] * v; };
  const SkyLight inside = across(column) * (1 - u) + across(column + 1) * u;
  return turns == 0 ? inside : inside + across(columns_) * static_cast<float>(turns);
}

// Of a box's light: by how far its mean direction lies from the segment's plane.
double RadianceTables::share_above(const SkyLight& box, const Vec3d& a, const Vec3d& b) const {
  const Vec3d mean{sum_of(box.x), sum_of(box.y), sum_of(box.z)};
  Vec3d n = cross(a, b);
  const double size = length(mean) * length(n);
  if (!(size > 0)) return 0.5;
  if (dot(n, grid_.pole) < 0) n = -n;
  const double distance = dot(n, mean) / size * (rows_ / kPi);
  // (1 + tanh x) / 2
  return 1 / (1 + std::exp(-2 * kSharpness * (sum_of(box.all) < 0 ? -distance : distance)));
}

SkyLight RadianceTables::light(const DirectionLoops& loops) const {
  SkyLight total{};
  double winding = 0;
  const double longest = kLongest * kPi / rows_;
  Vec3d last{};  // where `end` and `at_end` are
  Place end{};
  SkyLight at_end{};
  loops.for_segments([&](const Vec3d& a, const Vec3d& b) {
    const double chord = length(b - a);
    if (chord == 0) return;
    const int pieces = 1 + static_cast<int>(chord / longest);
    if (!(last == a)) end = place(a), at_end = sum(end.phi, end.theta);
    Vec3d from = a;
    for (int k = 1; k <= pieces; ++k) {
      const Vec3d to = k == pieces ? b : normalize(a + (b - a) * (static_cast<double>(k) / pieces));
      const Place next = place(to);
      const SkyLight at_next = sum(next.phi, next.theta);
      // The short way around, from the end's azimuth.
      const double way = next.phi - end.phi;
      const int turns = way > 0.5 * columns_ ? -1 : way < -0.5 * columns_ ? 1 : 0;
      const double unwound = next.phi + turns * columns_;
      winding += way + turns * columns_;
      const SkyLight e = sum(unwound, end.theta) - at_end;
      SkyLight f = at_next - sum(end.phi, next.theta);
      if (turns != 0) f = f + sum(columns_, next.theta) * static_cast<float>(turns);
      const double b_above = share_above(f - e, from, to);
      const auto beta = static_cast<float>(next.theta > end.theta ? b_above : 1 - b_above);
      total = total + e * (1 - beta) + f * beta;
      from = to, end = next, at_end = at_next;
    }
    last = b;
  });
  total = total * static_cast<float>(turns_right_);
  // A region that holds the opposite of the pole is what its loops leave of the sphere; beside the
  // horizon an interpolated one may hold both, and turn around neither. 0.02: above errors of the
  // tables. Not tuned.
  const SkyLight whole = sum(columns_, rows_);
  const bool turns_back = winding * turns_right_ < -0.5 * columns_;
  if (turns_back || sum_of(total.all) < -0.02 * sum_of(whole.all)) total = total + whole;
  return total;
}

BlurredSky::BlurredSky(const Environment& environment, double power) {
  constexpr int kRows = 32, kFine = 4;
  struct Sample {
    Vec3d w;
    Rgb<double> light;
    double weight;
  };
  const auto direction = [](double column, double row) {
    const double phi = column * (kPi / kRows), theta = row * (kPi / kRows);
    return Vec3d{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
  };
  std::vector<Sample> samples;
  for (int j = 0; j < kRows * kFine; ++j) {
    for (int i = 0; i < 2 * kRows * kFine; ++i) {
      const double row = (j + 0.5) / kFine;
      const Vec3d w = direction((i + 0.5) / kFine, row);
      const double weight = std::sin(row * kPi / kRows);
      samples.push_back({w, environment.radiance(w) * weight, weight});
    }
  }
  const double least = std::pow(1e-4, 1 / power);  // cosine below which nothing counts
  for (int j = 0; j <= kRows; ++j) {
    std::vector<Rgb<double>>& row = rows_.emplace_back();
    for (int i = 0; i <= 2 * kRows; ++i) {
      const Vec3d w = direction(i, j);
      Rgb<double> sum;
      double weights = 0;
      for (const Sample& sample : samples) {
        const double cosine = dot(sample.w, w);
        if (cosine < least) continue;
        const double k = std::pow(cosine, power);
        sum += sample.light * k;
        weights += sample.weight * k;
      }
      row.push_back(sum * (1 / weights));
    }
  }
}

Rgb<double> BlurredSky::radiance(const Vec3d& w) const {
  const auto rows = static_cast<double>(rows_.size() - 1);
  const double turn = std::atan2(w.y, w.x) / (2 * kPi);
  const double x = (turn < 0 ? turn + 1 : turn) * 2 * rows;
  const double y = std::acos(std::clamp(w.z, -1.0, 1.0)) / kPi * rows;
  const int i = std::min(static_cast<int>(x), static_cast<int>(2 * rows) - 1);
  const int j = std::min(static_cast<int>(y), static_cast<int>(rows) - 1);
  const double u = x - i, v = y - j;
  return (rows_[j][i] * (1 - u) + rows_[j][i + 1] * u) * (1 - v) +
         (rows_[j + 1][i] * (1 - u) + rows_[j + 1][i + 1] * u) * v;
}

}  // namespace limn
