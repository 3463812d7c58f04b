#pragma once
// A discrete distribution: draws an index in proportion to its weight.
#include <algorithm>
#include <cstddef>
#include <vector>

namespace limn {

// Stores the cumulative sums of non-negative weights; a draw is a binary search.
class DiscreteDistribution {
 public:
  struct Draw {
    size_t index;
    double probability;  // of the index
    double fraction;     // position of u within the entry [0, 1]: uniform again
  };

  void add(double weight) { sums_.push_back(sum() + weight); }
  size_t size() const { return sums_.size(); }
  bool empty() const { return sums_.empty(); }
  double sum() const { return sums_.empty() ? 0 : sums_.back(); }

  // u in [0, 1). At least one weight must be positive; an entry of weight 0 is never drawn.
  Draw sample(double u) const {
    const double target = u * sums_.back();
    const auto found = std::upper_bound(sums_.begin(), sums_.end(), target);
    const size_t index = std::min<size_t>(found - sums_.begin(), sums_.size() - 1);
    const double below = index == 0 ? 0 : sums_[index - 1];
    const double weight = sums_[index] - below;
    return {index, weight / sums_.back(), std::clamp((target - below) / weight, 0.0, 1.0)};
  }
  // Of an index; some weight must be positive.
  double probability(size_t index) const {
    return (sums_[index] - (index == 0 ? 0 : sums_[index - 1])) / sums_.back();
  }

 private:
  std::vector<double> sums_;
};

}  // namespace limn
