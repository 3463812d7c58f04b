#pragma once
// The events that edges make in a derivative: a few samples of great value. In places where none
// has come yet, batches show no variance; but all places together show how large an event is.
#include <vector>

#include "limn/integrators/gradient.h"
#include "limn/integrators/metrics.h"

namespace limn {

struct EventSizes {
  double mean = 0;   // a mean of m (per sample) comes with a variance of |m| times this
  double large = 0;  // of those that make up most of the variance
};
// From the sums of batches. Of a batch of many samples the mean is no event: events are what is
// left without it, so that their size does not grow with that of the batches. Of a single batch
// all counts, which is too much unless it has few samples.
EventSizes event_sizes(const std::vector<Moments::Batch>& batches);

// The blocks' batches of all terms of edges of the first parameter together.
std::vector<Moments::Batch> batches_of_edges(const GradientResult& result);

// What a comparison needs to know of a run's blocks (GradientOptions::block): its first parameter.
BlockSums block_sums(const GradientResult& result);

}  // namespace limn
