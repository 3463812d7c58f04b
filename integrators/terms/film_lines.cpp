// Edges are sorted into the cells of a grid over the film. What lies in one line for a part of it
// has a cell in common.
#include "integrators/terms/film_lines.h"

#include <algorithm>
#include <cmath>

#include "integrators/terms/camera_edges.h"

namespace limn {
namespace {

// Depths that differ by less of themselves are one: aside of the camera (Viewpoint) such edges lie
// no farther apart than floats can tell. Not tuned.
constexpr double kLeastDepth = 0x1p-10;
// The same of speeds: those of a camera that moves differ as depths do. Not tuned.
constexpr double kLeastSpeed = 0x1p-11;
// Of the fastest: of what moves along its line, or within the plane through it and the camera.
constexpr double kRounding = 0x1p-16;
// Of the film's width: what is shorter is not reported. Of the edges of fine meshes some are in one
// line by chance: of edges of this length, a hundred widths in all, one pair in 200 scenes.
constexpr double kLeastReported = 0x1p-4;
// Edges in a cell, if they were points all over the film. Not tuned.
constexpr double kInCell = 4;
constexpr int kMostCells = 1 << 12;  // along an axis

double fraction_along(const FilmLine& line, double x, double y) {
  const double dx = line.x1 - line.x0, dy = line.y1 - line.y0;
  return ((x - line.x0) * dx + (y - line.y0) * dy) / (line.length * line.length);
}
double depth_at(const FilmLine& line, double s, bool parallel_rays) {
  if (parallel_rays) return (1 - s) * line.depth0 + s * line.depth1;
  return 1 / ((1 - s) / line.depth0 + s / line.depth1);
}

// Where the ends of what two edges have in common lie on either of them.
struct Common {
  double a[2], b[2];
};

// Whether the ends of b lie on the line of a, and some of b lies before or behind a.
std::optional<Common> in_common(const FilmLine& a, const FilmLine& b, double tolerance,
                                bool parallel_rays) {
  const auto is_off = [&](double x, double y) {
    return std::fabs(a.nx * (x - a.x0) + a.ny * (y - a.y0)) > tolerance;
  };
  if (is_off(b.x0, b.y0) || is_off(b.x1, b.y1)) return {};
  const double s0 = fraction_along(a, b.x0, b.y0), s1 = fraction_along(a, b.x1, b.y1);
  const double from = std::max(0.0, std::min(s0, s1)), to = std::min(1.0, std::max(s0, s1));
  if ((to - from) * a.length <= tolerance) return {};
  const auto on_b = [&](double s) { return std::clamp((s - s0) / (s1 - s0), 0.0, 1.0); };
  const Common common{{from, to}, {on_b(from), on_b(to)}};
  const double middle = 0.5 * (from + to);
  const double depth = depth_at(a, middle, parallel_rays);
  const double other = depth_at(b, on_b(middle), parallel_rays);
  if (std::fabs(depth - other) <= kLeastDepth * (depth + other)) return {};
  return common;
}

class Finder {
 public:
  Finder(std::span<const FilmEdge> moving, std::span<const FilmLine> resting, const Camera& camera)
      : moving_(moving), resting_(resting), parallel_rays_(camera.is_orthographic()) {
    // Of parallel rays those that are a 2^-18 of the film's width apart are one.
    const double width = camera.is_orthographic()
                             ? 1
                             : 2 * camera.x_factor * std::tan(value(camera.fov) * (kPi / 360));
    tolerance_ = kEdgeOn * camera.width / width;
    least_told_ = kLeastReported * camera.width;
    result_.in_line.resize(moving.size() + resting.size());
    for (const FilmEdge& e : moving)
      for (int i = 0; i < kLanes; ++i)
        fastest_[i] = std::max({fastest_[i], std::fabs(e.speed0[i]), std::fabs(e.speed1[i])});
  }

  EdgesInLine find() {
    lay_out_grid();
    std::vector<std::pair<uint32_t, uint32_t>> placed;  // cell, edge
    for (uint32_t e = 0; e < result_.in_line.size(); ++e)
      for_each_cell(line(e), [&](uint32_t cell) { placed.emplace_back(cell, e); });
    std::sort(placed.begin(), placed.end());
    for (size_t begin = 0, end; begin < placed.size(); begin = end) {
      for (end = begin; end < placed.size() && placed[end].first == placed[begin].first; ++end)
        continue;
      // Moving edges come first, and what rests is of no interest to its like.
      if (is_moving(placed[begin].second)) compare(std::span(placed).subspan(begin, end - begin));
    }
    result_.in_line.resize(moving_.size());
    return std::move(result_);
  }

 private:
  bool is_moving(uint32_t e) const { return e < moving_.size(); }
  const FilmLine& line(uint32_t e) const {
    if (is_moving(e)) return moving_[e];
    return resting_[e - moving_.size()];
  }

  // Around what moves.
  void lay_out_grid() {
    x0_ = y0_ = 1e300;
    double x1 = -1e300, y1 = -1e300;
    for (const FilmEdge& e : moving_) {
      x0_ = std::min({x0_, e.x0, e.x1}), x1 = std::max({x1, e.x0, e.x1});
      y0_ = std::min({y0_, e.y0, e.y1}), y1 = std::max({y1, e.y0, e.y1});
    }
    const double margin = 2 * tolerance_;
    x0_ -= margin, y0_ -= margin, x1 += margin, y1 += margin;
    const double count = static_cast<double>(result_.in_line.size());
    size_ = std::max(std::sqrt((x1 - x0_) * (y1 - y0_) * (kInCell / count)),
                     std::max(x1 - x0_, y1 - y0_) / kMostCells);
    columns_ = static_cast<int>((x1 - x0_) / size_) + 1;
    rows_ = static_cast<int>((y1 - y0_) / size_) + 1;
  }

  // Cells of the row or column that [from, to] and the tolerance around it reach.
  std::pair<int, int> cells(double from, double to, double origin, int count) const {
    const double low = (std::min(from, to) - tolerance_ - origin) / size_;
    const double high = (std::max(from, to) + tolerance_ - origin) / size_;
    return {static_cast<int>(std::clamp<double>(std::floor(low), 0, count)),
            static_cast<int>(std::clamp<double>(std::floor(high), -1, count - 1))};
  }
  template <class Visit>
  void for_each_cell(const FilmLine& e, const Visit& visit) const {
    const auto [first, last] = cells(e.y0, e.y1, y0_, rows_);
    for (int row = first; row <= last; ++row) {
      // The part in this row.
      double s0 = 0, s1 = 1;
      if (const double dy = e.y1 - e.y0; dy != 0) {
        const double top = y0_ + row * size_ - tolerance_ - e.y0;
        const double bottom = y0_ + (row + 1) * size_ + tolerance_ - e.y0;
        s0 = std::clamp(std::min(top / dy, bottom / dy), 0.0, 1.0);
        s1 = std::clamp(std::max(top / dy, bottom / dy), 0.0, 1.0);
      }
      const auto x = [&](double s) { return e.x0 + (e.x1 - e.x0) * s; };
      const auto [left, right] = cells(x(s0), x(s1), x0_, columns_);
      for (int column = left; column <= right; ++column)
        visit(static_cast<uint32_t>(row) * columns_ + column);
    }
  }

  // No two are compared that are in line with some edge already: many may be in one line.
  void compare(std::span<const std::pair<uint32_t, uint32_t>> cell) {
    found_.clear(), alone_.clear();
    for (const auto& [unused, e] : cell) {
      for (size_t k = 0; k < alone_.size();) {
        if (is_pair(alone_[k], e)) {
          found_.push_back(alone_[k]);
          alone_.erase(alone_.begin() + static_cast<ptrdiff_t>(k));
        } else {
          ++k;
        }
      }
      for (size_t k = 0; k < found_.size() && !result_.in_line[e]; ++k) is_pair(found_[k], e);
      if (is_moving(e)) (result_.in_line[e] ? found_ : alone_).push_back(e);
    }
  }

  bool is_pair(uint32_t a, uint32_t b) {
    const bool a_longer = line(a).length >= line(b).length;
    const uint32_t longer = a_longer ? a : b, shorter = a_longer ? b : a;
    const auto common = in_common(line(longer), line(shorter), tolerance_, parallel_rays_);
    if (!common) return false;
    result_.in_line[a] = result_.in_line[b] = true;
    const double length = (common->a[1] - common->a[0]) * line(longer).length;
    if (!result_.parting && length >= least_told_ && line(a).shape.valid() &&
        line(b).shape.valid() &&
        (part(longer, common->a[0], shorter, common->b[0]) ||
         part(longer, common->a[1], shorter, common->b[1]))) {
      const auto [first, second] = std::minmax(line(a).shape, line(b).shape);
      result_.parting = std::array{first, second};
    }
    return true;
  }

  // At the fractions s, t of their lengths.
  bool part(uint32_t a, double s, uint32_t b, double t) const {
    const auto speed = [&](uint32_t e, double at) {
      return is_moving(e) ? moving_[e].speed0 * (1 - at) + moving_[e].speed1 * at : Lanes{};
    };
    const double sign = line(a).nx * line(b).nx + line(a).ny * line(b).ny < 0 ? -1 : 1;
    const Lanes first = speed(a, s), second = speed(b, t) * sign;
    for (int i = 0; i < kLanes; ++i)
      if (std::fabs(first[i] - second[i]) >
          kLeastSpeed * (std::fabs(first[i]) + std::fabs(second[i])) + kRounding * fastest_[i])
        return true;
    return false;
  }

  std::span<const FilmEdge> moving_;
  std::span<const FilmLine> resting_;
  bool parallel_rays_;
  double tolerance_, least_told_;  // [pixels]
  Lanes fastest_;
  double x0_, y0_, size_;  // of the grid: its corner, a cell [pixels]
  int columns_, rows_;
  std::vector<uint32_t> found_, alone_;  // of one cell
  EdgesInLine result_;
};

}  // namespace

EdgesInLine find_edges_in_line(std::span<const FilmEdge> moving, std::span<const FilmLine> resting,
                               const Camera& camera) {
  if (moving.empty()) return {};
  return Finder(moving, resting, camera).find();
}

}  // namespace limn
