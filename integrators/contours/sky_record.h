#pragma once
// Which directions of the sky points see, independent of the radiance there: single directions of
// points that look straight into it, and of others the unoccluded ranges of LineLight's lines. With
// a map in place of the sky the light that they scatter is a sum over the ends of these ranges
// (radiance_columns.h).
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "limn/core/environment.h"

namespace limn {

// The frame that angles are kept in, Mitsuba's for maps: theta from +y, azimuths from -z to +x.
inline Environment::Grid upright_grid() { return {{0, 1, 0}, {0, 0, -1}, {1, 0, 0}, 0, 0}; }

class SkyRecord {
 public:
  // grid: its axes are kept as those of upright_grid().
  SkyRecord(const Environment::Grid& grid, int lines) : grid_(grid), lines_(lines) {}

  const Environment::Grid& grid() const { return grid_; }
  // A point of a pixel that sees the sky in this direction.
  void add_view(const Vec3d& direction, double weight);
  // A point that scatters `scale` times n . w times the radiance from w, seen along lines at
  // azimuths (j + offset) / lines turns from `zero`, towards `quarter` or (`back`) away from it.
  void begin(const Rgb<double>& scale, const Vec3d& n, double offset, bool back);
  // A free range of line j, by angles from the grid's pole.
  void add_range(size_t j, double theta0, double theta1) {
    ranges_.push_back({static_cast<uint32_t>(back_ ? lines_ - 1 - j : j), theta0, theta1});
  }
  void end();

  // All of it. Of each point 7 numbers: scale (rgb), n or direction, offset (negative: it looks
  // straight into the sky). Then of each line the ends of its ranges in ascending order [rad],
  // without beginnings at 0, or one 0 if it is occluded; the sign bit marks the last.
  const std::vector<float>& numbers() const { return numbers_; }

  struct Point {
    Rgb<double> scale;
    Vec3d w;  // n or direction
    double offset;
    bool is_view() const { return offset < 0; }
  };
  // visit(point, angles of all its lines) for all points. numbers: of whole ones.
  template <class Visit>
  static void for_each(std::span<const float> numbers, int lines, const Visit& visit);

 private:
  struct Range {
    uint32_t line;
    double theta0, theta1;
  };
  void add(const Rgb<double>& scale, const Vec3d& w, double offset);

  Environment::Grid grid_;
  int lines_;
  bool back_ = false;
  std::vector<Range> ranges_;  // of the point at hand
  std::vector<float> numbers_;
};

template <class Visit>
void SkyRecord::for_each(std::span<const float> numbers, int lines, const Visit& visit) {
  constexpr size_t kOfPoint = 7;
  while (numbers.size() >= kOfPoint) {
    const std::span<const float> x = numbers.first(kOfPoint);
    const Point point{{x[0], x[1], x[2]}, {x[3], x[4], x[5]}, x[6]};
    numbers = numbers.subspan(kOfPoint);
    size_t size = 0;
    for (int left = point.is_view() ? 0 : lines; left > 0; ++size) {
      if (size == numbers.size()) return;
      left -= std::signbit(numbers[size]);
    }
    visit(point, numbers.first(size));
    numbers = numbers.subspan(size);
  }
}

}  // namespace limn
