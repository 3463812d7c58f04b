#pragma once
// Samples that lie at one place in all pixels, and serve every pixel whose filter reaches them.
//
// An offset from a pixel's center that is drawn from the filter f is a whole number m of pixels and
// a place d in a pixel, of density S(d) = sum_m f(d + m) along each axis; given d, f(d + m) / S(d)
// draws m. Here d alone is drawn, and all m are taken with these weights. So an image has the same
// expectation, and less variance, as nothing is left of the choice of m. The weights add up to 1
// where all pixels have as many paths, see SamplePlan::share_paths. Pixels whose filters the film's
// border cuts have samples of their own; with sample_border there are none, and pixels around the
// film have samples for it. As places are those of all pixels, so are their errors: sums over films
// with edges along rows or columns may have more variance than with places of their own. Sums batch
// by batch show it.
#include <array>

#include "integrators/estimates/tiles.h"
#include "limn/core/film.h"
#include "limn/core/rng.h"

namespace limn {

struct SharedPlace {
  static constexpr int kMostReach = 3;  // pixels; wider filters would add to too many. Not tuned
  static constexpr int kMostSide = 2 * kMostReach + 1;

  // How many pixels from its own a sample may serve on every side: 0 if it serves its own alone, as
  // with box filters, and on films most of whose pixels have samples of their own.
  static int reach_of(const Film& film);

  // Mean of `squares`: what of a sample's variance is left in a pixel, where it is alike in all.
  static double mean_squares(const Filter& filter, int reach);

  // key: of this sample of all pixels. served: reach_of().
  SharedPlace(const Filter& filter, int served, const Rng& key);

  int reach;
  double x, y;  // in the pixel, [0, 1]
  // Rows of 2 reach + 1: of the pixel `reach` below and to the right first, up to that above and to
  // the left.
  std::array<double, size_t{kMostSide} * kMostSide> weights;
  double squares;  // sum of the weights' squares
};

// The pixels that shared samples serve: those whose whole filters lie on the sampled part of the
// film.
Tile served_pixels(const Film& film);

}  // namespace limn
