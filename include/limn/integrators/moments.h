#pragma once
// Means and standard errors of images from independent batches.
#include <cstdint>
#include <vector>

#include "limn/core/image.h"

namespace limn {

// Every value is an average over samples that come in batches. Batch b gives the sum S_b over its
// n_b samples. With N = sum n_b the mean is m = sum S_b / N, and its variance is estimated by
//   sum (S_b - n_b m)^2 / (N^2 - sum n_b^2),
// which is unbiased if that of S_b is in proportion to n_b, as it is for independent samples. The
// numbers of large batches may be more even than those of small ones, and S_b have less variance
// for its samples: with a and b, the averages of n_b / N over samples and over the variance of the
// mean, the estimate is then too large by 2 (a - b) / (1 - a): a few per cent where that is so, and
// too small by 3 % at most where even numbers do harm (products of ranges, in batches of 2 and 4).
class Moments {
 public:
  Moments() = default;
  // keep: remember the sums of every batch, for tests that need more than means and variances.
  explicit Moments(size_t size, bool keep = false)
      : sums_(size), centers_(size), squares_(size), keep_(keep) {}

  size_t size() const { return sums_.size(); }
  int batches() const { return batches_; }
  int64_t samples() const { return samples_; }

  // sums: one value per element, the sum over `samples` samples.
  void add_batch(const std::vector<double>& sums, int64_t samples);
  // A value that no chance is in: as two batches that are alike, so that its variance is 0.
  void add_exact(const std::vector<double>& values) {
    add_batch(values, 1);
    add_batch(values, 1);
  }
  double mean(size_t i) const { return samples_ > 0 ? sums_[i] / samples_ : 0; }
  // The variance of the mean; needs two batches.
  double variance(size_t i) const;
  // Of freedom, behind the variances: N^2 / sum n_b^2 - 1, one less than there are batches if these
  // are equal.
  double degrees() const;

  // One batch, as it was added.
  struct Batch {
    std::vector<double> sums;
    int64_t samples = 0;
  };
  // In the order they came; empty unless they are kept.
  const std::vector<Batch>& kept() const { return kept_; }

 private:
  // Of S_b; the mean c of S_b / n_b weighed by n_b^2; the sum of (S_b - n_b c)^2.
  std::vector<double> sums_, centers_, squares_;
  std::vector<Batch> kept_;
  bool keep_ = false;
  int batches_ = 0;
  int64_t samples_ = 0;
  double squared_samples_ = 0;  // sum of n_b^2
};

// Means and variances of every value; variances are NaN with fewer than two batches.
std::vector<double> means(const Moments& moments);
std::vector<double> variances(const Moments& moments);

// H by W by 3 images of the means and of the standard errors (NaN with fewer than two batches).
Image mean_image(const Moments& moments, int width, int height);
Image standard_error_image(const Moments& moments, int width, int height);

// Sums over the pixels and channels of square blocks: H by W by 3 values become ceil(H / block) by
// ceil(W / block).
size_t block_count(int width, int height, int block);
std::vector<double> sum_blocks(const std::vector<double>& values, int width, int height, int block);

}  // namespace limn
