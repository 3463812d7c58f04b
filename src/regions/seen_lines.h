#pragma once
// Converts a projected face to grid lines of a window.

#include "limn/core/visible_regions.h"
#include "src/regions/grid_line.h"

namespace limn {

// Window coordinates: center at 0, sides at +-kGridHalf.
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

// Relation of a half-plane to the window.
enum class Reach { kHoldsAll, kHoldsNone, kCuts };
struct HalfPlane {
  Reach reach;
  GridLine line;  // if it cuts the window
};

// The lines of a face that cross the window.
struct FaceLines {
  GridLine lines[6];  // the face lies on their positive side
  int8_t numbers[6];  // SeenFace::Side::number, or -1 minus the index of a cut
  int count = 0;
};
// False if the face is outside of the window or has no area on its grid.
bool lines_of(const SeenFace& face, const WindowGrid& grid, FaceLines& lines);

// The half-plane where a function is not negative. Its negation gives the flipped line.
HalfPlane half_plane_of(const PlaneFunction& f);

}  // namespace limn
