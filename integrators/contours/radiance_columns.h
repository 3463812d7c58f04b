#pragma once
// Integrals of an environment map along its meridians, summed from the pole on: what a piece of a
// line sends is a difference of two of them, however many texels it passes.
#include <functional>
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

  struct Meridian {
    size_t first, second;  // of the columns around it, the beginning of their sums
    double share;          // of the second
  };
  Meridian meridian(const Vec3d& r) const;
  Meridian meridian(double turn) const;  // azimuth from `zero` towards `quarter` [turns, 0 to 1]

  // With w = pole cos theta + r sin theta and n . w = along cos theta + across sin theta: the
  // integral of n . w L sin theta over theta from 0 [W / (m^2 sr) rad]. Exact for the bilinear map,
  // in between columns and rows, too. On every meridian it is a sum with these weights:
  struct Weights {
    int row;               // before theta: the integrals up to there count `along` and `across`
    double along, across;  // times
    double here, below;    // of the texels in that row and in the next
  };
  Weights weights(double theta, double cos_theta, double sin_theta, double along,
                  double across) const;
  Rgb<double> sum(const Meridian& at, const Weights& weights) const;

  // Three colours, and one number of padding.
  using Colour [[gnu::vector_size(32)]] = double;
  // In a row of a column: radiance, and the integrals of L cos theta sin theta and L sin^2 theta up
  // to there.
  struct Cell {
    Colour texel{}, pole{}, across{};
  };
  // Reverse mode: adds dLoss/dsum to the derivatives for cells, of which
  // `finish` calls add(w, dLoss/dL) for each direction w whose radiance was looked up.
  using Adjoint = std::vector<Cell>;
  Adjoint zero_adjoint() const { return Adjoint(cells_.size()); }
  static void add(const Meridian& at, const Weights& weights, const Rgb<double>& d_sum,
                  Adjoint& adjoint);
  void finish(Adjoint adjoint,
              const std::function<void(const Vec3d&, const Rgb<double>&)>& add) const;

 private:
  struct Moments {
    double pole, across;                // of 1
    double pole_linear, across_linear;  // of theta
  };
  static Moments moments(double theta, double c, double s);
  // Weights, in the integrals from a row on, of the texels of that row (here) and the next (below).
  struct InRow {
    double pole_here, pole_below, across_here, across_below;
  };
  InRow in_row(int row, const Moments& end) const;
  void add_up(Cell* column) const;  // from its texels
  Vec3d azimuth(int column) const;
  Vec3d direction(int column, int row) const;

  Environment::Grid grid_;
  double step_, per_step_;  // between rows [rad], and its inverse
  // Cells from one column to the next. Of a power of two, cells of one row would share few places
  // in caches.
  size_t stride_;
  std::vector<Cell> cells_;  // columns by rows, and what fills up the stride
  std::vector<Moments> at_rows_;
};

}  // namespace limn
