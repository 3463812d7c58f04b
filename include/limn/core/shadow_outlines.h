#pragma once
// The border of what is left of some triangles of a plane (a lamp's) after others (what is before
// it) are taken away, as pieces of their sides. After the contours of Nowrouzezahrai, Baran,
// Mitchell, Jarosz 2014, with integers: W(x) of the shading triangles cover the point x, which is
// lit where W = 0. Sides of neighbours cancel, so that outlines are left; across each of these W
// changes by a known number, and whether two of them cross is decided exactly on a grid. So W never
// contradicts itself, whatever the triangles are.
#include <compare>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace limn {

class ShadowOutlines {
 public:
  struct Point {
    int64_t x, y;  // |x|, |y| <= kMost
    bool operator==(const Point&) const = default;
    // By x, then by y, as if the plane were sheared a little: no side is vertical.
    auto operator<=>(const Point&) const = default;
  };
  static constexpr int64_t kMost = int64_t{1} << 60;

  void clear();
  // A convex polygon, either way round, of the lamp or before it; tags[i] is the side from corner i
  // to the next one. Corners in one place are allowed. cancelled: bit i stands for side i, which is
  // left out; it must cancel with one of another polygon that is left out, too.
  void add(std::span<const Point> corners, std::span<const uint32_t> tags, bool of_lamp,
           uint32_t cancelled = 0);

  enum class Kind : uint8_t { kFirst, kSecond, kCrossing };
  // Where a piece ends: at an end of the side `tag` (the first or second of its lexicographic
  // order), or where its own side crosses that of `tag`.
  struct End {
    uint32_t tag;
    Kind kind;
    Point at;  // of a crossing about there
  };
  struct Piece {
    uint32_t tag;       // of its side
    Point first, last;  // ends of that side
    End from, to;       // of the piece, in the same order
    bool lit_above;     // to the left of the way from `from` to `to`; else to the right
  };
  // Calls visit(piece) for every piece of the border of what is lit.
  void for_each(const std::function<void(const Piece&)>& visit);

 private:
  struct Edge {
    Point p, q;  // p < q
    uint32_t tag;
    int lamp, cover;  // how much more there is below than above
    bool narrow;      // both ends are near the window: 64 bits decide
  };
  // What may tell something of a side: the bounds of all, side by side.
  struct Bounds {
    std::vector<float> x0, x1, y0, y1;
  };
  struct Event {
    double at;  // along the edge, 0 to 1
    uint32_t other;
    Kind kind;
    int lamp, cover;  // how much more is above after it
  };
  void compare(const Edge& s, uint32_t t, bool later, int& lamp, int& cover);
  template <class Integer>
  void compare_ends(const Edge& s, uint32_t t, bool later, int& lamp, int& cover);
  void find_candidates(uint32_t i);

  void grow();
  uint32_t& slot_of(const Edge& edge);

  static constexpr uint32_t kEmpty = UINT32_MAX;
  std::vector<Edge> sides_;      // all that were added, each once
  std::vector<uint32_t> table_;  // of them, by a hash of their ends; a power of two of slots
  std::vector<Edge> edges_;
  Bounds bounds_;  // of edges_
  std::vector<uint32_t> near_, candidates_;
  std::vector<Event> events_;
};

}  // namespace limn
