// Sums of products of what single samples add.
#include "integrators/methods/pilot_moments.h"

namespace limn {

Covariance CellCovariances::of(size_t cell, int lane) const {
  const float* shared = &entries_[cell * stride()];
  const float* own = shared + kShared + lane * Covariance::kFigures;
  Covariance result;
  for (int i = 0; i <= kUnknowns; ++i) result.at(i, 0) = own[i];
  for (int i = 1; i <= kUnknowns; ++i) {
    for (int j = 1; j <= i; ++j) result.at(i, j) = *shared++;
  }
  return result;
}

void CellSums::add(size_t cell, const TurnedSample& sample) {
  for (int c = 0; c < 3; ++c) {
    float x[kUnknowns + kLanes];
    for (int k = 0; k < 3; ++k) {
      x[k] = static_cast<float>(sample.turned[c][k]);
      x[3 + k] = static_cast<float>(sample.scores[c][k]);
    }
    for (int k = 0; k < lanes_; ++k) x[kUnknowns + k] = static_cast<float>(sample.value[c][k]);
    float* first = &first_[cell * first_stride() + c * (kUnknowns + lanes_)];
    for (int i = 0; i < kUnknowns + lanes_; ++i) first[i] += x[i];
    float* second = &second_.entries_[cell * second_.stride()];
    for (int i = 0; i < kUnknowns; ++i) {
      for (int j = 0; j <= i; ++j) *second++ += x[i] * x[j];
    }
    for (int k = kUnknowns; k < kUnknowns + lanes_; ++k) {
      *second++ += x[k] * x[k];
      for (int i = 0; i < kUnknowns; ++i) *second++ += x[k] * x[i];
    }
  }
}

CellCovariances CellSums::take(int samples) {
  const auto n = static_cast<float>(samples);
  const size_t stride = second_.stride();
  for (size_t cell = 0; cell * stride < second_.entries_.size(); ++cell) {
    const float* first = &first_[cell * first_stride()];
    const auto subtract_means = [&](float& entry, int i, int j) {
      float products = 0;
      for (int c = 0; c < 3; ++c) {
        products += first[c * (kUnknowns + lanes_) + i] * first[c * (kUnknowns + lanes_) + j];
      }
      entry = (entry - products / n) / (n - 1);
    };
    float* second = &second_.entries_[cell * stride];
    for (int i = 0; i < kUnknowns; ++i) {
      for (int j = 0; j <= i; ++j) subtract_means(*second++, i, j);
    }
    for (int k = kUnknowns; k < kUnknowns + lanes_; ++k) {
      subtract_means(*second++, k, k);
      for (int i = 0; i < kUnknowns; ++i) subtract_means(*second++, k, i);
    }
  }
  CellCovariances result(second_.entries_.size() / stride, lanes_);
  std::swap(result, second_);
  std::fill(first_.begin(), first_.end(), 0.0f);
  return result;
}

}  // namespace limn
