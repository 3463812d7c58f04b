#pragma once
// Texels in memory, as compact as their file: a texture's, or those of a light.
#include <array>
#include <cstdint>
#include <variant>
#include <vector>

#include "limn/core/huge_pages.h"
#include "limn/core/image.h"
#include "limn/core/prefetch.h"
#include "limn/core/vec.h"
#include "src/base/half.h"

namespace limn {

// W by H texels of three channels; immutable. Bytes stay bytes (4 a texel), with a table of the
// numbers that they stand for; else halves (8) if no value is lost, else floats (16). They lie in
// tiles of 4 x 4: one of bytes is a line of the cache, so that four neighbours lie in 1.6 lines on
// average, where rows would take 2.1.
class Texels {
 public:
  explicit Texels(const StoredImage& image);
  explicit Texels(const Image& image);  // linear, of one or three channels

  int width() const { return width_; }
  int height() const { return height_; }
  size_t count() const { return static_cast<size_t>(width_) * height_; }

  // Those of two columns in one row, then of the same in the other; the fourth number is 0.
  std::array<FourDoubles, 4> square(const std::array<uint32_t, 2>& columns,
                                    const std::array<uint32_t, 2>& rows) const {
    std::array<FourDoubles, 4> texels;
    read(places(columns, rows), texels);
    return texels;
  }
  // Brings these into the cache, mostly: of bytes, in all but one case of sixteen.
  void fetch(const std::array<uint32_t, 2>& columns, const std::array<uint32_t, 2>& rows) const {
    std::visit(
        [&](const auto& all) {
          for (size_t i = 0; i < 2; ++i) prefetch(&all[place(columns[i], rows[i])]);
        },
        all_);
  }
  Rgb<double> texel(uint32_t column, uint32_t row) const {
    std::array<FourDoubles, 1> texel;
    read<1>({place(column, row)}, texel);
    return {texel[0][0], texel[0][1], texel[0][2]};
  }
  Image image() const;

  const Rgb<double>& mean() const { return mean_; }
  double mean_magnitude() const { return mean_magnitude_; }
  // Over all channels.
  double least() const { return least_; }
  double most() const { return most_; }

 private:
  template <class Number>
  using Quads = HugePageVector<std::array<Number, 4>>;

  static constexpr uint32_t kTile = 4;

  Rgb<double> in_order(size_t i) const {
    const auto width = static_cast<size_t>(width_);
    return texel(static_cast<uint32_t>(i % width), static_cast<uint32_t>(i / width));
  }

  size_t place(uint32_t column, uint32_t row) const {
    const size_t tile = static_cast<size_t>(row / kTile) * tiles_across_ + column / kTile;
    return (tile * kTile + row % kTile) * kTile + column % kTile;
  }
  std::array<size_t, 4> places(const std::array<uint32_t, 2>& columns,
                               const std::array<uint32_t, 2>& rows) const {
    return {place(columns[0], rows[0]), place(columns[1], rows[0]), place(columns[0], rows[1]),
            place(columns[1], rows[1])};
  }
  template <size_t N>
  void read(const std::array<size_t, N>& at, std::array<FourDoubles, N>& texels) const {
    std::visit(
        [&](const auto& all) {
          for (size_t i = 0; i < N; ++i) texels[i] = numbers(all[at[i]]);
        },
        all_);
  }

  FourDoubles numbers(const std::array<uint8_t, 4>& t) const {
    return to_doubles(std::array{table_[t[0]], table_[t[1]], table_[t[2]], 0.0f});
  }
  static FourDoubles numbers(const std::array<Half, 4>& t) { return to_doubles(t); }
  static FourDoubles numbers(const std::array<float, 4>& t) { return to_doubles(t); }

  // of(i): the i-th of the interleaved numbers, row 0 first.
  template <class Number, class Of>
  void fill(int channels, const Of& of);
  void fill_floats(const std::vector<float>& floats, int channels);
  void sum_up();

  int width_, height_;
  size_t tiles_across_ = 0;
  std::variant<Quads<uint8_t>, Quads<Half>, Quads<float>> all_;
  std::array<float, 256> table_{};
  Rgb<double> mean_;
  double mean_magnitude_ = 0;
  double least_ = 0, most_ = 0;
};

}  // namespace limn
