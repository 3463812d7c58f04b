#pragma once
// Integrals of an environment map along its meridians, summed from the pole on: what a piece of a
// line sends is a difference of two of them, however many texels it passes.
#include <vector>

#include "limn/core/environment.h"

namespace limn {

class RadianceColumns {
 public:
  // The environment must have a grid; nothing is kept of it. Three colours for every texel:
  // InputError if memory does not hold them.
  RadianceColumns(const Environment& environment, int threads);

  const Environment::Grid& grid() const { return grid_; }
  // How bright the map is around each column, from the azimuth of `zero` on towards `quarter`.
  std::vector<double> brightness() const;
  // With w = pole cos theta + r sin theta, r at an azimuth: the integrals of L cos theta sin theta
  // (along the pole) and L sin^2 theta (along r) over theta from 0 [W / (m^2 sr) rad]. Exact for
  // the bilinear map, in between columns and rows, too.
  struct Sum {
    Rgb<double> pole, across;
  };
  struct Meridian {
    size_t first, second;  // of the columns around it, the beginning of their sums
    double share;          // of the second
  };
  Meridian meridian(const Vec3d& r) const;
  Sum sum(const Meridian& at, double cos_theta, double sin_theta) const;

 private:
  struct Moments {
    double pole, across;                // of 1
    double pole_linear, across_linear;  // of theta
  };
  static Moments moments(double theta, double c, double s);
  Rgb<double> texel(size_t column, int row) const { return texels_[column + row]; }

  Environment::Grid grid_;
  double step_;                      // between rows [rad]
  std::vector<Rgb<double>> texels_;  // columns by rows
  std::vector<Sum> sums_;            // columns by rows: up to each
  std::vector<Moments> at_rows_;
};

}  // namespace limn
