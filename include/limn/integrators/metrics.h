#pragma once
// How far an image is from a reference, when both are noisy. Images are H by W by 3, per unit of
// the parameter; means and sums run over pixels and channels alike.
#include <optional>
#include <vector>

#include "limn/integrators/moments.h"
#include "limn/integrators/statistics.h"

namespace limn {

struct ImageErrors {
  // Mean of (image - reference)^2 minus the mean variance of the reference: unbiased, hence below
  // zero now and then for an image that is nearly as good as the reference.
  double mse = 0;
  double relative_mse = 0;  // mse / mean of reference^2; NaN for a black reference
  // The same as mse without the trimmed_pixels() of the largest errors.
  double trimmed_mse = 0;
};
// A thousandth of the pixels, rounded.
size_t trimmed_pixels(size_t pixels);
ImageErrors image_errors(const std::vector<double>& image, const std::vector<double>& reference,
                         const std::vector<double>& reference_variance);

// A value with its standard error; NaN where one cannot be known.
struct Uncertain {
  double value = 0;
  double error = 0;
};
// Mean of independent repeats, its error from their spread.
Uncertain mean_of_repeats(const std::vector<double>& values);

// Sums over blocks of pixels (moments.h) of one run or of the reference. Without variances the
// spread over repeats has to do.
struct BlockSums {
  std::vector<double> sums;
  std::vector<double> variances;  // of the sums; empty if unknown
  double degrees = 0;             // of freedom behind the variances
  // Mean size of the events that edges make (rare samples of great value) over the number of
  // samples per pixel; 0 if unknown. If the method is right, edges that add m to a block's mean do
  // so with a variance of about m times this, even where no event has come.
  double event = 0;
};

// z-scores of the blocks: mean over the repeats minus the reference, over the standard error of
// both. Student's t, turned into normal scores, with the fewer degrees of freedom of the two: a few
// repeats that agree by chance must not pass for precise (as they would with the degrees of Welch
// and Satterthwaite). Blocks without any variance that are equal, both but for the rounding of
// floats, are left out. Empty if no variance is known: one repeat without variances of its own.
// edges: magnitude of what edges add to each block of the reference, for the variance of events; a
// reference without variance in a block has that of events that add the mean over the repeats.
std::vector<double> bias_scores(const std::vector<BlockSums>& repeats, const BlockSums& reference,
                                const std::vector<double>& edges);

// Two-sided p-value of a whole set of scores: the smaller of summarize()'s two, doubled.
double p_value(const ZSummary& summary);

// Slope of log error over log seconds, by least squares over runs; its error from those of
// the runs. Those with an error of zero or below are left out; none if fewer than two are left.
struct TimedError {
  double seconds = 0;
  Uncertain error;
};
std::optional<Uncertain> log_log_slope(const std::vector<TimedError>& runs);

// error * seconds of runs: what stays the same as a run gets longer. The ratio of the means is the
// time that `method` needs for the same error over the time that `baseline` needs. None unless both
// means are positive.
std::optional<Uncertain> time_ratio(const std::vector<double>& method,
                                    const std::vector<double>& baseline);

}  // namespace limn
