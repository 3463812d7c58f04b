#pragma once
// Scores of a gradient's residual: weighted sums over the image, with errors that hold where few
// events make them up.
#include <array>
#include <vector>

#include "limn/core/film.h"
#include "limn/integrators/differences.h"
#include "limn/integrators/gradient.h"

namespace limn {

// Tents over the film that add up to one, `spacing` pixels apart, from sums over blocks of `fine`
// pixels.
class Windows {
 public:
  Windows(const Film& film, int spacing, int fine);
  size_t size() const { return static_cast<size_t>(x_.count) * y_.count; }
  int fine() const { return fine_; }
  // Of values per block, one per window.
  std::vector<double> gather(const std::vector<double>& blocks) const;
  // The weight of every block, if windows have weights.
  std::vector<double> spread(const std::vector<double>& weights) const;

 private:
  // Along one axis: each block lies in two tents.
  struct Axis {
    int count = 0;  // of tents
    std::vector<int> first;
    std::vector<double> second_weight;  // the first has the rest
    Axis(int pixels, int spacing, int fine);
  };
  template <class Visit>
  void visit(const Visit& visit) const;
  int fine_;
  Axis x_, y_;
};

// A sum over the windows: weights for even and for odd batches, so that weights taken from one half
// of the batches meet the noise of the other.
using Probe = std::array<std::vector<double>, 2>;

struct Score {
  double value = 0;  // differences minus gradient
  double error = 0;
  double batch_error = 0;  // without what rare events that have not come would add
  double gradient_variance = 0, difference_variance = 0;  // of which the error is made
  double z = 0;
  bool widened() const { return error > batch_error; }
};

// Gradient and differences of one parameter, from independent runs of at least two batches.
class Residual {
 public:
  // radiance: of each block, the sum over pixels and channels. largest: how far at most a sample is
  // expected to jump within `step`, that of the differences; empty where no edges move, whose
  // samples' images are continuous.
  Residual(const Windows& windows, const GradientResult& gradient,
           const DifferenceEstimate& differences, const std::vector<double>& radiance,
           const std::vector<double>& largest, double step);

  Score score(const Probe& probe) const;
  // Of each window alone; those without any variance and value are left out.
  std::vector<Score> window_scores() const;
  double degrees() const { return degrees_; }

  // Where the term would show best: its mean over the variance, from the other half of the batches.
  // Weights are zero where there are too few batches for that.
  Probe term_probe(const Moments& term_blocks) const;
  // The mean of a term (or total) in the windows.
  std::vector<double> mean(const Moments& blocks) const { return windows_.gather(means(blocks)); }
  // The sum of its magnitudes there, without what noise adds.
  double magnitude(const Moments& blocks) const;

 private:
  using Batches = std::vector<Moments::Batch>;
  // Of each block: the magnitude of what rare events add, and the variances that this comes with
  // where none has come yet, if they are of mean size, or of the size that rules.
  struct Rare {
    std::vector<double> magnitude, of_mean_size, of_large_size;
  };
  Batches gather(const Moments& blocks) const;
  double rare(const Probe& probe, const Rare& variances) const;

  const Windows& windows_;
  Batches gradient_, differences_;  // sums of windows
  Rare rare_gradient_, rare_differences_;
  double degrees_;                // of freedom, of that run which has fewer
  std::vector<double> rounding_;  // of each window, a standard deviation
};

// The t value whose score is z.
double student_from_normal(double z, double degrees);

// The magnitude of what has this mean and standard error, without what noise adds to it: nothing is
// expected of a normal variable around zero, all of one that is far from it, at most half an error
// too little between.
double magnitude_without_noise(double mean, double error);

}  // namespace limn
