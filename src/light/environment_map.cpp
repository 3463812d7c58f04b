// The alias table over the cells of a map, and its density.
#include "src/light/environment_map.h"

#include <limits>

namespace limn {
namespace {

constexpr double kMeanShare = 1.0 / 16;  // see EnvironmentMap::sample

// Inverts the integral of the density a + (b - a) x on [0, 1], up to a factor; a + b > 0.
double sample_linear(double a, double b, double u) {
  return std::min(1.0, u * (a + b) / (a + std::sqrt(a * a * (1 - u) + b * b * u)));
}

// Luminance of the absolute values; above zero wherever a channel is not zero.
float importance(const std::array<float, 3>& c) {
  const double v = luminance(Rgb<double>{std::fabs(c[0]), std::fabs(c[1]), std::fabs(c[2])});
  return v > 0 ? std::max(static_cast<float>(v), std::numeric_limits<float>::min()) : 0;
}

double mix(double a, double b, double t) { return a + (b - a) * t; }

}  // namespace

EnvironmentMap::EnvironmentMap(const Image& image)
    : width_(image.width), height_(std::max(2, image.height)) {
  texels_.reserve(static_cast<size_t>(width_) * height_);
  bool black = true;
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      Texel texel;
      for (int c = 0; c < 3; ++c) {
        texel.rgb[c] = image.at(x, std::min(y, image.height - 1), image.channels == 3 ? c : 0);
      }
      texel.importance = importance(texel.rgb);
      black = black && texel.importance == 0;
      texels_.push_back(texel);
    }
  }
  if (black) {
    for (Texel& texel : texels_) texel.importance = 1;
  }
  build_distribution();
}

EnvironmentMap::Corners EnvironmentMap::density_corners(int column, int row) const {
  const int next = next_column(column);
  Corners corners = {{{texel(column, row).importance, texel(next, row).importance},
                      {texel(column, row + 1).importance, texel(next, row + 1).importance}}};
  const double mean =
      0.25 * (corners.v[0][0] + corners.v[0][1] + corners.v[1][0] + corners.v[1][1]);
  for (auto& line : corners.v) {
    for (double& v : line) v = mix(v, mean, kMeanShare);
  }
  return corners;
}

void EnvironmentMap::build_distribution() {
  const int rows = height_ - 1;
  for (int row = 0; row <= rows; ++row) cos_theta_.push_back(std::cos(polar_angle(row)));
  std::vector<double> weights;
  for (int row = 0; row < rows; ++row) {
    // cos(a) - cos(b) without cancellation, times the cell's azimuth.
    const double half = 0.5 * (polar_angle(row + 1) - polar_angle(row));
    const double middle = 0.5 * (polar_angle(row + 1) + polar_angle(row));
    const double solid_angle = 2 * std::sin(middle) * std::sin(half) * (2 * kPi / width_);
    for (int column = 0; column < width_; ++column) {
      const Corners c = density_corners(column, row);
      weights.push_back(0.25 * (c.v[0][0] + c.v[0][1] + c.v[1][0] + c.v[1][1]) * solid_angle);
    }
  }
  double total = 0;
  for (const double weight : weights) total += weight;
  inverse_total_ = 1 / total;
  build_aliases(weights);
}

// Vose 1991, "A linear algorithm for generating random numbers with a given distribution": every
// slot holds an equal share of the probability, filled by its own cell and at most one other.
void EnvironmentMap::build_aliases(const std::vector<double>& weights) {
  const size_t count = weights.size();
  slots_.resize(count);
  std::vector<double> filled(count);
  std::vector<uint32_t> small, large;
  for (uint32_t i = 0; i < count; ++i) {
    filled[i] = weights[i] * inverse_total_ * count;
    (filled[i] < 1 ? small : large).push_back(i);
  }
  while (!small.empty() && !large.empty()) {
    const uint32_t poor = small.back();
    const uint32_t rich = large.back();
    small.pop_back();
    slots_[poor] = {static_cast<float>(filled[poor]), rich};
    filled[rich] -= 1 - filled[poor];
    if (filled[rich] < 1) {
      large.pop_back();
      small.push_back(rich);
    }
  }
  // Slots left over are full but for rounding, which is far below one slot: so no cell without
  // weight is among them.
  for (const auto* rest : {&small, &large}) {
    for (const uint32_t i : *rest) slots_[i] = {1, i};
  }
}

Vec3d EnvironmentMap::sample(double u1, double u2) const {
  CellPoint p;
  const double place = u1 * slots_.size();
  auto cell =
      static_cast<uint32_t>(std::min<size_t>(static_cast<size_t>(place), slots_.size() - 1));
  u1 = place - cell;
  const Slot slot = slots_[cell];
  if (u1 < slot.share) {
    u1 /= slot.share;
  } else {
    u1 = (u1 - slot.share) / (1 - slot.share);
    cell = slot.alias;
  }
  p.row = static_cast<int>(cell) / width_;
  p.column = static_cast<int>(cell) % width_;
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
  return mix(mix(c.v[0][0], c.v[0][1], p.s), mix(c.v[1][0], c.v[1][1], p.s), p.t) * inverse_total_;
}

// Along the azimuth a row's mean is its texels' mean; between two rows it is linear in theta, and
//   integral of (theta_1 - theta) / delta sin(theta) = cos(theta_0) - (sin(theta_1) -
//   sin(theta_0)) / delta, and alike for the other row.
double EnvironmentMap::mean_luminance() const {
  const auto row_mean = [this](int row) {
    double sum = 0;
    for (int column = 0; column < width_; ++column) {
      const auto& c = texel(column, row).rgb;
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
