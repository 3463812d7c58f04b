// Lines of a grid on a face.
#include "src/texture/types.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// Where t, linear over the face from these values at its corners, is `level`, between two of them.
Texture::Discontinuity line_at(const std::array<double, 3>& t, double level) {
  std::array<std::array<double, 2>, 2> ends{};
  int count = 0;
  for (int k = 0; k < 3 && count < 2; ++k) {
    const int next = (k + 1) % 3;
    if ((t[k] < level) == (t[next] < level)) continue;
    const double s = (level - t[k]) / (t[next] - t[k]);
    if (k > 0) ends[count][k - 1] = 1 - s;
    if (next > 0) ends[count][next - 1] = s;
    ++count;
  }
  return {ends[0], ends[1]};
}

// Where it is a whole number.
bool add_lines(const std::array<double, 3>& t, size_t most, Texture::Discontinuities& lines) {
  const auto [least, greatest] = std::minmax({t[0], t[1], t[2]});
  // Lines so near to a side or corner are along it: texture coordinates are rounded to floats.
  const double near = 0x1p-24 * (greatest - least);
  for (int k = 0; k < 3; ++k) {
    const double a = t[k], b = t[(k + 1) % 3], line = std::round(a);
    if (std::fabs(a - line) <= near && std::fabs(b - line) <= near) lines.sides |= 1 << k;
  }
  const double first = std::floor(least + near) + 1, end = std::ceil(greatest - near);
  if (end - first > static_cast<double>(most) - static_cast<double>(lines.inside.size())) {
    return false;
  }
  for (double i = first; i < end; ++i) lines.inside.push_back(line_at(t, i));
  return true;
}

}  // namespace

bool add_grid_lines(const std::array<std::array<double, 2>, 3>& uv, const UvTransform& to_uv,
                    const std::array<int, 2>& per_unit, size_t most,
                    Texture::Discontinuities& lines) {
  std::array<std::array<double, 3>, 2> t;
  for (int k = 0; k < 3; ++k) {
    const std::array<double, 2> at = to_uv(uv[k]);
    for (int axis = 0; axis < 2; ++axis) t[axis][k] = at[axis] * per_unit[axis];
  }
  return add_lines(t[0], most, lines) && add_lines(t[1], most, lines);
}

}  // namespace limn
