#pragma once
// The film: the pixels that are rendered, and the reconstruction filter that defines them.
#include <array>
#include <vector>

#include "limn/core/error.h"
#include "limn/core/image.h"

namespace limn {

// A separable reconstruction filter, as in Mitsuba 3.
struct Filter {
  enum class Kind { kBox, kTent, kGaussian, kCubic, kLanczos };
  Kind kind = Kind::kGaussian;
  double radius = 2;    // pixels; the filter is 0 outside
  double stddev = 0.5;  // gaussian only
  double b = 0, c = 0;  // cubic only: Mitchell and Netravali's (1988) parameters
  double half = 0;      // lanczos only: integral from 0 to the radius

  double eval(double x) const;
  double slope(double x) const;  // the derivative of eval; at a tent's tip 0
  // Integral of the filter from -radius to x.
  double integral(double x) const;
  // Whether the filter has negative lobes.
  bool is_signed() const { return kind == Kind::kCubic || kind == Kind::kLanczos; }
  // The inverse of the filter's cumulative distribution on [lower, upper]: the offset below which
  // the fraction u of the filter's integral over [lower, upper] lies. That integral must be
  // positive, and the filter nowhere negative. Exact to rounding; FilterTable is faster for many.
  double quantile(double lower, double upper, double u) const;
};

Filter cubic_filter(double b, double c);
Filter lanczos_filter(int lobes);

// A table of filter quantiles: piecewise polynomials in the integral up to x < 0. Each power of two
// has the same number of knots, since x varies as the root of the integral near the end. For a
// filter with negative lobes the table holds a density instead, constant in narrow bins and close
// to the filter's absolute value.
class FilterTable {
 public:
  explicit FilterTable(const Filter& filter);

  // The quantile of the filter (to rounding) or of the bins. For u uniform in [0, 1) the offset has
  // the density `pdf` [1 / pixel]. The normalised filter, eval(x) / (integral(upper) -
  // integral(lower)), is `weight` times `pdf`; without bins the weight is 1.
  double quantile(double lower, double upper, double u) const;
  double pdf(double lower, double upper, double x) const;
  double weight(double lower, double upper, double x) const;

 private:
  // The integral of the bins' unnormalised density from -radius to x.
  static constexpr int kBins = 32;  // per pixel
  double mass(double x) const;

  // With these, a gaussian's error is of the size of rounding.
  static constexpr int kNodes = 9;      // per piece
  static constexpr int kPieceBits = 3;  // log2 of the pieces per power of two
  static constexpr int kPowers = 24;    // tabulated powers of two
  using Piece = std::array<double, kNodes>;
  static const Piece& nodes();
  double integral(double x) const;

  Filter filter_;
  double total_;               // integral of the whole filter
  std::vector<Piece> pieces_;  // Newton's divided differences; none for a box and bins
  std::vector<double> upto_;   // mass at the beginning of each bin, and at the end
};

// A pixel's value is the filter's weighted mean of the radiance over the film. I_j is the integral
// of the product filter times radiance, divided by the filter's integral over the sampled part of
// the film: the crop window, or, with sample_border, the unbounded plane.
struct Film {
  int crop_x = 0;
  int crop_y = 0;
  int crop_width = 768;
  int crop_height = 576;
  bool sample_border = false;
  bool luminance = false;  // write a single channel
  bool half = true;        // component_format float16
  Filter filter;
  SourceLocation where;  // location of the filter element, or of the film

  // The sampled part of the filter's support around the center of full-film column (or row)
  // `pixel`, as offsets from that center.
  struct Range {
    double lower, upper;
  };
  Range range_x(int pixel) const;
  Range range_y(int pixel) const;
};

// InputError at `where` for a film of more than kMaxPixels, or for which there is no memory.
void check_film_size(const SourceLocation& where, int width, int height, const std::string& remedy);

// Converts crop_height by crop_width by 3 values to an image of the film's full size.
Image to_image(const std::vector<double>& values, const Film& film);

}  // namespace limn
