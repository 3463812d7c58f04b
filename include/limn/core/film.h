#pragma once
// The film: which pixels are made, and the reconstruction filter that defines them.
#include <array>
#include <vector>

#include "limn/core/error.h"
#include "limn/core/image.h"

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
  // The offset in [lower, upper], a part of [-radius, radius] that holds more than zero of the
  // filter, below which a part u of what it holds there lies. To rounding; see FilterTable for
  // many.
  double quantile(double lower, double upper, double u) const;
};

// Quantiles of a filter, tabulated: between knots polynomials in the integral up to x < 0 stand for
// x. Knots are so many to each power of two, as x goes with the root of the integral at the end.
class FilterTable {
 public:
  explicit FilterTable(const Filter& filter);

  // Filter::quantile to rounding: for u uniform in [0, 1) an offset with the density
  // eval(x) / (integral(upper) - integral(lower)).
  double quantile(double lower, double upper, double u) const;

 private:
  // No gaussian is off by more than rounding with these.
  static constexpr int kNodes = 9;      // of a piece
  static constexpr int kPieceBits = 3;  // the logarithm of the pieces of a power of two
  static constexpr int kPowers = 24;    // of two; what lies further out is not tabulated
  using Piece = std::array<double, kNodes>;
  static const Piece& nodes();
  double integral(double x) const;

  Filter filter_;
  double total_;               // the whole integral
  std::vector<Piece> pieces_;  // Newton's divided differences; none for a box
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
