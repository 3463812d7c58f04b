// How large the events are that edges make, from batches.
#include "integrators/compare/edge_events.h"

#include <cmath>

namespace limn {

EventSizes event_sizes(const std::vector<Moments::Batch>& batches) {
  EventSizes events;
  if (batches.empty()) return events;
  double samples = 0, squared_samples = 0;
  std::vector<double> means(batches[0].sums.size());
  if (batches.size() > 1) {
    for (const Moments::Batch& batch : batches) {
      samples += static_cast<double>(batch.samples);
      squared_samples += static_cast<double>(batch.samples * batch.samples);
      for (size_t i = 0; i < means.size(); ++i) means[i] += batch.sums[i];
    }
    for (double& mean : means) mean /= samples;
  }
  double sizes = 0, squares = 0, cubes = 0;
  for (const Moments::Batch& batch : batches) {
    for (size_t i = 0; i < means.size(); ++i) {
      const double x = batch.sums[i];
      const double d = std::fabs(x - means[i] * static_cast<double>(batch.samples));
      sizes += std::fabs(x);
      squares += d * d;
      cubes += d * d * d;
    }
  }
  const double all = samples * samples;
  const double fewer = batches.size() > 1 ? all / (all - squared_samples) : 1;
  if (sizes > 0) events.mean = squares * fewer / sizes;
  if (squares > 0) events.large = cubes / squares;
  return events;
}

std::vector<Moments::Batch> batches_of_edges(const GradientResult& result) {
  std::vector<Moments::Batch> batches;
  for (size_t t = 0; t < result.terms.size(); ++t) {
    if (!result.terms[t].computed || !result.terms[t].edges) continue;
    const auto& more = result.parameters[0].term_blocks[t].kept();
    if (batches.empty()) {
      batches = more;
      continue;
    }
    for (size_t b = 0; b < batches.size(); ++b)
      for (size_t i = 0; i < batches[b].sums.size(); ++i) batches[b].sums[i] += more[b].sums[i];
  }
  return batches;
}

BlockSums block_sums(const GradientResult& result) {
  const Moments& blocks = result.parameters[0].total_blocks;
  BlockSums sums;
  sums.sums = means(blocks);
  if (blocks.batches() > 1) sums.variances = variances(blocks);
  sums.degrees = blocks.degrees();
  if (blocks.samples() > 0) {
    sums.event = event_sizes(batches_of_edges(result)).mean / static_cast<double>(blocks.samples());
  }
  return sums;
}

}  // namespace limn
