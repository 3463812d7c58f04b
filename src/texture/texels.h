#pragma once
// Texels in memory, as compact as their file: a texture's, or those of a light.
#include <array>
#include <cstdint>
#include <variant>
#include <vector>

#include "limn/core/image.h"
#include "limn/core/vec.h"
#include "src/base/half.h"
#include "src/base/huge_pages.h"

namespace limn {

// W by H texels of three channels, row 0 first; immutable. Bytes stay bytes (4 a texel), with a
// table of the numbers that they stand for; else halves (8) if no value is lost, else floats (16).
class Texels {
 public:
  explicit Texels(const StoredImage& image);
  explicit Texels(const Image& image);  // linear, of one or three channels

  int width() const { return width_; }
  int height() const { return height_; }
  size_t count() const { return static_cast<size_t>(width_) * height_; }

  // texels[i] is that with index at[i], in row-major order.
  template <size_t N>
  void fetch(const std::array<uint32_t, N>& at, std::array<Rgb<double>, N>& texels) const {
    std::visit(
        [&](const auto& all) {
          for (size_t i = 0; i < N; ++i) {
            const auto& t = all[at[i]];
            texels[i] = {number(t[0]), number(t[1]), number(t[2])};
          }
        },
        all_);
  }
  Rgb<double> operator[](size_t index) const {
    std::array<Rgb<double>, 1> texel;
    fetch<1>({static_cast<uint32_t>(index)}, texel);
    return texel[0];
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

  double number(uint8_t byte) const { return table_[byte]; }
  static double number(float v) { return v; }
  static double number(Half v) { return v; }

  // of(i): the i-th of the interleaved numbers.
  template <class Number, class Of>
  void fill(int channels, const Of& of);
  void fill_floats(const std::vector<float>& floats, int channels);
  void sum_up();

  int width_, height_;
  std::variant<Quads<uint8_t>, Quads<Half>, Quads<float>> all_;
  std::array<float, 256> table_{};
  Rgb<double> mean_;
  double mean_magnitude_ = 0;
  double least_ = 0, most_ = 0;
};

}  // namespace limn
