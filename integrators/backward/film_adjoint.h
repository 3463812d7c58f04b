#pragma once
// dLoss/dI as points of the film see it.
#include <vector>

#include "limn/core/film.h"
#include "limn/core/image.h"
#include "limn/core/scene.h"

namespace limn {

// dLoss/dI, of the crop's pixels, row by row. InputError for an image of another size, or not
// finite.
std::vector<Rgb<double>> adjoint_pixels(const Scene& scene, const Image& adjoint);

class FilmAdjoint {
 public:
  FilmAdjoint(const Film& film, std::vector<Rgb<double>> pixels)
      : film_(film), pixels_(std::move(pixels)) {}
  const std::vector<Rgb<double>>& pixels() const { return pixels_; }
  const Rgb<double>& of_pixel(int x, int y) const {
    return pixels_[static_cast<size_t>(y - film_.crop_y) * film_.crop_width + (x - film_.crop_x)];
  }
  // Of the pixels whose filters reach a film position, weighed by them.
  Rgb<double> at(double x, double y) const;

 private:
  const Film& film_;
  std::vector<Rgb<double>> pixels_;
};

}  // namespace limn
