#pragma once
// Where a path starts: a position in a pixel's filter, a point of the lens, and the camera's ray
// through both.
#include <array>

#include "limn/core/film.h"
#include "limn/core/ray_tracer.h"
#include "limn/core/rng.h"
#include "limn/core/scene.h"

namespace limn {

// Position of one sample of a pixel [pixels of the full film]: drawn from the reconstruction filter
// around the pixel's center, so that every sample counts with weight one (pixel_filter_weight where
// the filter is negative somewhere) and no pixel shares samples with another. The stream depends on
// the pixel of the full film, hence a crop repeats the full image. filter: the film's.
using FilmPosition = Camera::FilmPoint<double>;
inline FilmPosition sample_pixel_filter(const Film& film, const FilterTable& filter, int x, int y,
                                        const std::array<double, 2>& u) {
  const auto columns = film.range_x(x);
  const auto rows = film.range_y(y);
  const double dx = filter.quantile(columns.lower, columns.upper, u[0]);
  const double dy = filter.quantile(rows.lower, rows.upper, u[1]);
  return {x + 0.5 + dx, y + 0.5 + dy};
}
inline FilmPosition sample_pixel_filter(const Film& film, const FilterTable& filter, int x, int y,
                                        const Rng& key) {
  Rng rng = key.at(Purpose::kFilm, 0);
  const double u = rng.uniform();
  return sample_pixel_filter(film, filter, x, y, {u, rng.uniform()});
}

// The weight of a sample of pixel (x, y) at a film position: filter over density.
inline double pixel_filter_weight(const Film& film, const FilterTable& filter, int x, int y,
                                  const FilmPosition& at) {
  if (!film.filter.is_signed()) return 1;
  const auto columns = film.range_x(x);
  const auto rows = film.range_y(y);
  return filter.weight(columns.lower, columns.upper, at.x - (x + 0.5)) *
         filter.weight(rows.lower, rows.upper, at.y - (y + 0.5));
}

inline double pixel_filter_weight(const Film& film, const FilterTable& filter, int x, int y,
                                  const Rng& key) {
  if (!film.filter.is_signed()) return 1;
  return pixel_filter_weight(film, filter, x, y, sample_pixel_filter(film, filter, x, y, key));
}

// The same position on the other side of the pixel's center: drawn from the filter like the first,
// to which filters are symmetric. What is linear over the pixel is gone from the mean of both. An
// axis along which the film's border cuts the filter keeps its offset.
inline FilmPosition mirrored_in_pixel(const Film& film, int x, int y,
                                      const FilmPosition& position) {
  const auto mirrored = [](const Film::Range& range, double center, double at) {
    return range.lower == -range.upper ? 2 * center - at : at;
  };
  return {mirrored(film.range_x(x), x + 0.5, position.x),
          mirrored(film.range_y(y), y + 0.5, position.y)};
}

// The point of the lens that a sample looks through.
inline LensPoint sample_lens(const Rng& key) {
  Rng rng = key.at(Purpose::kLens, 0);
  const double u = rng.uniform();
  return lens_point(u, rng.uniform());
}
// The same for any camera: without a lens its center.
inline LensPoint sample_lens(const Camera& camera, const Rng& key) {
  return camera.has_lens() ? sample_lens(key) : LensPoint{};
}

// The same of many: lenses[i], of the sample with the key items[i].key.
template <class Items, size_t kMost>
void sample_lenses(const Camera& camera, const Items& items, std::array<LensPoint, kMost>& lenses) {
  if (!camera.has_lens()) return;
  std::array<Rng::Stream, kMost> streams;
  for (size_t i = 0; i < items.size(); ++i) streams[i] = {&items[i].key, 0};
  std::array<std::array<double, 2>, kMost> numbers;
  Rng::draw(Purpose::kLens, {streams.data(), items.size()}, numbers.data());
  for (size_t i = 0; i < items.size(); ++i) lenses[i] = lens_point(numbers[i][0], numbers[i][1]);
}

// A position on the film, seen through a point of the lens.
struct FilmPlace : FilmPosition {
  LensPoint lens = {};
};
template <class S>
CameraRay<S> ray_at(const CameraView<S>& view, const FilmPlace& at) {
  return view.camera().has_lens() ? view.at(at.lens).ray(at.x, at.y) : view.ray(at.x, at.y);
}
// The ray of the sample with this key.
template <class S>
CameraRay<S> sample_ray(const CameraView<S>& view, const FilmPosition& at, const Rng& key) {
  return ray_at(view, FilmPlace{at, sample_lens(view.camera(), key)});
}

// The primal camera ray.
inline Ray camera_ray(const Scene& scene, const CameraRay<double>& c) {
  Ray ray{c.origin, c.direction, c.t_min, c.t_max};
  ray.skip_emitters = scene.hide_emitters;
  return ray;
}

}  // namespace limn
