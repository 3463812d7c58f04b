#pragma once
// Random streams keyed by purpose, so that results depend neither on the number of threads nor on
// the order of work.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace limn {

namespace detail {
// Word: 64 bits, or a SIMD vector of them.
template <class Word>
[[gnu::always_inline]] inline Word mix_words(Word z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}
}  // namespace detail

// A bijective 64-bit finaliser (Stafford's variant 13, as in SplitMix64). Not a template, so that
// narrower integers are converted.
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
  kDrawRoulette,
  kLens
};

// SplitMix64, seeded by a hash of (seed, pixel, sample): the stream of one path. `at` derives the
// stream of a path vertex and purpose. Drawing more numbers in one stream leaves the others
// unchanged, as finite differences with common random numbers require.
class Rng {
 public:
  Rng(uint64_t seed, uint64_t pixel, uint64_t sample)
      : key_(mix_bits(mix_bits(mix_bits(seed + kGolden) + pixel + kGolden) + sample + kGolden)),
        state_(key_) {}
  // A low-discrepancy stream: for each purpose and depth, sample n uses the n-th point of an
  // Owen-scrambled Sobol' sequence of the pixel (rng.cpp). A single sample is distributed as in an
  // independent stream; several samples are correlated. count: an upper bound of all sample
  // indices, for `path`; 0 if unused.
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
  // The stream of the index-th sample of one kind; index 0 is this stream itself.
  Rng copy(Purpose purpose, int index) const { return index == 0 ? *this : at(purpose, index); }
  // The stream of the index-th path of a sample; index 0 is this stream itself. Together the paths
  // of all samples are low-discrepancy: path i uses the points after those of path i - 1.
  Rng path(int index) const {
    if (count_ == 0) return copy(Purpose::kPathCopy, index);
    Rng rng(*this);
    rng.sample_ += static_cast<uint32_t>(index) * count_;
    return rng;
  }
  // Identifies the stream key.at(purpose, depth).
  struct Stream {
    const Rng* key;
    uint64_t depth;
  };
  // numbers[i]: the first `uniform` of streams[i]. All keys are low-discrepancy, or none is.
  template <size_t kCount>
  static void draw(Purpose purpose, std::span<const Stream> streams,
                   std::array<double, kCount>* numbers) {
    static_assert(kCount <= kDimensions);
    if (!streams.empty()) draw(purpose, streams, kCount, numbers->data());
  }
  // Uniform in [0, 1) with 53 bits; the last 21 are shared by all points of a sequence.
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
  // For low-discrepancy streams only.
  uint32_t sample_ = 0;
  uint32_t count_ = 0;  // upper bound of sample indices, or 0
  uint32_t place_ = 0;  // index of the sample's point in these dimensions
  int dimension_ = -1;  // next dimension; -1 for independent numbers
};

}  // namespace limn
