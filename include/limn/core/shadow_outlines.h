#pragma once
// The boundary of the visible part of an emitter in its plane: emitter triangles minus the
// occluder triangles in front of them, as pieces of triangle sides. Based on contours of
// Nowrouzezahrai, Baran, Mitchell, Jarosz 2014, with integers. The winding number W(x) counts the
// occluders over x, which is lit where W = 0. Interior sides cancel. Across each remaining outline
// W changes by a known number, and intersections are decided exactly on a grid. Thus W is always
// consistent.
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
    // Ordered by x, then y: equivalent to a slight shear, so no side is vertical.
    auto operator<=>(const Point&) const = default;
  };
  static constexpr int64_t kMost = int64_t{1} << 60;

  void clear();
  // Adds a convex polygon of either winding, of the emitter or an occluder. tags[i] names the side
  // from corner i to the next. Corners may coincide. Bit i of cancelled omits side i; it must
  // cancel against an omitted side of another polygon.
  void add(std::span<const Point> corners, std::span<const uint32_t> tags, bool of_light,
           uint32_t cancelled = 0);

  enum class Kind : uint8_t { kFirst, kSecond, kIntersection };
  // An end of a piece: the first or second end (in lexicographic order) of the side `tag`, or the
  // intersection of the piece's own side with it.
  struct End {
    uint32_t tag;
    Kind kind;
    Point at;  // approximate position of the intersection
  };
  struct Piece {
    uint32_t tag;       // of its side
    Point first, last;  // ends of that side
    End from, to;       // of the piece, in the same order
    bool lit_above;     // to the left of the way from `from` to `to`; else to the right
  };
  // Calls visit(piece) for every piece of the boundary of the lit region.
  void for_each(const std::function<void(const Piece&)>& visit);

 private:
  struct Edge {
    Point p, q;  // p < q
    uint32_t tag;
    int light, cover;  // change of the winding numbers from above to below
    bool narrow;       // coordinates are small: 64-bit arithmetic suffices
  };
  // Bounds of all sides, in structure-of-arrays layout for culling.
  struct Bounds {
    std::vector<float> x0, x1, y0, y1;
  };
  struct Event {
    double at;  // along the edge, 0 to 1
    uint32_t other;
    Kind kind;
    int light, cover;  // change of the winding numbers above the edge
  };
  void compare(const Edge& s, uint32_t t, bool later, int& light, int& cover);
  template <class Integer>
  void compare_ends(const Edge& s, uint32_t t, bool later, int& light, int& cover);
  void find_candidates(uint32_t i);

  void grow();
  uint32_t& slot_of(const Edge& edge);

  static constexpr uint32_t kEmpty = UINT32_MAX;
  std::vector<Edge> sides_;      // all distinct sides
  std::vector<uint32_t> table_;  // hash table of them by their ends; its size is a power of two
  std::vector<Edge> edges_;
  Bounds bounds_;  // of edges_
  std::vector<uint32_t> near_, candidates_;
  std::vector<Event> events_;
};

}  // namespace limn
