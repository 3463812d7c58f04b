#pragma once
// Random streams keyed by what they are for, so that no result depends on threads or on the order
// of work.
#include <cstdint>

namespace limn {

// Bijective 64-bit finaliser (Stafford's variant 13, as in SplitMix64).
inline uint64_t mix_bits(uint64_t z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}

enum class Purpose : uint64_t {
  kFilm,
  kBsdf,
  kEmitter,
  kRoulette,
  kEdge,
  kEdgeSide,
  kCamera,
  kPathCopy,
  kEdgeCopy,
  kFilmCopy,
  kShadow,
  kShadowCopy,
  kLightCopy,
  kDirect,
  kDirectCopy,
  kTermRoulette,
  kVertexSplit
};

// SplitMix64 started from a hash of (seed, pixel, sample): a stream for one path. `at` derives the
// stream of one path vertex and one purpose, so that drawing more numbers at one place leaves all
// others unchanged (finite differences with common random numbers rely on it).
class Rng {
 public:
  Rng(uint64_t seed, uint64_t pixel, uint64_t sample)
      : key_(mix_bits(mix_bits(mix_bits(seed + kGolden) + pixel + kGolden) + sample + kGolden)),
        state_(key_) {}

  Rng at(Purpose purpose, uint64_t depth) const {
    return Rng(mix_bits(key_ + kGolden * (1 + static_cast<uint64_t>(purpose) + 64 * depth)));
  }
  // The stream of one of several samples of the same kind; the first is this one itself.
  Rng copy(Purpose purpose, int index) const { return index == 0 ? *this : at(purpose, index); }
  // Uniform in [0, 1), 53 bits.
  double uniform() {
    state_ += kGolden;
    return static_cast<double>(mix_bits(state_) >> 11) * 0x1.0p-53;
  }

 private:
  explicit Rng(uint64_t key) : key_(key), state_(key) {}
  static constexpr uint64_t kGolden = 0x9e3779b97f4a7c15ull;
  uint64_t key_;
  uint64_t state_;
};

}  // namespace limn
