// Exact signs for lines on a grid: a 3 by 3 determinant in 128-bit integers, with a floating-point
// filter.
#include "src/regions/grid_line.h"

#include <bit>

namespace limn {
namespace {

using Wide = __int128;

// The intersection of two lines in homogeneous coordinates: |x|, |y| < 2^95, |w| <= 2^63.
struct Meeting {
  Wide x, y, w;
};
Meeting exact_meeting(const GridLine& l, const GridLine& m) {
  return {Wide(l.b) * m.c - Wide(m.b) * l.c, Wide(l.c) * m.a - Wide(m.c) * l.a,
          Wide(l.a) * m.b - Wide(m.a) * l.b};
}

// Conversion with a single rounding, equal to the compiler's but faster: bits shifted out are kept
// as one sticky bit.
double to_double(Wide value) {
  using Unsigned = unsigned __int128;
  const bool negative = value < 0;
  const Unsigned size = negative ? -static_cast<Unsigned>(value) : static_cast<Unsigned>(value);
  const auto high = static_cast<uint64_t>(size >> 64);
  double result;
  if (high == 0) {
    result = static_cast<double>(static_cast<uint64_t>(size));
  } else {
    const int shift = 64 - std::countl_zero(high);
    const bool rest = (size & ((Unsigned(1) << shift) - 1)) != 0;
    result = static_cast<double>(static_cast<uint64_t>(size >> shift) | rest) *
             std::bit_cast<double>(static_cast<uint64_t>(1023 + shift) << 52);
  }
  return negative ? -result : result;
}

}  // namespace

GridCorner meet(const GridLine& l, const GridLine& m) {
  const Meeting p = exact_meeting(l, m);
  const double w = to_double(p.w);
  return {to_double(p.x) / w, to_double(p.y) / w};
}

int exact_side(const GridLine& line, const GridLine& l, const GridLine& m) {
  // A side shared with a neighbour that was inserted earlier: the most frequent case of zero.
  const GridLine flipped = line.flipped();
  if (l == line || l == flipped || m == line || m == flipped) return 0;
  const Meeting p = exact_meeting(l, m);
  // Corners of regions lie in the window, so x and y are below 2^93, each product below 2^125.
  const Wide value = line.a * p.x + line.b * p.y + line.c * p.w;
  return value > 0 ? 1 : value < 0 ? -1 : 0;
}

}  // namespace limn
