// Places of samples that all pixels share, by the quantiles of their density.
#include "integrators/estimates/shared_place.h"

#include <cmath>

namespace limn {
namespace {

using Weights = std::array<double, SharedPlace::kMostSide>;

// Returns the place in the pixel below which the fraction u of S lies, so that numbers which are
// spread evenly give places that are. weights[reach + m]: of the pixel m before it.
double place(const Filter& filter, int reach, double u, Weights& weights) {
  const auto below = [&](double inside) {
    double sum = 0;
    for (int m = -reach; m <= reach; ++m) sum += filter.integral(inside - 0.5 + m);
    return sum;
  };
  const double first = below(0), sought = first + u * (below(1) - first);
  double inside = 0;
  for (double step = 0.5; step > 0x1p-54; step *= 0.5) {
    if (below(inside + step) <= sought) inside += step;
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
  return reach <= kMostReach ? static_cast<int>(reach) : 0;
}

SharedPlace::SharedPlace(const Filter& filter, int reach, const Rng& key) {
  Rng rng = key.at(Purpose::kFilm, 0);
  Weights columns, rows;
  x = place(filter, reach, rng.uniform(), columns);
  y = place(filter, reach, rng.uniform(), rows);
  const int side = 2 * reach + 1;
  for (int i = 0; i < side * side; ++i) weights[i] = rows[i / side] * columns[i % side];
}

bool is_whole(const Film& film, int x, int y) {
  const double radius = film.filter.radius;
  const auto holds = [&](const Film::Range& range) {
    return range.lower <= -radius && range.upper >= radius;
  };
  return holds(film.range_x(x)) && holds(film.range_y(y));
}

}  // namespace limn
