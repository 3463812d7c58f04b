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
    : grid_(environment.grid().value()),
      step_(kPi / (grid_.rows - 1)),
      per_step_(1 / step_),
      stride_(static_cast<size_t>(grid_.rows) + 1) {
  const int rows = grid_.rows;
  require_memory({}, static_cast<double>(grid_.columns) * stride_ * sizeof(Cell),
                 "the sums over the environment's map", "use a smaller map, or another method");
  cells_.resize(grid_.columns * stride_);
  std::vector<double> cosines, sines;
  for (int j = 0; j < rows; ++j) {
    const double theta = step_ * j;
    cosines.push_back(std::cos(theta)), sines.push_back(std::sin(theta));
    at_rows_.push_back(moments(theta, cosines[j], sines[j]));
  }
  std::vector<Vec3d> around;
  for (int i = 0; i < grid_.columns; ++i) around.push_back(azimuth(i));
  // Texels of some columns in a row share a line of the cache.
  constexpr int kTogether = 8;
  parallel_for((grid_.columns + kTogether - 1) / kTogether, threads, [&](size_t block) {
    const int first = static_cast<int>(block) * kTogether;
    const int last = std::min(first + kTogether, grid_.columns);
    for (int j = 0; j < rows; ++j) {
      for (int i = first; i < last; ++i) {
        const Vec3d w = grid_.pole * cosines[j] + around[i] * sines[j];
        const Rgb<double> radiance =
            environment.radiance_at(w, {static_cast<double>(i), static_cast<double>(j)});
        cells_[i * stride_ + j].texel = Colour{radiance.r, radiance.g, radiance.b, 0};
      }
    }
    for (int i = first; i < last; ++i) add_up(&cells_[i * stride_]);
  });
}

void RadianceColumns::add_up(Cell* column) const {
  for (int j = 0; j + 1 < grid_.rows; ++j) {
    const InRow w = in_row(j, at_rows_[j + 1]);
    const Cell &here = column[j], &below = column[j + 1];
    column[j + 1].pole = here.pole + here.texel * w.pole_here + below.texel * w.pole_below;
    column[j + 1].across = here.across + here.texel * w.across_here + below.texel * w.across_below;
  }
}

Vec3d RadianceColumns::azimuth(int column) const {
  const double phi = 2 * kPi * (column + 0.5) / grid_.columns;
  return grid_.zero * std::cos(phi) + grid_.quarter * std::sin(phi);
}

// At the poles radiance depends on the azimuth of approach: it is taken from a direction next to
// it.
Vec3d RadianceColumns::direction(int column, int row) const {
  const double theta = std::clamp(step_ * row, 1e-7, kPi - 1e-7);
  return grid_.pole * std::cos(theta) + azimuth(column) * std::sin(theta);
}

// Between two rows radiance is here + (below - here) (theta - step row) / step.
RadianceColumns::InRow RadianceColumns::in_row(int row, const Moments& end) const {
  const Moments& start = at_rows_[row];
  const double theta = step_ * row;
  const double pole = end.pole - start.pole, across = end.across - start.across;
  const double pole_below = (end.pole_linear - start.pole_linear - theta * pole) * per_step_;
  const double across_below =
      (end.across_linear - start.across_linear - theta * across) * per_step_;
  return {pole - pole_below, pole_below, across - across_below, across_below};
}

std::vector<double> RadianceColumns::brightness() const {
  const int columns = grid_.columns;
  std::vector<double> own(columns), spread(columns);
  for (int i = 0; i < columns; ++i) {
    const Colour& sum = cells_[i * stride_ + grid_.rows - 1].across;
    own[i] = std::fmax(luminance(Rgb<double>{sum[0], sum[1], sum[2]}), 0.0);
  }
  // Radiance of a column reaches to the next on both sides.
  for (int i = 0; i < columns; ++i) {
    const int before = i > 0 ? i - 1 : columns - 1, next = i + 1 < columns ? i + 1 : 0;
    spread[i] = 0.25 * own[before] + 0.5 * own[i] + 0.25 * own[next];
  }
  return spread;
}

RadianceColumns::Meridian RadianceColumns::meridian(const Vec3d& r) const {
  const double turn = std::atan2(dot(r, grid_.quarter), dot(r, grid_.zero)) / (2 * kPi);
  return meridian(turn < 0 ? turn + 1 : turn);
}

RadianceColumns::Meridian RadianceColumns::meridian(double turn) const {
  double x = turn * grid_.columns - 0.5;
  if (x < 0) x += grid_.columns;
  const int column = std::clamp(static_cast<int>(x), 0, grid_.columns - 1);
  const int next = column + 1 == grid_.columns ? 0 : column + 1;
  return {column * stride_, next * stride_, x - column};
}

RadianceColumns::Weights RadianceColumns::weights(double theta, double cos_theta, double sin_theta,
                                                  double along, double across) const {
  const int row = std::clamp(static_cast<int>(theta * per_step_), 0, grid_.rows - 2);
  const InRow w = in_row(row, moments(theta, cos_theta, sin_theta));
  return {row, along, across, along * w.pole_here + across * w.across_here,
          along * w.pole_below + across * w.across_below};
}

// Along the meridian between two columns the map is linear, too.
Rgb<double> RadianceColumns::sum(const Meridian& at, const Weights& weights) const {
  const auto of = [&](size_t column) {
    const Cell* cell = &cells_[column + weights.row];
    return cell->pole * weights.along + cell->across * weights.across + cell->texel * weights.here +
           cell[1].texel * weights.below;
  };
  const Colour sum = of(at.first) * (1 - at.share) + of(at.second) * at.share;
  return {sum[0], sum[1], sum[2]};
}

void RadianceColumns::add(const Meridian& at, const Weights& weights, const Rgb<double>& d_sum,
                          Adjoint& adjoint) {
  const Colour all{d_sum.r, d_sum.g, d_sum.b, 0};
  for (const bool second : {false, true}) {
    Cell* cell = &adjoint[(second ? at.second : at.first) + weights.row];
    const Colour d = all * (second ? at.share : 1 - at.share);
    cell->pole += d * weights.along;
    cell->across += d * weights.across;
    cell->texel += d * weights.here;
    cell[1].texel += d * weights.below;
  }
}

void RadianceColumns::finish(
    Adjoint adjoint, const std::function<void(const Vec3d&, const Rgb<double>&)>& add) const {
  for (int i = 0; i < grid_.columns; ++i) {
    Cell* column = &adjoint[i * stride_];
    for (int j = grid_.rows - 2; j >= 0; --j) {
      const InRow w = in_row(j, at_rows_[j + 1]);
      const Cell below = column[j + 1];
      column[j].pole += below.pole;
      column[j].across += below.across;
      column[j].texel += below.pole * w.pole_here + below.across * w.across_here;
      column[j + 1].texel += below.pole * w.pole_below + below.across * w.across_below;
    }
    for (int j = 0; j < grid_.rows; ++j) {
      const Colour& d = column[j].texel;
      add(direction(i, j), {d[0], d[1], d[2]});
    }
  }
}

}  // namespace limn
