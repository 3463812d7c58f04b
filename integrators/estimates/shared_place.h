#pragma once
// Samples that lie at one place in all pixels, and serve every pixel whose filter reaches them.
//
// An offset from a pixel's center that is drawn from the filter f is a whole number m of pixels and
// a place d in a pixel, of density S(d) = sum_m f(d + m) along each axis; given d, f(d + m) / S(d)
// draws m. Here d alone is drawn, and all m are taken with these weights. So an image has the same
// expectation, and less variance, as nothing is left of the choice of m. The weights add up to 1:
// a constant has no error. Pixels whose filters the film's border cuts have samples of their own;
// with sample_border there are none, and pixels around the film have samples that serve it.
#include <array>
#include <span>

#include "integrators/estimates/sample_estimator.h"
#include "limn/core/film.h"

namespace limn {

struct SharedPlace {
  static constexpr int kMostReach = 3;  // pixels; wider filters would add to too many. Not tuned
  static constexpr int kMostSide = 2 * kMostReach + 1;

  // How many pixels from its own a sample may serve on every side: 0 if it serves its own alone, as
  // with box filters.
  static int reach_of(const Film& film);

  // key: of this sample of all pixels.
  SharedPlace(const Filter& filter, int reach, const Rng& key);

  double x, y;  // in the pixel, [0, 1]
  // Rows of 2 reach + 1: of the pixel `reach` below and to the right first, up to that above and to
  // the left.
  std::array<double, size_t{kMostSide} * kMostSide> weights;
};

// Whether the whole filter around pixel (x, y) lies on the film.
bool is_whole(const Film& film, int x, int y);

// Estimators of images by such samples.
class SharingEstimator : public SampleEstimator {
 public:
  // See SharedPlace::reach_of; 0: its samples are those of any estimator.
  virtual int reach() const = 0;
  // As SampleEstimator::add_pixels, but sample i adds radiance to all that it serves of the film:
  // pixels whose filters are whole.
  virtual void add_shared(std::span<const KeyedSample> samples,
                          std::span<const SharedPlace* const> places, SampleSink& sink) const = 0;
};

}  // namespace limn
