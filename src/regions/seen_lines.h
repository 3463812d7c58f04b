#pragma once
// From a face on the plane to lines on the grid of one window.
#include <optional>

#include "limn/core/visible_regions.h"
#include "src/regions/grid_line.h"

namespace limn {

// Coordinates of a window: its center at 0, its sides at +-kGridHalf.
class WindowGrid {
 public:
  explicit WindowGrid(const PlaneWindow& window)
      : center_(window.center),
        x_steps_(kGridHalf / window.half_width),
        y_steps_(kGridHalf / window.half_height) {}

  PlanePoint to_grid(const PlanePoint& p) const {
    return {(p.x - center_.x) * x_steps_, (p.y - center_.y) * y_steps_};
  }
  PlanePoint to_plane(const GridCorner& p) const {
    return {center_.x + p.x / x_steps_, center_.y + p.y / y_steps_};
  }
  PlaneFunction to_plane(const GridLine& l) const {
    const double a = static_cast<double>(l.a) * x_steps_, b = static_cast<double>(l.b) * y_steps_;
    return {a, b, static_cast<double>(l.c) - a * center_.x - b * center_.y};
  }
  PlaneFunction to_grid(const PlaneFunction& f) const {
    return {f.a / x_steps_, f.b / y_steps_, f.at(center_)};
  }

 private:
  PlanePoint center_;
  double x_steps_, y_steps_;
};

// How a half-plane meets the window.
enum class Reach { kHoldsAll, kHoldsNone, kCuts };
struct HalfPlane {
  Reach reach;
  GridLine line;  // if it cuts
};

// Which way the face's corners go round, as its corners on the grid say, if all are within the
// band: 1, -1, or 0 if it has no area there.
int orientation_on_grid(const SeenFace& face, const WindowGrid& grid);

// What is on the face's side of one of its sides.
HalfPlane half_plane_of(const SeenFace::Side& side, bool counter_clockwise, const WindowGrid& grid);
// Where a function on the grid is not negative. Its negative gives the same line, flipped.
HalfPlane half_plane_of(const PlaneFunction& f);

}  // namespace limn
