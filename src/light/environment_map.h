#pragma once
// A radiance map over the sphere in the direction space of the map itself (+Y up): look-up,
// importance sampling, mean.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "limn/core/dual.h"
#include "limn/core/image.h"
#include "limn/core/vec.h"
#include "src/base/huge_pages.h"

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
  // One or three channels; at least one texel, all finite. A single row stands for all.
  explicit EnvironmentMap(const Image& image);

  template <class S>
  Rgb<S> radiance(const Vec3<S>& d) const;

  // The density follows the luminance of the absolute values of the texels: it is positive
  // wherever radiance is not zero, negative texels included. A cell is drawn in proportion to the
  // mean of its corners times its solid angle (so the cell's probability drops out of the density);
  // within it the density is bilinear in azimuth and cos(theta) through the corners' luminances,
  // each mixed with a little of their mean (where one side of a cell is black, radiance falls to
  // zero with theta but the density with cos(theta), and near a pole their ratio would grow without
  // bound). An all-black map is sampled uniformly.
  Vec3d sample(double u1, double u2) const;
  double pdf_solid_angle(const Vec3d& d) const;  // [1/sr]

  // The exact mean over the sphere of the luminance of `radiance`.
  double mean_luminance() const;

  int width() const { return width_; }
  int height() const { return height_; }

 private:
  // A position in a cell: fractions along azimuth and along cos(theta), both in [0, 1].
  struct CellPoint {
    int column = 0;
    int row = 0;
    double s = 0;
    double t = 0;
  };
  // The four values at a cell's corners: [along t][along s].
  struct Corners {
    double v[2][2];
  };

  // Radiance, and what the sampling density follows: together, as they are looked up together.
  struct Texel {
    std::array<float, 3> rgb;
    float importance;
  };
  // One of as many equally likely slots as there are cells: its first `share` belongs to the cell
  // of the slot's own index, the rest to `alias`.
  struct Slot {
    float share;
    uint32_t alias;
  };

  const Texel& texel(int column, int row) const {
    return texels_[static_cast<size_t>(row) * width_ + column];
  }
  int next_column(int column) const { return column + 1 == width_ ? 0 : column + 1; }
  double polar_angle(int row) const { return kPi * row / (height_ - 1); }
  Corners density_corners(int column, int row) const;
  void build_distribution();
  void build_aliases(const std::vector<double>& weights);

  int width_ = 0;
  int height_ = 0;                 // at least 2
  HugePageVector<Texel> texels_;   // height_ x width_
  HugePageVector<Slot> slots_;     // of cells, height_ - 1 x width_
  double inverse_total_ = 0;       // 1 / integral over the sphere of what the density follows
  std::vector<double> cos_theta_;  // of each row of texels (height_)
};

template <class S>
Rgb<S> EnvironmentMap::radiance(const Vec3<S>& d) const {
  using std::atan2;
  using std::sqrt;
  const S x = atan2(d.x, -d.z) * (width_ / (2 * kPi)) - 0.5;
  const S y = atan2(sqrt(d.x * d.x + d.z * d.z), d.y) * ((height_ - 1) / kPi);
  const int left = static_cast<int>(std::floor(value(x)));
  const int row = std::clamp(static_cast<int>(value(y)), 0, height_ - 2);
  const S s = x - static_cast<double>(left);
  const S t = y - static_cast<double>(row);
  const int column = ((left % width_) + width_) % width_;
  const int next = next_column(column);
  const std::array<float, 3>* corners[4] = {&texel(column, row).rgb, &texel(next, row).rgb,
                                            &texel(column, row + 1).rgb, &texel(next, row + 1).rgb};
  Rgb<S> result;
  for (int c = 0; c < 3; ++c) {
    const auto corner = [&](int i) { return static_cast<double>((*corners[i])[c]); };
    const S top = corner(0) + s * (corner(1) - corner(0));
    const S bottom = corner(2) + s * (corner(3) - corner(2));
    result[c] = top + t * (bottom - top);
  }
  return result;
}

}  // namespace limn
