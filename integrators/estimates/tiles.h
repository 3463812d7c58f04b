#pragma once
// The pixels of a film, in an order that no number of threads changes.
#include <cmath>
#include <limits>
#include <vector>

#include "limn/core/dual.h"
#include "limn/core/film.h"
#include "limn/core/vec.h"

namespace limn {

inline constexpr int kTileSize = 16;  // not tuned

struct Tile {
  int x0, y0, x1, y1;  // full-film pixels, [x0, x1) by [y0, y1)

  bool holds(int x, int y) const { return x >= x0 && y >= y0 && x < x1 && y < y1; }
};

// Rows of tiles of the crop window, in a fixed order.
std::vector<Tile> make_tiles(const Film& film);

// Index of a pixel's first channel in crop-window arrays of three channels.
inline size_t pixel_index(const Film& film, int x, int y) {
  return (static_cast<size_t>(y - film.crop_y) * film.crop_width + (x - film.crop_x)) * 3;
}

// Values of such an array.
inline size_t film_size(const Film& film) {
  return static_cast<size_t>(film.crop_width) * film.crop_height * 3;
}

// Finite as far as images go, which hold floats; sums of such values cannot overflow either.
inline bool is_finite(const Rgb<double>& c) {
  constexpr double kLargest = std::numeric_limits<float>::max();
  return std::fabs(c.r) <= kLargest && std::fabs(c.g) <= kLargest && std::fabs(c.b) <= kLargest;
}
inline bool is_finite(const Rgb<Lanes>& value) {
  for (int k = 0; k < kLanes; ++k) {
    if (!is_finite(Rgb<double>{value.r[k], value.g[k], value.b[k]})) return false;
  }
  return true;
}

}  // namespace limn
