#pragma once
// Second moments of single samples, cell by cell: what a pilot keeps.
#include <array>
#include <cstddef>
#include <vector>

#include "limn/core/dual.h"

namespace limn {

// What one sample of a term adds: the derivatives of all parameters, and what turns of its
// directions about the three axes change in them, in the unit of MotionRates. scores: of turns; only
// of the term that traces paths.
struct TurnedSample {
  Rgb<Lanes> value;
  Rgb<Vec3d> turned;
  Rgb<Vec3d> scores;
};

// Turns about three axes, then their scores: they are alike for all parameters.
inline constexpr int kUnknowns = 6;

// Of one parameter's derivative (index 0) and the unknowns (from 1); symmetric, summed over
// channels.
struct Covariance {
  static constexpr int kFigures = 1 + kUnknowns;
  std::array<float, kFigures*(kFigures + 1) / 2> entries{};

  static constexpr size_t index(int i, int j) {
    return i < j ? index(j, i) : static_cast<size_t>(i * (i + 1) / 2 + j);
  }
  float& at(int i, int j) { return entries[index(i, j)]; }
  float at(int i, int j) const { return entries[index(i, j)]; }
};

// Covariances of one sample in every cell, for all parameters.
class CellCovariances {
 public:
  CellCovariances() = default;
  CellCovariances(size_t cells, int lanes) : lanes_(lanes), entries_(cells * stride()) {}

  bool empty() const { return entries_.empty(); }
  Covariance of(size_t cell, int lane) const;
  float variance(size_t cell, int lane) const {
    return entries_[cell * stride() + kShared + lane * Covariance::kFigures];
  }

 private:
  friend class CellSums;
  // In a cell: the lower triangle of the unknowns, then for every parameter its variance and its
  // covariances with them.
  static constexpr size_t kShared = kUnknowns * (kUnknowns + 1) / 2;
  size_t stride() const { return kShared + static_cast<size_t>(lanes_) * Covariance::kFigures; }

  int lanes_ = 0;
  std::vector<float> entries_;
};

// Sums over samples. Different cells may be added to by different threads.
class CellSums {
 public:
  CellSums(size_t cells, int lanes)
      : lanes_(lanes), first_(cells * first_stride()), second_(cells, lanes) {}

  bool empty() const { return second_.empty(); }
  void add(size_t cell, const TurnedSample& sample);
  // Of the samples since the last call, so many in every cell.
  CellCovariances take(int samples);

 private:
  size_t first_stride() const { return 3 * static_cast<size_t>(kUnknowns + lanes_); }

  int lanes_;
  std::vector<float> first_;  // of every cell and channel: the unknowns, then the parameters
  CellCovariances second_;
};

}  // namespace limn
