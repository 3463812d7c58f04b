// Lines are sorted by their distance from the film's corner; neighbours are compared.
#include "integrators/terms/film_lines.h"

#include <algorithm>
#include <cmath>

#include "integrators/terms/camera_edges.h"

namespace limn {
namespace {

// Depths that differ by less of themselves are one: aside of the camera (Viewpoint) such edges lie
// no farther apart than floats can tell. Not tuned.
constexpr double kLeastDepth = 0x1p-10;

// A line {x: n . x = offset} on the film, in one of its two signs.
struct Line {
  double offset;
  uint32_t edge;
};

double fraction_along(const FilmEdge& edge, double x, double y) {
  const double dx = edge.x1 - edge.x0, dy = edge.y1 - edge.y0;
  return ((x - edge.x0) * dx + (y - edge.y0) * dy) / (edge.length * edge.length);
}
double depth_at(const FilmEdge& edge, double s) {
  return 1 / ((1 - s) / edge.depth0 + s / edge.depth1);
}

// Whether the ends of b lie on the line of a, and some of b lies before or behind a.
bool are_in_line(const FilmEdge& a, const FilmEdge& b, double tolerance) {
  const auto is_off = [&](double x, double y) {
    return std::fabs(a.nx * (x - a.x0) + a.ny * (y - a.y0)) > tolerance;
  };
  if (is_off(b.x0, b.y0) || is_off(b.x1, b.y1)) return false;
  const double s0 = fraction_along(a, b.x0, b.y0), s1 = fraction_along(a, b.x1, b.y1);
  const double from = std::max(0.0, std::min(s0, s1)), to = std::min(1.0, std::max(s0, s1));
  if ((to - from) * a.length <= tolerance) return false;
  const double s = 0.5 * (from + to);
  const double depth = depth_at(a, s);
  const double other = depth_at(b, std::clamp((s - s0) / (s1 - s0), 0.0, 1.0));
  return std::fabs(depth - other) > kLeastDepth * (depth + other);
}

}  // namespace

std::vector<bool> find_edges_in_line(std::span<const FilmEdge> edges, const Camera& camera) {
  const double width = 2 * camera.x_factor * std::tan(value(camera.fov) * (kPi / 360));
  const double tolerance = kEdgeOn * camera.width / width;
  std::vector<Line> lines;
  for (uint32_t e = 0; e < edges.size(); ++e) {
    const FilmEdge& edge = edges[e];
    // In one sign, or in both where rounding may choose either.
    const double sign = edge.ny < 0 || (edge.ny == 0 && edge.nx < 0) ? -1 : 1;
    const double offset = sign * (edge.nx * edge.x0 + edge.ny * edge.y0);
    lines.push_back({offset, e});
    if (std::fabs(edge.ny) < 0x1p-10) lines.push_back({-offset, e});
  }
  std::sort(lines.begin(), lines.end(), [](const Line& a, const Line& b) {
    return a.offset < b.offset || (a.offset == b.offset && a.edge < b.edge);
  });
  std::vector<bool> in_line(edges.size());
  for (size_t i = 0; i < lines.size(); ++i) {
    for (size_t j = i + 1; j < lines.size(); ++j) {
      if (lines[j].offset - lines[i].offset > 2 * tolerance) break;
      const uint32_t a = lines[i].edge, b = lines[j].edge;
      if (a == b || (in_line[a] && in_line[b])) continue;
      const bool a_longer = edges[a].length >= edges[b].length;
      if (are_in_line(edges[a_longer ? a : b], edges[a_longer ? b : a], tolerance))
        in_line[a] = in_line[b] = true;
    }
  }
  return in_line;
}

}  // namespace limn
