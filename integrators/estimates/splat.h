#pragma once
// From a point of the film to the pixels whose reconstruction filters reach it.
#include <algorithm>
#include <cmath>
#include <vector>

#include "limn/core/film.h"

namespace limn {

// The slope of the filter's logarithm within its radius; 0 where it is 0.
inline double log_slope(const Filter& filter, double x) {
  const double at = filter.eval(x);
  return at == 0 ? 0 : filter.slope(x) / at;
}

// Calls visit(x, y, weight) for every pixel of the crop window whose value holds radiance at the
// film position [pixels of the full film] with this weight [1 / pixel^2].
template <class Visit>
void for_every_pixel_of(const Film& film, double film_x, double film_y, const Visit& visit) {
  const double radius = film.filter.radius;
  const int x0 = std::max(film.crop_x, static_cast<int>(std::floor(film_x - 0.5 - radius)));
  const int y0 = std::max(film.crop_y, static_cast<int>(std::floor(film_y - 0.5 - radius)));
  const int x1 = std::min(film.crop_x + film.crop_width - 1,
                          static_cast<int>(std::ceil(film_x - 0.5 + radius)));
  const int y1 = std::min(film.crop_y + film.crop_height - 1,
                          static_cast<int>(std::ceil(film_y - 0.5 + radius)));
  const auto weight = [&](double offset, Film::Range range) {
    if (offset < range.lower || offset > range.upper) return 0.0;
    return film.filter.eval(offset) /
           (film.filter.integral(range.upper) - film.filter.integral(range.lower));
  };
  std::vector<double> columns;
  for (int x = x0; x <= x1; ++x) {
    columns.push_back(weight(film_x - (x + 0.5), film.range_x(x)));
  }
  for (int y = y0; y <= y1; ++y) {
    const double wy = weight(film_y - (y + 0.5), film.range_y(y));
    if (wy == 0) continue;
    for (int x = x0; x <= x1; ++x) {
      const double wx = columns[static_cast<size_t>(x - x0)];
      if (wx != 0) visit(x, y, wx * wy);
    }
  }
}

}  // namespace limn
