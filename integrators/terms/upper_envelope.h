#pragma once
// The upper envelope of straight segments over a line.
#include <cstdint>
#include <span>
#include <vector>

namespace limn {

// The segment from (t0, k0) to (t1, k1), t0 < t1.
struct Stretch {
  double t0, t1, k0, k1;
  uint32_t label;

  double at(double t) const { return k0 + (k1 - k0) * ((t - t0) / (t1 - t0)); }
};

// The parts of segments that lie above all others, ascending and disjoint; where two coincide, the
// lower label wins. Takes time n log n for n segments.
std::vector<Stretch> upper_envelope(std::span<const Stretch> segments);

}  // namespace limn
