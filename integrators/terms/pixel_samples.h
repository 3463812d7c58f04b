#pragma once
// The loop over the pixels of a batch, shared by all jobs.
#include <algorithm>
#include <cmath>
#include <limits>

#include "integrators/terms/path.h"
#include "limn/core/film.h"
#include "limn/core/parallel.h"
#include "limn/core/rng.h"
#include "limn/core/scene.h"
#include "limn/integrators/run.h"

namespace limn {

inline constexpr int kTileSize = 16;

struct Tile {
  int x0, y0, x1, y1;  // full-film pixels, [x0, x1) by [y0, y1)
};

// Rows of tiles of the crop window, in a fixed order.
std::vector<Tile> make_tiles(const Film& film);

// Position of one sample of a pixel: drawn from the reconstruction filter around the pixel's
// centre, so that every sample counts with weight one and no pixel shares samples with another. The
// stream depends on the pixel of the full film, hence a crop repeats the full image.
struct FilmPosition {
  double x, y;
};
FilmPosition sample_film(const Film& film, int x, int y, const Rng& key);

inline Rng pixel_key(const Scene& scene, uint64_t seed, int x, int y, int64_t sample) {
  return {seed, static_cast<uint64_t>(y) * scene.camera.width + x, static_cast<uint64_t>(sample)};
}

// The primal camera ray.
inline Ray camera_ray(const Scene& scene, const CameraRay<double>& c) {
  Ray ray{c.origin, c.direction, c.t_min, c.t_max};
  ray.skip_emitters = scene.hide_emitters;
  return ray;
}

// Finite as far as images go, which hold floats; sums of such values cannot overflow either.
inline bool is_finite(const Rgb<double>& c) {
  constexpr double kLargest = std::numeric_limits<float>::max();
  return std::fabs(c.r) <= kLargest && std::fabs(c.g) <= kLargest && std::fabs(c.b) <= kLargest;
}

// Index of a pixel's first channel in crop-window arrays of three channels.
inline size_t pixel_index(const Film& film, int x, int y) {
  return (static_cast<size_t>(y - film.crop_y) * film.crop_width + (x - film.crop_x)) * 3;
}

}  // namespace limn
