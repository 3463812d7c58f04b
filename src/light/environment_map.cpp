// Texels of an environment map, their sampling density, and their mean.
#include "src/light/environment_map.h"

#include <limits>

#include "limn/core/prefetch.h"

namespace limn {
namespace {

// Importance of a texel: luminance of absolute values, positive unless the texel is black.
float importance_of(const Rgb<double>& c) {
  const double v = luminance(Rgb<double>{std::fabs(c.r), std::fabs(c.g), std::fabs(c.b)});
  return v > 0 ? std::max(static_cast<float>(v), std::numeric_limits<float>::min()) : 0;
}

}  // namespace

EnvironmentMap::EnvironmentMap(const Image& image)
    : width_(image.width), height_(std::max(2, image.height)) {
  const bool halves = std::all_of(image.data.begin(), image.data.end(),
                                  [](float v) { return static_cast<float>(Half(v)) == v; });
  if (!halves) texels_.emplace<1>();
  std::visit([&](auto& texels) { fill(image, texels); }, texels_);
}

template <class Number>
void EnvironmentMap::fill(const Image& image, HugePageVector<Texel<Number>>& texels) {
  texels.reserve(static_cast<size_t>(width_) * height_);
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      Rgb<double> rgb;
      for (int c = 0; c < 3; ++c) {
        const float v = image.at(x, std::min(y, image.height - 1), image.channels == 3 ? c : 0);
        rgb[c] = v;
        mean_magnitude_ += std::fabs(rgb[c]);
      }
      texels.push_back({Number(rgb.r), Number(rgb.g), Number(rgb.b), Number(0.0f)});
    }
  }
  mean_magnitude_ /= 3.0 * static_cast<double>(texels.size());
}

const MapDensity& EnvironmentMap::make_density(Follows follows) const {
  const auto k = static_cast<size_t>(follows);
  const std::lock_guard lock(making_);
  if (!densities_[k]) made_[k] = &densities_[k].emplace(width_, height_, importance(follows));
  return *densities_[k];
}

std::vector<float> EnvironmentMap::importance(Follows follows) const {
  // Weight of light below the mean. Under a museum's light 1/16 and 0 had 1.05 and 0.95 of the
  // variance.
  constexpr double kDim = 1.0 / 32;
  std::vector<float> importance;
  importance.reserve(static_cast<size_t>(width_) * height_);
  with_texels([&](const auto* texels) {
    for (size_t i = 0; i < importance.capacity(); ++i) {
      const auto& c = texels[i];
      importance.push_back(importance_of({c[0], c[1], c[2]}));
    }
  });
  if (*std::max_element(importance.begin(), importance.end()) == 0) {
    importance.assign(importance.size(), 1.0f);
  }
  if (follows == Follows::kRadiance) return importance;
  double mean = 0;  // over solid angle, by the trapezoidal rule
  for (size_t i = 0; i < importance.size(); ++i) {
    const int row = static_cast<int>(i / static_cast<size_t>(width_));
    mean += importance[i] * (std::cos(polar_angle(std::max(row - 1, 0))) -
                             std::cos(polar_angle(std::min(row + 1, height_ - 1))));
  }
  mean /= 4.0 * width_;
  for (float& v : importance) {
    const double peak = std::max(v - mean, kDim * v);
    if (v > 0) v = std::max(static_cast<float>(peak), std::numeric_limits<float>::min());
  }
  return importance;
}

void EnvironmentMap::fetch_texels(int column, int row) const {
  with_texels([&](const auto* texels) {
    prefetch(&texels[index(column, row)]);
    prefetch(&texels[index(column, row + 1)]);
  });
}

void EnvironmentMap::fetch_texels(const Point<wide::Doubles>& place) const {
  using wide::Ints, wide::Mask;
  const Ints columns = wide::min(wide::truncated(place.x), Ints{} + (width_ - 1));
  const Ints rows = wide::min(wide::truncated(place.y), Ints{} + (height_ - 2));
  const Mask first =
      __builtin_convertvector(rows, Mask) * width_ + __builtin_convertvector(columns, Mask);
  with_texels([&](const auto* texels) {
    for (int i = 0; i < wide::kWidth; ++i) {
      prefetch(&texels[first[i]]);
      prefetch(&texels[first[i] + width_]);
    }
  });
}

EnvironmentMap::Drawn EnvironmentMap::sample(const MapDensity& density, const wide::Doubles& u1,
                                             const wide::Doubles& u2) const {
  using wide::Doubles;
  const auto [x, cos_theta, pdf] = density.sample(u1, u2);
  const Doubles sin_theta = sqrt(wide::max(1 - cos_theta * cos_theta, 0));
  const auto [sine, cosine] = sin_cos_of_turns((x + 0.5) * (1.0 / width_));
  const Point<Doubles> place{select(x < width_, x, 0),
                             angle_of(sin_theta, cos_theta) * ((height_ - 1) / kPi)};
  fetch_texels(place);
  return {{sine * sin_theta, cos_theta, -cosine * sin_theta}, place, pdf};
}

void EnvironmentMap::fetch(const Point<double>& place, const MapDensity& density) const {
  const int column = column_of(place.x), row = row_of(place.y);
  fetch_texels(column, row);
  density.fetch(column, row);
}

Image EnvironmentMap::texels() const {
  Image image(width_, height_, 3);
  with_texels([&](const auto* texels) {
    for (size_t i = 0; i < image.data.size(); ++i) {
      image.data[i] = static_cast<float>(texels[i / 3][i % 3]);
    }
  });
  return image;
}

std::array<Environment::TexelWeight, 4> EnvironmentMap::weights(const Point<double>& place) const {
  const int column = column_of(place.x), row = row_of(place.y), next = next_column(column);
  const double s = place.x - column, t = place.y - row;
  const auto at = [&](int x, int y) { return static_cast<uint32_t>(index(x, y)); };
  return {{{at(column, row), (1 - s) * (1 - t)},
           {at(next, row), s * (1 - t)},
           {at(column, row + 1), (1 - s) * t},
           {at(next, row + 1), s * t}}};
}

// A row's mean over azimuth is the mean of its texels, and linear in theta between two rows:
//   integral of (theta_1 - theta) / delta sin(theta) = cos(theta_0) - (sin(theta_1) -
//   sin(theta_0)) / delta, and likewise for the other row.
double EnvironmentMap::mean_luminance() const {
  const auto row_mean = [this](int row) {
    return with_texels([&](const auto* texels) {
      double sum = 0;
      for (int column = 0; column < width_; ++column) {
        const auto& c = texels[index(column, row)];
        sum += luminance(Rgb<double>{c[0], c[1], c[2]});
      }
      return sum / width_;
    });
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
