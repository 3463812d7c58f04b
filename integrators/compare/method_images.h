#pragma once
// From moments to what methods are compared by.
#include <vector>

#include "limn/integrators/metrics.h"
#include "limn/integrators/moments.h"

namespace limn {

std::vector<double> means(const Moments& moments);
std::vector<double> variances(const Moments& moments);  // NaN with fewer than two batches
BlockSums block_sums(const Moments& blocks, const Events& events);

}  // namespace limn
