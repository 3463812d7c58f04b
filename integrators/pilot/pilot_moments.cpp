// Sums of products of what single samples add.
#include "integrators/pilot/pilot_moments.h"

#include <algorithm>
#include <utility>

namespace limn {

void CellSums::add(size_t cell, const TurnedSample& sample) {
  for (int c = 0; c < 3; ++c) {
    float x[kUnknowns + kLanes];
    for (int k = 0; k < 3; ++k) {
      x[k] = static_cast<float>(sample.turned[c][k]);
      x[3 + k] = static_cast<float>(sample.scores[c][k]);
    }
    for (int k = 0; k < parameters_; ++k) x[kUnknowns + k] = static_cast<float>(sample.value[c][k]);
    float* first = &first_[cell * first_size() + c * (kUnknowns + parameters_)];
    for (int i = 0; i < kUnknowns + parameters_; ++i) first[i] += x[i];
    float* second = second_.entries(cell);
    for (int i = 0; i < kUnknowns; ++i) {
      for (int j = 0; j <= i; ++j) *second++ += x[i] * x[j];
    }
    for (int k = kUnknowns; k < kUnknowns + parameters_; ++k) {
      *second++ += x[k] * x[k];
      for (int i = 0; i < kUnknowns; ++i) *second++ += x[k] * x[i];
    }
  }
}

CellCovariances CellSums::take(int samples) {
  const auto n = static_cast<float>(samples);
  for (size_t cell = 0; cell < cells_; ++cell) {
    const float* first = &first_[cell * first_size()];
    const auto subtract_means = [&](float& entry, int i, int j) {
      float products = 0;
      for (int c = 0; c < 3; ++c) {
        products +=
            first[c * (kUnknowns + parameters_) + i] * first[c * (kUnknowns + parameters_) + j];
      }
      entry = (entry - products / n) / (n - 1);
    };
    float* second = second_.entries(cell);
    for (int i = 0; i < kUnknowns; ++i) {
      for (int j = 0; j <= i; ++j) subtract_means(*second++, i, j);
    }
    for (int k = kUnknowns; k < kUnknowns + parameters_; ++k) {
      subtract_means(*second++, k, k);
      for (int i = 0; i < kUnknowns; ++i) subtract_means(*second++, k, i);
    }
  }
  CellCovariances result = std::exchange(second_, CellCovariances(cells_, parameters_));
  std::fill(first_.begin(), first_.end(), 0.0f);
  return result;
}

}  // namespace limn
