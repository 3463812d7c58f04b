// Pixels evenly, or where the loss depends on them.
#include "integrators/backward/pixel_choice.h"

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
  for (const auto& a : adjoint) {
    choice_.add(total > 0 ? kEven * even + (1 - kEven) * magnitude(a) / total : even);
  }
}

PixelPath PixelChoice::path(const Batch& batch, size_t index, size_t all) const {
  if (uniform_) {
    return {index / batch.count(), batch.first + index % batch.count(),
            static_cast<double>(batch.count())};
  }
  const uint64_t number = choice_.size() * static_cast<uint64_t>(batch.first) + index;
  Rng rng = Rng(batch.seed, UINT64_MAX, number).at(Purpose::kFilm, 0);
  const DiscreteDistribution::Draw draw = choice_.sample((index + rng.uniform()) / all);
  return {draw.index, number, draw.probability * all};
}

}  // namespace limn
