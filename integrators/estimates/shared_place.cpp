// Places of samples that all pixels share, by the quantiles of their density.
#include "integrators/estimates/shared_place.h"

#include <cmath>

namespace limn {
namespace {

using Weights = std::array<double, SharedPlace::kMostSide>;

// Returns the place in the pixel below which the fraction u of S lies, so that numbers which are
// spread evenly give places that are. weights[reach + m]: of the pixel m before it.
double place(const Filter& filter, int reach, double u, Weights& weights) {
  const auto sum_of = [&](const auto& function, double inside) {
    double sum = 0;
    for (int m = -reach; m <= reach; ++m) sum += function(inside - 0.5 + m);
    return sum;
  };
  const auto below = [&](double inside) {
    return sum_of([&](double x) { return filter.integral(x); }, inside);
  };
  const double first = below(0), sought = first + u * (below(1) - first);
  // Newton's method, in a bracket. S is nearly 1 for filters as wide as pixels.
  double lower = 0, upper = 1, inside = u;
  for (int i = 0; i < 60 && upper - lower > 0x1p-53; ++i) {
    const double over = below(inside) - sought;
    (over > 0 ? upper : lower) = inside;
    const double slope = sum_of([&](double x) { return filter.eval(x); }, inside);
    const double next = inside - over / slope;
    if (std::fabs(next - inside) <= 0x1p-53) break;
    inside = next > lower && next < upper ? next : 0.5 * (lower + upper);
  }
  weights = {};
  double sum = 0;
  for (int m = -reach; m <= reach; ++m) {
    sum += weights[reach + m] = filter.eval(inside - 0.5 + m);
  }
  for (double& weight : weights) weight /= sum;
  return inside;
}

}  // namespace

int SharedPlace::reach_of(const Film& film) {
  if (film.filter.kind == Filter::Kind::kBox) return 0;
  const double reach = std::floor(film.filter.radius + 0.5);
  if (reach > kMostReach) return 0;
  const Tile served = served_pixels(film);
  const double pixels = static_cast<double>(served.x1 - served.x0) * (served.y1 - served.y0);
  const bool most = 2 * pixels > static_cast<double>(film.crop_width) * film.crop_height;
  return most ? static_cast<int>(reach) : 0;
}

double SharedPlace::mean_squares(const Filter& filter, int reach) {
  constexpr int kPlaces = 64;  // of the filter's quantiles along an axis
  double mean = 0;
  for (int i = 0; i < kPlaces; ++i) {
    Weights weights;
    place(filter, reach, (i + 0.5) / kPlaces, weights);
    for (const double weight : weights) mean += weight * weight / kPlaces;
  }
  return mean * mean;
}

SharedPlace::SharedPlace(const Filter& filter, int served, const Rng& key)
    : reach(served), weights{}, squares(0) {
  Rng rng = key.at(Purpose::kFilm, 0);
  Weights columns, rows;
  x = place(filter, reach, rng.uniform(), columns);
  y = place(filter, reach, rng.uniform(), rows);
  const int side = 2 * reach + 1;
  for (int i = 0; i < side * side; ++i) {
    weights[i] = rows[i / side] * columns[i % side];
    squares += weights[i] * weights[i];
  }
}

Tile served_pixels(const Film& film) {
  const double radius = film.filter.radius;
  const auto is_whole = [&](const Film::Range& range) {
    return range.lower <= -radius && range.upper >= radius;
  };
  Tile served{film.crop_x, film.crop_y, film.crop_x + film.crop_width,
              film.crop_y + film.crop_height};
  while (served.x0 < served.x1 && !is_whole(film.range_x(served.x0))) ++served.x0;
  while (served.x0 < served.x1 && !is_whole(film.range_x(served.x1 - 1))) --served.x1;
  while (served.y0 < served.y1 && !is_whole(film.range_y(served.y0))) ++served.y0;
  while (served.y0 < served.y1 && !is_whole(film.range_y(served.y1 - 1))) --served.y1;
  return served;
}

}  // namespace limn
