// Prefix sums of a map along its meridians.
#include "integrators/contours/radiance_columns.h"

#include <algorithm>
#include <cmath>

#include "limn/core/memory.h"
#include "limn/core/parallel.h"

namespace limn {

// Antiderivatives of cos sin, sin^2 and of theta times these.
RadianceColumns::Moments RadianceColumns::moments(double theta, double c, double s) {
  const double sine2 = 2 * s * c, cosine2 = c * c - s * s;
  return {0.5 * s * s, 0.5 * (theta - s * c), 0.125 * sine2 - 0.25 * theta * cosine2,
          0.25 * theta * theta - 0.25 * theta * sine2 - 0.125 * cosine2};
}

RadianceColumns::RadianceColumns(const Environment& environment, int threads)
    : grid_(environment.grid().value()), step_(kPi / (grid_.rows - 1)) {
  const int rows = grid_.rows;
  require_memory({},
                 static_cast<double>(grid_.columns) * rows * (sizeof(Rgb<double>) + sizeof(Sum)),
                 "the sums over the environment's map", "use a smaller map, or another method");
  texels_.resize(static_cast<size_t>(grid_.columns) * rows);
  sums_.resize(texels_.size());
  for (int j = 0; j < rows; ++j) {
    const double theta = step_ * j;
    at_rows_.push_back(moments(theta, std::cos(theta), std::sin(theta)));
  }
  parallel_for(grid_.columns, threads, [&](size_t i) {
    const double phi = 2 * kPi * (static_cast<double>(i) + 0.5) / grid_.columns;
    const Vec3d r = grid_.zero * std::cos(phi) + grid_.quarter * std::sin(phi);
    const size_t column = i * rows;
    for (int j = 0; j < rows; ++j) {
      // At the poles radiance depends on the azimuth of approach: a direction next to it tells.
      const double theta = std::clamp(step_ * j, 1e-7, kPi - 1e-7);
      texels_[column + j] =
          environment.radiance(grid_.pole * std::cos(theta) + r * std::sin(theta));
    }
    for (int j = 0; j + 1 < rows; ++j) {
      const Moments &m = at_rows_[j], &n = at_rows_[j + 1];
      const Rgb<double> slope = (texel(column, j + 1) - texel(column, j)) * (1 / step_);
      const Rgb<double> level = texel(column, j) - slope * (step_ * j);
      const Sum& before = sums_[column + j];
      sums_[column + j + 1] = {
          before.pole + level * (n.pole - m.pole) + slope * (n.pole_linear - m.pole_linear),
          before.across + level * (n.across - m.across) +
              slope * (n.across_linear - m.across_linear)};
    }
  });
}

std::vector<double> RadianceColumns::brightness() const {
  const int columns = grid_.columns;
  std::vector<double> own(columns), spread(columns);
  for (int i = 0; i < columns; ++i) {
    const Rgb<double>& sum = sums_[static_cast<size_t>(i + 1) * grid_.rows - 1].across;
    own[i] = std::fmax(luminance(sum), 0.0);
  }
  // Radiance of a column reaches to the next on both sides.
  for (int i = 0; i < columns; ++i) {
    const int before = i > 0 ? i - 1 : columns - 1, next = i + 1 < columns ? i + 1 : 0;
    spread[i] = 0.25 * own[before] + 0.5 * own[i] + 0.25 * own[next];
  }
  return spread;
}

RadianceColumns::Meridian RadianceColumns::meridian(const Vec3d& r) const {
  const double phi = std::atan2(dot(r, grid_.quarter), dot(r, grid_.zero));
  double x = phi * (grid_.columns / (2 * kPi)) - 0.5;
  if (x < 0) x += grid_.columns;
  const int column = std::clamp(static_cast<int>(x), 0, grid_.columns - 1);
  const int next = column + 1 == grid_.columns ? 0 : column + 1;
  return {static_cast<size_t>(column) * grid_.rows, static_cast<size_t>(next) * grid_.rows,
          x - column};
}

RadianceColumns::Sum RadianceColumns::sum(const Meridian& at, double cos_theta,
                                          double sin_theta) const {
  const double theta = std::atan2(sin_theta, cos_theta);
  const int row = std::clamp(static_cast<int>(theta / step_), 0, grid_.rows - 2);
  const Moments &m = at_rows_[row], n = moments(theta, cos_theta, sin_theta);
  // Along the meridian between two columns the map is linear, too.
  const auto mix = [&](const Rgb<double>& a, const Rgb<double>& b) {
    return a + (b - a) * at.share;
  };
  const Rgb<double> here = mix(texel(at.first, row), texel(at.second, row));
  const Rgb<double> below = mix(texel(at.first, row + 1), texel(at.second, row + 1));
  const Rgb<double> slope = (below - here) * (1 / step_);
  const Rgb<double> level = here - slope * (step_ * row);
  const Sum &a = sums_[at.first + row], &b = sums_[at.second + row];
  return {mix(a.pole, b.pole) + level * (n.pole - m.pole) + slope * (n.pole_linear - m.pole_linear),
          mix(a.across, b.across) + level * (n.across - m.across) +
              slope * (n.across_linear - m.across_linear)};
}

}  // namespace limn
