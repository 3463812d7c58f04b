#pragma once
// A radiance map over the sphere in its local frame (+Y up): lookup, importance sampling,
// mean.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <mutex>
#include <optional>
#include <variant>
#include <vector>

#include "limn/core/dual.h"
#include "limn/core/environment.h"
#include "limn/core/huge_pages.h"
#include "limn/core/image.h"
#include "limn/core/vec.h"
#include "src/base/angles.h"
#include "src/base/half.h"
#include "src/light/map_density.h"

namespace limn {

// Mitsuba 3's convention. Azimuth phi = 2 pi u, u = atan2(x, -z) / 2 pi; polar angle theta = pi w
// from +Y; direction (sin phi sin theta, cos theta, -cos phi sin theta). The texel in column i, row
// j lies at u = (i + 1/2) / W (wrapped), w = j / (H - 1). Between four texels radiance is bilinear
// in (u, w): continuous on the sphere but for the poles, where it depends on the azimuth of
// approach unless the outer rows are constant (as they are in Mitsuba).
//
// A cell is the patch between four neighbouring texels; there are W by H - 1.
class EnvironmentMap {
 public:
  // One or three channels; at least one texel, all finite. A single row is used for all polar
  // angles.
  explicit EnvironmentMap(const Image& image);

  // Map coordinates of a direction: columns to the right of the center of column 0, in [0, W); rows
  // below row 0, in [0, H - 1].
  template <class S>
  struct Point {
    S x, y;
  };
  template <class S>
  Point<S> locate(const Vec3<S>& d) const;
  template <class S>
  Rgb<S> radiance(const Point<S>& place) const;

  // What a density of directions follows. It is positive wherever radiance is not zero, negative
  // texels included. An all-black map is sampled uniformly.
  enum class Follows {
    kRadiance,  // the luminance of the texels' absolute values
    // The same beyond its mean, and a little of what is darker: for draws that are combined with
    // scattering's by multiple importance sampling, which find dim light as well (MIS compensation,
    // Karlik et al. 2019). Images of diffuse surfaces under a museum's light have 0.6 of the
    // variance, of rough metal 0.9.
    kPeaks
  };
  // Made when it is first asked for. Thread-safe.
  const MapDensity& density(Follows follows) const {
    const auto* made = made_[static_cast<size_t>(follows)].load(std::memory_order_acquire);
    return made ? *made : make_density(follows);
  }
  // Prefetches the data that `radiance` and `pdf_solid_angle` will read.
  void fetch(const Point<double>& place, const MapDensity& density) const;

  // Eight samples.
  struct Drawn {
    wide::Vec direction;
    Point<wide::Doubles> place;
    wide::Doubles pdf;  // [1/sr]
  };
  // Also prefetches the texels.
  Drawn sample(const MapDensity& density, const wide::Doubles& u1, const wide::Doubles& u2) const;
  // place: of d. Density with respect to solid angle [1/sr].
  double pdf_solid_angle(const MapDensity& density, const Point<double>& place,
                         const Vec3d& d) const {
    return density.pdf(column_of(place.x), row_of(place.y), place.x, d.y);
  }

  // Texels and texel weights as in Environment.
  Image texels() const;
  std::array<Environment::TexelWeight, 4> weights(const Point<double>& place) const;

  // Exact mean of the luminance of `radiance` over the sphere.
  double mean_luminance() const;

  int width() const { return width_; }
  int height() const { return height_; }
  double mean_magnitude() const { return mean_magnitude_; }  // of the texels' channels

 private:
  // Red, green, blue, and padding, so that a texel never spans two cache lines.
  template <class Number>
  using Texel = std::array<Number, 4>;
  // Half floats if all texels are representable, as in most files: half of the cache misses.
  using Texels = std::variant<HugePageVector<Texel<Half>>, HugePageVector<Texel<float>>>;

  size_t index(int column, int row) const { return static_cast<size_t>(row) * width_ + column; }
  // Calls f with the stored texels.
  template <class F>
  auto with_texels(F f) const {
    if (const auto* halves = std::get_if<0>(&texels_)) return f(halves->data());
    return f(std::get<1>(texels_).data());
  }
  void fetch_texels(int column, int row) const;
  void fetch_texels(const Point<wide::Doubles>& place) const;
  int next_column(int column) const { return column + 1 == width_ ? 0 : column + 1; }
  double polar_angle(int row) const { return kPi * row / (height_ - 1); }
  template <class Number>
  void fill(const Image& image, HugePageVector<Texel<Number>>& texels);
  const MapDensity& make_density(Follows follows) const;
  std::vector<float> importance(Follows follows) const;
  // The cell's first column and row; clamped, as rounding may put a position on the far border.
  int column_of(double x) const { return std::min(static_cast<int>(x), width_ - 1); }
  int row_of(double y) const { return std::clamp(static_cast<int>(y), 0, height_ - 2); }

  int width_ = 0;
  int height_ = 0;  // at least 2
  Texels texels_;   // height_ x width_
  double mean_magnitude_ = 0;
  mutable std::mutex making_;
  mutable std::array<std::optional<MapDensity>, 2> densities_;
  mutable std::array<std::atomic<const MapDensity*>, 2> made_{};
};

template <class S>
EnvironmentMap::Point<S> EnvironmentMap::locate(const Vec3<S>& d) const {
  using std::sqrt;
  const S x = angle_of(d.x, -d.z) * (width_ / (2 * kPi)) - 0.5;
  const S y = angle_of(sqrt(d.x * d.x + d.z * d.z), d.y) * ((height_ - 1) / kPi);
  if constexpr (std::is_same_v<S, wide::Doubles>) {
    return {select(x < 0, x + width_, x), y};
  } else {
    return {value(x) < 0 ? S(x + static_cast<double>(width_)) : x, y};
  }
}

template <class S>
Rgb<S> EnvironmentMap::radiance(const Point<S>& place) const {
  const int column = column_of(value(place.x));
  const int row = row_of(value(place.y));
  const S s = place.x - static_cast<double>(column);
  const S t = place.y - static_cast<double>(row);
  const int next = next_column(column);
  return with_texels([&](const auto* texels) {
    decltype(texels) corners[4] = {&texels[index(column, row)], &texels[index(next, row)],
                                   &texels[index(column, row + 1)], &texels[index(next, row + 1)]};
    if constexpr (std::is_same_v<S, double>) {
      const auto corner = [&](int i) { return to_doubles(*corners[i]); };
      const FourDoubles top = corner(0) + s * (corner(1) - corner(0));
      const FourDoubles bottom = corner(2) + s * (corner(3) - corner(2));
      const FourDoubles c = top + t * (bottom - top);
      return Rgb<S>{c[0], c[1], c[2]};
    }
    Rgb<S> result;
    for (int c = 0; c < 3; ++c) {
      const auto corner = [&](int i) { return static_cast<double>((*corners[i])[c]); };
      const S top = corner(0) + s * (corner(1) - corner(0));
      const S bottom = corner(2) + s * (corner(3) - corner(2));
      result[c] = top + t * (bottom - top);
    }
    return result;
  });
}

}  // namespace limn
