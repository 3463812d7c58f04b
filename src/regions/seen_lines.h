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

// The lines of a face that cut the window.
struct FaceLines {
  GridLine lines[6];  // the face lies on their positive side
  int8_t numbers[6];  // the side that it is, SeenFace::Side::number; of a cut -1 minus its index
  int count = 0;
};
// False if the face does not reach into the window, or has no area on its grid.
bool lines_of(const SeenFace& face, const WindowGrid& grid, FaceLines& lines);

// Where a function on the grid is not negative. Its negative gives the same line, flipped.
HalfPlane half_plane_of(const PlaneFunction& f);

}  // namespace limn
