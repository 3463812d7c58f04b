// Pixels evenly, or where the loss depends on them.
#include "integrators/backward/pixel_choice.h"

#include <algorithm>
#include <cmath>

namespace limn {

PixelChoice::PixelChoice(const std::vector<Rgb<double>>& adjoint, bool uniform)
    : uniform_(uniform) {
  constexpr double kEven = 0.25;
  double total = 0;
  const auto magnitude = [](const Rgb<double>& a) {
    return std::fabs(a.r) + std::fabs(a.g) + std::fabs(a.b);
  };
  for (const auto& a : adjoint) total += magnitude(a);
  const double even = 1 / static_cast<double>(adjoint.size());
  double sum = 0;
  for (const auto& a : adjoint) {
    sum += total > 0 ? kEven * even + (1 - kEven) * magnitude(a) / total : even;
    cumulative_.push_back(sum);
  }
}

PixelPath PixelChoice::path(const PathBatch& batch, size_t index) const {
  if (uniform_) {
    return {index / batch.count(), batch.first + index % batch.count(),
            static_cast<double>(batch.count())};
  }
  const size_t all = paths(batch);
  const uint64_t number = cumulative_.size() * static_cast<uint64_t>(batch.first) + index;
  Rng rng = Rng(batch.seed, UINT64_MAX, number).at(Purpose::kFilm, 0);
  const double target = (index + rng.uniform()) / all * cumulative_.back();
  const auto found = std::upper_bound(cumulative_.begin(), cumulative_.end(), target);
  const size_t pixel = std::min<size_t>(found - cumulative_.begin(), cumulative_.size() - 1);
  const double below = pixel == 0 ? 0 : cumulative_[pixel - 1];
  return {pixel, number, (cumulative_[pixel] - below) / cumulative_.back() * all};
}

}  // namespace limn
