// Divides and conquers: the envelopes of both halves are merged from left to right.
#include "integrators/terms/lifted_faces.h"

#include <algorithm>
#include <limits>

namespace limn {
namespace {

// A part of segments[index], between t0 and t1.
struct Part {
  uint32_t index;
  double t0, t1;
};

class Envelope {
 public:
  explicit Envelope(std::span<const Stretch> segments) : segments_(segments) {}

  std::vector<Part> of(uint32_t first, uint32_t last) const {
    if (last - first == 1) return {{first, segments_[first].t0, segments_[first].t1}};
    const uint32_t middle = first + (last - first) / 2;
    return merge(of(first, middle), of(middle, last));
  }

 private:
  double at(const Part& part, double t) const { return segments_[part.index].at(t); }
  bool wins(const Part& a, const Part& b, double above) const {
    if (above != 0) return above > 0;
    return segments_[a.index].label <= segments_[b.index].label;
  }

  static void add(const Part& part, double t0, double t1, std::vector<Part>& parts) {
    if (!(t1 > t0)) return;
    if (!parts.empty() && parts.back().index == part.index && parts.back().t1 == t0) {
      parts.back().t1 = t1;
    } else {
      parts.push_back({part.index, t0, t1});
    }
  }
  // Both parts reach from t0 to t1.
  void add_upper(const Part& a, const Part& b, double t0, double t1,
                 std::vector<Part>& parts) const {
    const double above_0 = at(a, t0) - at(b, t0), above_1 = at(a, t1) - at(b, t1);
    if ((above_0 > 0 && above_1 < 0) || (above_0 < 0 && above_1 > 0)) {
      const double t = std::clamp(t0 + (t1 - t0) * (above_0 / (above_0 - above_1)), t0, t1);
      add(above_0 > 0 ? a : b, t0, t, parts);
      add(above_1 > 0 ? a : b, t, t1, parts);
    } else {
      add(wins(a, b, above_0 + above_1) ? a : b, t0, t1, parts);
    }
  }
  std::vector<Part> merge(const std::vector<Part>& a, const std::vector<Part>& b) const {
    constexpr double kEnd = std::numeric_limits<double>::infinity();
    std::vector<Part> parts;
    size_t i = 0, j = 0;
    double t = std::min(a.front().t0, b.front().t0);
    while (i < a.size() || j < b.size()) {
      const bool in_a = i < a.size() && a[i].t0 <= t, in_b = j < b.size() && b[j].t0 <= t;
      const double end_a = i == a.size() ? kEnd : in_a ? a[i].t1 : a[i].t0;
      const double end_b = j == b.size() ? kEnd : in_b ? b[j].t1 : b[j].t0;
      const double end = std::min(end_a, end_b);
      if (in_a && in_b) {
        add_upper(a[i], b[j], t, end, parts);
      } else if (in_a || in_b) {
        add(in_a ? a[i] : b[j], t, end, parts);
      }
      t = end;
      if (in_a && a[i].t1 <= t) ++i;
      if (in_b && b[j].t1 <= t) ++j;
    }
    return parts;
  }

  std::span<const Stretch> segments_;
};

}  // namespace

std::vector<Stretch> upper_envelope(std::span<const Stretch> segments) {
  std::vector<Stretch> upper;
  if (segments.empty()) return upper;
  for (const Part& part : Envelope(segments).of(0, static_cast<uint32_t>(segments.size()))) {
    const Stretch& of = segments[part.index];
    upper.push_back({part.t0, part.t1, of.at(part.t0), of.at(part.t1), of.label});
  }
  return upper;
}

}  // namespace limn
