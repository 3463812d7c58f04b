#pragma once
// The film: which pixels are made, and the reconstruction filter that defines them.
#include <vector>

#include "limn/core/error.h"
#include "limn/core/image.h"
#include "limn/core/rng.h"

namespace limn {

// A separable reconstruction filter, Mitsuba 3's: box, tent, gaussian.
struct Filter {
  enum class Kind { kBox, kTent, kGaussian };
  Kind kind = Kind::kGaussian;
  double radius = 2;    // pixels; outside the filter is 0
  double stddev = 0.5;  // gaussian only

  double eval(double x) const;
  // Integral of the filter from -radius to x.
  double integral(double x) const;
  // An offset in [lower, upper], a part of [-radius, radius] that holds more than zero of the
  // filter, with density eval(x) / (integral(upper) - integral(lower)).
  double sample(double lower, double upper, Rng& rng) const;
};

// A pixel's value is the filter's weighted mean of the radiance over the film: I_j = sum over the
// two axes' product filter, divided by the filter's integral over the part of the film where
// samples may fall. That part is the crop window, or, with sample_border, unbounded.
struct Film {
  int crop_x = 0;
  int crop_y = 0;
  int crop_width = 768;
  int crop_height = 576;
  bool sample_border = false;
  bool luminance = false;  // one channel in written files
  bool half = true;        // component_format float16
  Filter filter;
  SourceLocation where;  // of the filter; of the film, if it names none

  // The part of the filter's support around the center of full-film column (or row) `pixel` where
  // samples may fall, as offsets from that center.
  struct Range {
    double lower, upper;
  };
  Range range_x(int pixel) const;
  Range range_y(int pixel) const;
};

// crop_height by crop_width by 3 values as an image of the film's size.
Image to_image(const std::vector<double>& values, const Film& film);

}  // namespace limn
