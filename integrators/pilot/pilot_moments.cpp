// Sums of products of what single samples add.
#include "integrators/pilot/pilot_moments.h"

#include <algorithm>
#include <array>
#include <cmath>
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
      ++second;  // the squared mean
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
      float& variance = *second++;
      const float squares = variance;
      subtract_means(variance, k, k);
      for (int i = 0; i < kUnknowns; ++i) subtract_means(*second++, k, i);
      *second++ = squares / n - variance;
    }
  }
  CellCovariances result = std::exchange(second_, CellCovariances(cells_, parameters_));
  std::fill(first_.begin(), first_.end(), 0.0f);
  return result;
}

void PairSums::add(size_t cell, const Rgb<Lanes>& one, const Rgb<Lanes>& two) {
  for (int k = 0; k < parameters_; ++k) {
    Cell& to = cells_[cell * parameters_ + k];
    ++to.samples;
    for (int c = 0; c < 3; ++c) {
      const auto x = static_cast<float>(one[c][k]), y = static_cast<float>(two[c][k]);
      to.sums[0][c] += x;
      to.sums[1][c] += y;
      to.products[0] += x * x;
      to.products[1] += y * y;
      to.products[2] += x * y;
    }
  }
}

// The covariance of both is the path's variance.
DrawShares PairSums::shares(int parameter) const {
  constexpr double kMostKept = 0.95, kMostPower = 2;
  std::vector<std::array<double, 3>> found;
  for (size_t i = static_cast<size_t>(parameter); i < cells_.size(); i += parameters_) {
    const Cell& cell = cells_[i];
    if (cell.samples < 2) continue;
    const auto of = [&](int product, int a, int b) {
      double rest = cell.products[product];
      for (int c = 0; c < 3; ++c) rest -= double{cell.sums[a][c]} * cell.sums[b][c] / cell.samples;
      return rest / (cell.samples - 1);
    };
    found.push_back({of(0, 0, 0), of(1, 1, 1), of(2, 0, 1)});
  }
  std::sort(found.begin(), found.end(),
            [](const auto& a, const auto& b) { return a[0] + a[1] < b[0] + b[1]; });
  found.resize(found.size() - (found.size() + 999) / 1000);
  double one = 0, two = 0, path = 0;
  for (const auto& [a, b, c] : found) one += a, two += b, path += c;
  path = std::clamp(path, 0.0, kMostKept * one);
  if (!(one > 0)) return {};
  const double ratio = two > path ? (one - path) / (two - path) : std::exp2(kMostPower);
  return {path / one, std::clamp(std::log2(ratio), 1.0, kMostPower)};
}

void PairSums::merge(const PairSums& other) {
  for (size_t i = 0; i < cells_.size(); ++i) {
    Cell& to = cells_[i];
    const Cell& from = other.cells_[i];
    to.samples += from.samples;
    for (int k = 0; k < 3; ++k) {
      to.sums[0][k] += from.sums[0][k];
      to.sums[1][k] += from.sums[1][k];
      to.products[k] += from.products[k];
    }
  }
}

}  // namespace limn
