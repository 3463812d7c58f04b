#pragma once
// How the samples of reverse mode are split: into a number of equal batches at most, to a sample.
// Where time is limited they are of one size, so that a run without limit that has as many samples
// and batches has the same bits.
#include "limn/integrators/run.h"

namespace limn {

class EqualBatches {
 public:
  // `watch` runs since the job began.
  EqualBatches(const RunSettings& settings, const Stopwatch& watch, int most)
      : settings_(settings), watch_(watch), most_(most) {}
  // Whether set_size() must be called before next().
  bool needs_size() const { return settings_.seconds > 0; }
  // one_sample: seconds that the first sample has taken just now, which is the first batch where
  // batches have one sample.
  void set_size(double one_sample);
  // Goes to the next batch; false if all samples are done or no other fits.
  bool next();
  int first_sample() const { return first_; }
  int end_sample() const { return end_; }

 private:
  const RunSettings& settings_;
  const Stopwatch& watch_;
  int most_;
  int first_ = 0, end_ = 0;
  int begun_ = 0;  // batches
  int size_ = 0;
  double since_ = 0, expected_ = 0;  // when batches began, what one is expected to take
};

}  // namespace limn
