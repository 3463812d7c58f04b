#pragma once
// Random streams keyed by what they are for, so that no result depends on threads or on the order
// of work.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace limn {

namespace detail {
// Word: 64 bits, or several of them side by side.
template <class Word>
[[gnu::always_inline]] inline Word mix_words(Word z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}
}  // namespace detail

// Bijective 64-bit finaliser (Stafford's variant 13, as in SplitMix64). No template, which would
// take a shorter number as it is.
inline uint64_t mix_bits(uint64_t z) { return detail::mix_words(z); }

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
  kVertexSplit,
  kDrawRoulette
};

// SplitMix64 started from a hash of (seed, pixel, sample): a stream for one path. `at` derives the
// stream of one path vertex and one purpose, so that drawing more numbers at one place leaves all
// others unchanged (finite differences with common random numbers rely on it).
class Rng {
 public:
  Rng(uint64_t seed, uint64_t pixel, uint64_t sample)
      : key_(mix_bits(mix_bits(mix_bits(seed + kGolden) + pixel + kGolden) + sample + kGolden)),
        state_(key_) {}
  // The same of a pixel's samples that fill their ranges evenly together: for every purpose and
  // depth, sample n takes the n-th of the Sobol' points of a pixel, scrambled by chance (rng.cpp).
  // Any one sample is as random as that of another stream; several are not independent. count: more
  // than any sample, for `path`; 0 if it is not asked for.
  static Rng even(uint64_t seed, uint64_t pixel, uint32_t sample, uint32_t count = 0) {
    Rng rng(mix_bits(mix_bits(seed + kGolden) + pixel + kGolden));
    rng.sample_ = sample;
    rng.count_ = count;
    rng.dimension_ = 0;
    return rng;
  }

  Rng at(Purpose purpose, uint64_t depth) const {
    Rng rng(mix_bits(key_ + kGolden * place_of(purpose, depth)));
    rng.sample_ = sample_;
    rng.count_ = count_;
    rng.dimension_ = dimension_ < 0 ? -1 : 0;
    return rng;
  }
  // The stream of one of several samples of the same kind; the first is this one itself.
  Rng copy(Purpose purpose, int index) const { return index == 0 ? *this : at(purpose, index); }
  // The stream of one of several paths of a sample; the first is this one itself. The paths of all
  // samples are even together: the second ones take the points behind those of the first.
  Rng path(int index) const {
    if (count_ == 0) return copy(Purpose::kPathCopy, index);
    Rng rng(*this);
    rng.sample_ += static_cast<uint32_t>(index) * count_;
    return rng;
  }
  // The stream key.at(purpose, depth).
  struct Stream {
    const Rng* key;
    uint64_t depth;
  };
  // numbers[i]: the first that `uniform` of streams[i] gives. The keys are all even, or none is.
  template <size_t kCount>
  static void draw(Purpose purpose, std::span<const Stream> streams,
                   std::array<double, kCount>* numbers) {
    static_assert(kCount <= kDimensions);
    if (!streams.empty()) draw(purpose, streams, kCount, numbers->data());
  }
  // Uniform in [0, 1): 53 bits, of which the last 21 are alike in all that is even together.
  double uniform() {
    if (dimension_ >= 0) return even_uniform();
    return static_cast<double>(next() >> 11) * 0x1.0p-53;
  }

 private:
  explicit Rng(uint64_t key) : key_(key), state_(key) {}
  uint64_t next() {
    state_ += kGolden;
    return mix_bits(state_);
  }
  template <class Word>
  [[gnu::always_inline]] static inline Word place_of(Purpose purpose, const Word& depth) {
    return 1 + static_cast<uint64_t>(purpose) + 64 * depth;
  }
  double even_uniform();
  // numbers: streams.size() by count.
  static void draw(Purpose purpose, std::span<const Stream> streams, size_t count, double* numbers);

  static constexpr int kDimensions = 4;
  static constexpr uint64_t kGolden = 0x9e3779b97f4a7c15ull;
  uint64_t key_;
  uint64_t state_;
  // Of even streams alone.
  uint32_t sample_ = 0;
  uint32_t count_ = 0;  // more than any sample, or 0
  uint32_t place_ = 0;  // of the sample among the points of these dimensions
  int dimension_ = -1;  // the next; -1 for independent numbers
};

}  // namespace limn
