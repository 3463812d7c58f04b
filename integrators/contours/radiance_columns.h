#pragma once
// Integrals of an environment map along its meridians, summed from the pole on: what a piece of a
// line sends is a difference of two of them, however many texels it passes.
#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "limn/core/environment.h"
#include "limn/core/huge_pages.h"

namespace limn {

class RadianceColumns {
 public:
  // radiance(column, row) at the grid's points and at places between its rows; nothing is kept of
  // it. 64 bytes for every texel: InputError if memory does not hold them.
  using Lookup = std::function<Rgb<double>(int, double)>;
  RadianceColumns(const Environment::Grid& grid, const Lookup& radiance, int threads);
  // The columns of an environment, which must have a grid of texels.
  RadianceColumns(const Environment& environment, int threads);

  const Environment::Grid& grid() const { return grid_; }
  // How bright the map is around each column, from the azimuth of `zero` on towards `quarter`.
  std::vector<double> brightness() const;

  // Where a meridian is: between a column and the next, which has this share.
  struct Meridian {
    uint32_t column;
    float share;
  };
  Meridian meridian(const Vec3d& r) const;
  // columns: from column 0 towards `quarter`, at least 0 and below twice their number.
  Meridian meridian(double columns) const {
    columns -= columns < grid_.columns ? 0 : grid_.columns;
    const int column = std::clamp(static_cast<int>(columns), 0, grid_.columns - 1);
    return {static_cast<uint32_t>(column), static_cast<float>(columns - column)};
  }

  // With w = pole cos theta + r sin theta and n . w = along cos theta + across sin theta: the
  // integral of n . w L sin theta over theta from 0 [W / (m^2 sr) rad]. Exact for the bilinear map,
  // in between columns and rows, too, but for floats: the error is some 2^-24 of the integral of
  // |L| there.
  Rgb<double> up_to(const Meridian& at, double theta, double cos_theta, double sin_theta,
                    double along, double across) const;

  // Many such ends, on meridians of one point, as sums of cells.
  struct Ends {
    void resize(size_t size);
    size_t count = 0;            // that are in use
    std::vector<uint32_t> cell;  // before `weigh` a meridian's column, then the table's cell
    std::vector<float> share;    // of the next cell
    std::vector<float> across, sign;
    // The signed weights of the four colours of a cell.
    struct alignas(16) Weights {
      float of[4];
    };
    std::vector<Weights> weights;
  };
  // Sets the weights. theta: angles but for their signs, as many as there are ends.
  void weigh(std::span<const float> theta, float along, Ends& ends) const;
  // One end, whose sum is the radiance itself.
  void look(const Meridian& at, double theta, Ends& ends) const;
  Rgb<double> sum(const Ends& ends) const;

  // Reverse mode: adds dLoss/dsum to the derivatives for cells, of which `finish` calls
  // add(column, row, dLoss/dL) for all that was looked up.
  using Colour [[gnu::vector_size(32)]] = double;  // three, and padding
  using Adjoint = HugePageVector<std::array<Colour, 4>>;
  Adjoint zero_adjoint() const;  // InputError if it needs too much memory
  static void add(const Ends& ends, const Rgb<double>& d_sum, Adjoint& adjoint);
  void finish(Adjoint adjoint,
              const std::function<void(int, double, const Rgb<double>&)>& add) const;

 private:
  // Four colours, each with a number of padding, in one line of the cache: the integrals of
  // L cos theta sin theta and of L sin^2 theta up to a row, radiance there and in the next row.
  using Pair [[gnu::vector_size(32)]] = float;
  struct alignas(64) Cell {
    Pair integrals, radiance;
  };
  // In the integral over a part of a row, the weights of radiance in that row and in the next.
  template <class T>
  struct InRow {
    T here, below;
  };
  template <class T>
  static InRow<T> in_row(T t, T sine2, T cosine2, T along, T across, T per_step);
  void fill(const Lookup& radiance, int first, int last);

  Environment::Grid grid_;
  int finer_;  // rows here for one of the map
  int rows_;
  double step_, per_step_;  // between rows [rad], and its inverse
  size_t stride_;           // of rows: their last column is the first again
  struct Free {
    void operator()(Cell* cells) const { HugePageAllocator<Cell>().deallocate(cells, 0); }
  };
  std::unique_ptr<Cell[], Free> cells_;
  struct Row {
    InRow<double> pole, across;
  };
  std::vector<Row> whole_;
};

}  // namespace limn
