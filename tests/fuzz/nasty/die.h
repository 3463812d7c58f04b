#pragma once
// Random choices of a seed.
#include <cstdint>
#include <initializer_list>
#include <vector>

#include "limn/core/rng.h"
#include "limn/core/vec.h"

namespace limn::nasty {

class Die {
 public:
  explicit Die(uint64_t seed) : rng_(seed, 0, 0) {}

  double uniform(double lower, double upper) { return lower + (upper - lower) * rng_.uniform(); }
  bool chance(double probability) { return rng_.uniform() < probability; }
  // In [lower, upper].
  int integer(int lower, int upper) {
    return lower + static_cast<int>(rng_.uniform() * (upper - lower + 1));
  }
  template <class T>
  T pick(std::initializer_list<T> choices) {
    return choices.begin()[integer(0, static_cast<int>(choices.size()) - 1)];
  }
  template <class T>
  const T& pick(const std::vector<T>& choices) {
    return choices[integer(0, static_cast<int>(choices.size()) - 1)];
  }
  // Each with the chance of its place: the first half the time, and so on.
  template <class T>
  T mostly(std::initializer_list<T> choices) {
    for (const T& choice : choices)
      if (chance(0.5)) return choice;
    return pick(choices);
  }
  Vec3d in_cube(double half) {
    const double x = uniform(-half, half), y = uniform(-half, half);
    return {x, y, uniform(-half, half)};
  }

 private:
  Rng rng_;
};

}  // namespace limn::nasty
