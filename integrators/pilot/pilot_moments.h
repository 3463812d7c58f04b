#pragma once
// Second moments of single samples, cell by cell: what a pilot keeps.
#include <cstddef>
#include <vector>

#include "limn/core/dual.h"

namespace limn {

// What one sample of a term adds.
struct TurnedSample {
  Rgb<Lanes> value;  // the derivatives of all parameters
  // What turns of its directions about the three axes (lanes 0 to 2), in the unit of MotionRates,
  // change in them; and the scores of these, for the term that traces paths.
  Rgb<Lanes> turned, scores;
};

// Turns about three axes, then their scores: they are alike for all parameters.
inline constexpr int kUnknowns = 6;

// Covariances of one sample's figures, or weighted sums of some, summed over channels: a view.
class Covariances {
 public:
  explicit Covariances(const float* entries) : entries_(entries) {}
  // Of two unknowns.
  float of(int i, int j) const { return i < j ? of(j, i) : entries_[i * (i + 1) / 2 + j]; }
  float variance(int parameter) const { return own(parameter)[0]; }
  float with(int parameter, int unknown) const { return own(parameter)[1 + unknown]; }
  // An unbiased estimate of the mean's square; it may be negative.
  float squared_mean(int parameter) const { return own(parameter)[1 + kUnknowns]; }

  static size_t size(int parameters) { return kShared + static_cast<size_t>(parameters) * kOwn; }

 private:
  static constexpr size_t kShared = kUnknowns * (kUnknowns + 1) / 2, kOwn = kUnknowns + 2;
  const float* own(int parameter) const {
    return entries_ + kShared + static_cast<size_t>(parameter) * kOwn;
  }
  // The lower triangle of the unknowns, then for every parameter its variance, its covariances with
  // them, and its squared mean.
  const float* entries_;
};

// Of every cell.
class CellCovariances {
 public:
  CellCovariances() = default;
  CellCovariances(size_t cells, int parameters)
      : size_(Covariances::size(parameters)), entries_(cells * size_) {}

  bool empty() const { return entries_.empty(); }
  Covariances operator[](size_t cell) const { return Covariances(entries(cell)); }
  // What a view is of: numbers that can be summed.
  size_t size() const { return size_; }
  const float* entries(size_t cell) const { return &entries_[cell * size_]; }
  float* entries(size_t cell) { return &entries_[cell * size_]; }

 private:
  size_t size_ = 0;
  std::vector<float> entries_;
};

// Sums over samples. Different cells may be added to by different threads.
class CellSums {
 public:
  CellSums(size_t cells, int parameters)
      : parameters_(parameters),
        cells_(cells),
        first_(cells * first_size()),
        second_(cells, parameters) {}

  bool empty() const { return second_.empty(); }
  void add(size_t cell, const TurnedSample& sample);
  // Of the samples since the last call, so many in every cell.
  CellCovariances take(int samples);

 private:
  size_t first_size() const { return 3 * static_cast<size_t>(kUnknowns + parameters_); }

  int parameters_;
  size_t cells_;
  std::vector<float> first_;  // of every cell and channel: the unknowns, then the parameters
  CellCovariances second_;
};

// What several samples at the vertices of a path leave of the variance of one: the share of the
// path, and of the rest samples^-power, which is 1 for independent draws and up to 2 for stratified
// ones.
struct DrawShares {
  double kept = 0;
  double power = 1;
};

// Sums over paths whose vertices have one sample, x_1, and the mean of two others, x_2.
class PairSums {
 public:
  PairSums(size_t cells, int parameters) : parameters_(parameters), cells_(cells * parameters) {}

  bool empty() const { return cells_.empty(); }

  void add(size_t cell, const Rgb<Lanes>& one, const Rgb<Lanes>& two);
  // Without the thousandth of the cells that varies most.
  DrawShares shares(int parameter) const;
  void merge(const PairSums& other);

 private:
  struct Cell {
    int samples = 0;
    float sums[2][3] = {};   // by channel
    float products[3] = {};  // x_1^2, x_2^2, x_1 x_2, summed over channels
  };
  int parameters_;
  std::vector<Cell> cells_;
};

}  // namespace limn
