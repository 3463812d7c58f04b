// The adjoint image: from what callers give to what a film position sees.
#include "integrators/backward/film_adjoint.h"

#include <fmt/format.h>

#include <cmath>

#include "integrators/estimates/splat.h"
#include "limn/core/error.h"

namespace limn {

std::vector<Rgb<double>> adjoint_pixels(const Scene& scene, const Image& adjoint) {
  const Film& film = scene.film;
  if (adjoint.width != film.crop_width || adjoint.height != film.crop_height ||
      (adjoint.channels != 1 && adjoint.channels != 3)) {
    throw InputError(fmt::format(
        "the adjoint image has {} x {} pixels of {} channels, but the film {} x {}: it must "
        "be of the film's size, with three channels or one",
        adjoint.width, adjoint.height, adjoint.channels, film.crop_width, film.crop_height));
  }
  std::vector<Rgb<double>> pixels;
  for (int y = 0; y < adjoint.height; ++y) {
    for (int x = 0; x < adjoint.width; ++x) {
      Rgb<double> a;
      for (int c = 0; c < 3; ++c) {
        Rgb<double> unit;
        unit[c] = 1;
        a[c] = adjoint.channels == 3 ? adjoint.at(x, y, c) : adjoint.at(x, y, 0) * luminance(unit);
        if (std::isfinite(a[c])) continue;
        throw InputError(fmt::format("the adjoint image is not finite in column {}, row {}", x, y));
      }
      pixels.push_back(a);
    }
  }
  return pixels;
}

Rgb<double> FilmAdjoint::at(double x, double y) const {
  Rgb<double> sum;
  for_every_pixel_of(film_, x, y,
                     [&](int px, int py, double weight) { sum += of_pixel(px, py) * weight; });
  return sum;
}

}  // namespace limn
