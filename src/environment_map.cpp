#include "environment_map.h"

namespace limn {
namespace {

constexpr double kMeanShare = 1.0 / 16;  // see EnvironmentMap::sample

// Inverts the integral of the density a + (b - a) x on [0, 1], up to a factor; a + b > 0.
double sample_linear(double a, double b, double u) {
  return std::min(1.0, u * (a + b) / (a + std::sqrt(a * a * (1 - u) + b * b * u)));
}

double mix(double a, double b, double t) { return a + (b - a) * t; }

// The interval of the cumulative distribution (from 0 to 1, n intervals) that holds u; u becomes
// the position in it. Intervals of no width are never chosen.
int choose(const double* cdf, int n, double& u) {
  const int i = static_cast<int>(std::upper_bound(cdf, cdf + n, u) - cdf) - 1;
  u = std::min(1.0, (u - cdf[i]) / (cdf[i + 1] - cdf[i]));
  return i;
}

// Turns n weights stored in cdf[1..n] into a cumulative distribution; returns their sum. Equal
// shares if all are zero.
double accumulate(double* cdf, int n) {
  cdf[0] = 0;
  for (int i = 1; i <= n; ++i) cdf[i] += cdf[i - 1];
  const double sum = cdf[n];
  for (int i = 1; i <= n; ++i) cdf[i] = sum > 0 ? cdf[i] / sum : static_cast<double>(i) / n;
  cdf[n] = 1;
  return sum;
}

}  // namespace

EnvironmentMap::EnvironmentMap(const Image& image)
    : width_(image.width), height_(std::max(2, image.height)) {
  texels_.reserve(static_cast<size_t>(3) * width_ * height_);
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      for (int c = 0; c < 3; ++c) {
        texels_.push_back(image.at(x, std::min(y, image.height - 1), image.channels == 3 ? c : 0));
      }
    }
  }
  build_distribution();
}

EnvironmentMap::Corners EnvironmentMap::density_corners(int column, int row) const {
  Corners corners;
  double mean = 0;
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      const float* c = texel(j == 0 ? column : next_column(column), row + i);
      corners.v[i][j] = luminance(Rgb<double>{std::fabs(c[0]), std::fabs(c[1]), std::fabs(c[2])});
      mean += 0.25 * corners.v[i][j];
    }
  }
  for (auto& line : corners.v) {
    for (double& v : line) v = mean > 0 ? mix(v, mean, kMeanShare) : 1;
  }
  return corners;
}

void EnvironmentMap::build_distribution() {
  const int rows = height_ - 1;
  for (int row = 0; row <= rows; ++row) cos_theta_.push_back(std::cos(polar_angle(row)));
  for (int row = 0; row < rows; ++row) {
    // cos(a) - cos(b) without cancellation, times the cell's azimuth.
    const double half = 0.5 * (polar_angle(row + 1) - polar_angle(row));
    const double middle = 0.5 * (polar_angle(row + 1) + polar_angle(row));
    cell_solid_angles_.push_back(2 * std::sin(middle) * std::sin(half) * (2 * kPi / width_));
  }
  row_cdf_.assign(rows + 1, 0);
  column_cdf_.assign(static_cast<size_t>(rows) * (width_ + 1), 0);
  for (int row = 0; row < rows; ++row) {
    double* cdf = &column_cdf_[static_cast<size_t>(row) * (width_ + 1)];
    for (int column = 0; column < width_; ++column) {
      for (const float* c : {texel(column, row), texel(next_column(column), row),
                             texel(column, row + 1), texel(next_column(column), row + 1)}) {
        cdf[column + 1] +=
            luminance(Rgb<double>{std::fabs(c[0]), std::fabs(c[1]), std::fabs(c[2])});
      }
    }
    row_cdf_[row + 1] = accumulate(cdf, width_) * cell_solid_angles_[row];
  }
  if (*std::max_element(row_cdf_.begin(), row_cdf_.end()) == 0) {
    for (int row = 0; row < rows; ++row) row_cdf_[row + 1] = cell_solid_angles_[row];
  }
  accumulate(row_cdf_.data(), rows);
}

Vec3d EnvironmentMap::sample(double u1, double u2) const {
  CellPoint p;
  p.row = choose(row_cdf_.data(), height_ - 1, u1);
  p.column = choose(&column_cdf_[static_cast<size_t>(p.row) * (width_ + 1)], width_, u2);
  const Corners c = density_corners(p.column, p.row);
  p.t = sample_linear(c.v[0][0] + c.v[0][1], c.v[1][0] + c.v[1][1], u1);
  p.s = sample_linear(mix(c.v[0][0], c.v[1][0], p.t), mix(c.v[0][1], c.v[1][1], p.t), u2);
  const double phi = 2 * kPi * (p.column + 0.5 + p.s) / width_;
  const double cos_theta = mix(cos_theta_[p.row], cos_theta_[p.row + 1], p.t);
  const double sin_theta = std::sqrt(std::max(0.0, 1 - cos_theta * cos_theta));
  return {std::sin(phi) * sin_theta, cos_theta, -std::cos(phi) * sin_theta};
}

double EnvironmentMap::pdf_solid_angle(const Vec3d& d) const {
  const double x = std::atan2(d.x, -d.z) * (width_ / (2 * kPi)) - 0.5;
  const double y = std::atan2(std::sqrt(d.x * d.x + d.z * d.z), d.y) * ((height_ - 1) / kPi);
  CellPoint p;
  const int left = static_cast<int>(std::floor(x));
  p.column = ((left % width_) + width_) % width_;
  p.row = std::clamp(static_cast<int>(y), 0, height_ - 2);
  p.s = x - left;
  const double top = cos_theta_[p.row];
  const double bottom = cos_theta_[p.row + 1];
  p.t = std::clamp((top - d.y) / (top - bottom), 0.0, 1.0);
  const Corners c = density_corners(p.column, p.row);
  const double mean = 0.25 * (c.v[0][0] + c.v[0][1] + c.v[1][0] + c.v[1][1]);
  const double bilinear = mix(mix(c.v[0][0], c.v[0][1], p.s), mix(c.v[1][0], c.v[1][1], p.s), p.t);
  const double* cdf = &column_cdf_[static_cast<size_t>(p.row) * (width_ + 1)];
  const double probability =
      (row_cdf_[p.row + 1] - row_cdf_[p.row]) * (cdf[p.column + 1] - cdf[p.column]);
  return probability * bilinear / (mean * cell_solid_angles_[p.row]);
}

// Along the azimuth a row's mean is its texels' mean; between two rows it is linear in theta, and
//   integral of (theta_1 - theta) / delta sin(theta) = cos(theta_0) - (sin(theta_1) -
//   sin(theta_0)) / delta, and alike for the other row.
double EnvironmentMap::mean_luminance() const {
  const auto row_mean = [this](int row) {
    double sum = 0;
    for (int column = 0; column < width_; ++column) {
      const float* c = texel(column, row);
      sum += luminance(Rgb<double>{c[0], c[1], c[2]});
    }
    return sum / width_;
  };
  double total = 0;
  double upper = row_mean(0);
  for (int row = 0; row + 1 < height_; ++row) {
    const double lower = row_mean(row + 1);
    const double theta_0 = polar_angle(row);
    const double theta_1 = polar_angle(row + 1);
    const double chord = (std::sin(theta_1) - std::sin(theta_0)) / (theta_1 - theta_0);
    total += upper * (std::cos(theta_0) - chord) + lower * (chord - std::cos(theta_1));
    upper = lower;
  }
  return 0.5 * total;
}

}  // namespace limn
