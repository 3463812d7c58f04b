// Lines through grid points of a window. Lines of a vertex are the same for all of its faces.
#include "src/regions/seen_lines.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// A line misses the window only if its distance exceeds this share of the window's size: far above
// the rounding of its points, and far below the band.
constexpr double kClear = 0x1p-20;

bool in_band(const PlanePoint& p) {
  return std::fabs(p.x) <= kGridBand && std::fabs(p.y) <= kGridBand;
}

GridPoint rounded(const PlanePoint& p) {
  const auto whole = [](double x) { return std::llrint(std::clamp(x, -kGridBand, kGridBand)); };
  return {whole(p.x), whole(p.y)};
}

// The points where the line through p along d leaves the band, and whether it meets the window.
struct Exits {
  PlanePoint back, front;
};
Exits leave_band(const PlanePoint& p, const PlanePoint& d) {
  double t0 = -1e300, t1 = 1e300;
  const auto clip = [&](double x, double slope) {
    if (slope == 0) return;
    const double a = (-kGridBand - x) / slope, b = (kGridBand - x) / slope;
    t0 = std::max(t0, std::min(a, b));
    t1 = std::min(t1, std::max(a, b));
  };
  clip(p.x, d.x);
  clip(p.y, d.y);
  return {{p.x + t0 * d.x, p.y + t0 * d.y}, {p.x + t1 * d.x, p.y + t1 * d.y}};
}

Reach reach_of(double at_center, double change) {
  if (at_center > change * (1 + kClear)) return Reach::kHoldsAll;
  if (at_center < -change * (1 + kClear)) return Reach::kHoldsNone;
  return Reach::kCuts;
}

HalfPlane flipped_if(bool flip, const HalfPlane& h) {
  if (!flip) return h;
  if (h.reach == Reach::kCuts) return {h.reach, h.line.flipped()};
  return {h.reach == Reach::kHoldsAll ? Reach::kHoldsNone : Reach::kHoldsAll, {}};
}

// The half-plane to the left of two points; `whole`: both are corners of a face.
HalfPlane left_of(const PlanePoint& from, bool from_corner, const PlanePoint& to, bool to_corner) {
  const PlanePoint d{to.x - from.x, to.y - from.y};
  const double at_center = d.y * from.x - d.x * from.y;
  const Reach reach = reach_of(at_center, (std::fabs(d.x) + std::fabs(d.y)) * kGridHalf);
  if (reach != Reach::kCuts) return {reach, {}};
  const bool keep_from = from_corner && in_band(from), keep_to = to_corner && in_band(to);
  Exits exits{from, to};
  if (!keep_from || !keep_to) exits = leave_band(from, d);
  const GridPoint p = rounded(keep_from ? from : exits.back);
  const GridPoint q = rounded(keep_to ? to : exits.front);
  return {reach, line_through(p, q)};
}

HalfPlane half_plane_of(const SeenFace::Side& side, bool counter_clockwise,
                        const WindowGrid& grid) {
  HalfPlane h =
      left_of(grid.to_grid(side.from), side.from_corner, grid.to_grid(side.to), side.to_corner);
  // Both ends round to one point: the two other sides meet there and bound the face.
  if (h.reach == Reach::kCuts && h.line.a == 0 && h.line.b == 0) return {Reach::kHoldsAll, {}};
  return flipped_if(side.reversed == counter_clockwise, h);
}

// Relation of a line through two grid points to the window.
Reach reach_of(const GridLine& line) {
  const int64_t most = (std::abs(line.a) + std::abs(line.b)) << 29;  // of |a x + b y| inside
  if (line.c >= most) return Reach::kHoldsAll;
  return line.c <= -most ? Reach::kHoldsNone : Reach::kCuts;
}

bool add(const HalfPlane& h, int number, FaceLines& lines) {
  if (h.reach == Reach::kCuts) {
    lines.numbers[lines.count] = static_cast<int8_t>(number);
    lines.lines[lines.count++] = h.line;
  }
  return h.reach != Reach::kHoldsNone;
}

// Sides of a face with all corners in the band, in integer arithmetic.
bool add_sides(const SeenFace& face, const GridPoint (&corners)[3], FaceLines& lines) {
  const int64_t area = twice_area(corners[0], corners[1], corners[2]);
  if (area == 0) return false;
  for (int k = 0; k < 3; ++k) {
    const GridPoint &p = corners[k], &q = corners[(k + 1) % 3];
    const GridLine line = area > 0 ? line_through(p, q) : line_through(q, p);
    if (!add({reach_of(line), line}, face.sides[k].number, lines)) return false;
  }
  return true;
}

}  // namespace

bool lines_of(const SeenFace& face, const WindowGrid& grid, FaceLines& lines) {
  GridPoint corners[3];
  bool on_grid = face.whole;
  for (int k = 0; k < 3 && on_grid; ++k) {
    const SeenFace::Side& side = face.sides[k];
    const PlanePoint p = grid.to_grid(side.reversed ? side.to : side.from);
    on_grid = in_band(p);
    if (on_grid) corners[k] = rounded(p);
  }
  if (on_grid) {
    if (!add_sides(face, corners, lines)) return false;
  } else {
    for (int k = 0; k < face.side_count; ++k) {
      const SeenFace::Side& side = face.sides[k];
      if (!add(half_plane_of(side, face.counter_clockwise, grid), side.number, lines)) return false;
    }
  }
  for (int k = 0; k < face.cut_count; ++k) {
    if (!add(half_plane_of(grid.to_grid(face.cuts[k])), -1 - k, lines)) return false;
  }
  return true;
}

HalfPlane half_plane_of(const PlaneFunction& f) {
  // A function and its negative use the same order.
  const bool flip = f.a < 0 || (f.a == 0 && f.b < 0);
  const PlaneFunction g = flip ? PlaneFunction{-f.a, -f.b, -f.c} : f;
  const Reach reach = reach_of(g.c, (std::fabs(g.a) + std::fabs(g.b)) * kGridHalf);
  if (reach != Reach::kCuts) return flipped_if(flip, {reach, {}});
  const double steepness = g.a * g.a + g.b * g.b;
  if (steepness == 0) return flipped_if(flip, {Reach::kHoldsAll, {}});
  // The point closest to the center; positive to the left of d.
  const PlanePoint p{-g.c * g.a / steepness, -g.c * g.b / steepness}, d{g.b, -g.a};
  const Exits exits = leave_band(p, d);
  return flipped_if(flip, {reach, line_through(rounded(exits.back), rounded(exits.front))});
}

}  // namespace limn
