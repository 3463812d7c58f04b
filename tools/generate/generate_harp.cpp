// A harp: a frame and hundreds of thin strings, pins and levers. The parts do not touch, so that no
// surface crosses another.
#include <cmath>

#include "tools/generate/generate_kinds.h"
#include "tools/generate/generate_parts.h"

namespace limn {
namespace {

constexpr int kStrings = 72;  // in each of two rows

// The closed middle line of the frame: soundboard, neck, pillar. t in [0, 1) goes once around,
// from the foot up the soundboard.
Vec3d frame_line(double t) {
  static const std::vector<Vec3d> points = {
      {-0.5, -0.92, 0},  {-0.35, -0.58, 0}, {-0.08, -0.1, 0}, {0.28, 0.42, 0},  {0.56, 0.8, 0},
      {0.62, 0.97, 0},   {0.44, 1.0, 0},    {0.14, 0.88, 0},  {-0.16, 0.86, 0}, {-0.44, 1.02, 0},
      {-0.68, 1.1, 0},   {-0.78, 0.98, 0},  {-0.76, 0.5, 0},  {-0.74, 0, 0},    {-0.73, -0.5, 0},
      {-0.72, -0.82, 0}, {-0.65, -0.97, 0}};
  // The spline's ends are wrapped, three points on either side.
  const int n = static_cast<int>(points.size());
  const double at = t * n;
  const int i = static_cast<int>(std::floor(at));
  std::vector<Vec3d> four;
  for (int k = -1; k <= 2; ++k) four.push_back(points[(i + k + 2 * n) % n]);
  return spline(four, (1 + at - i) / 3);
}

double frame_radius(double t) { return 0.042 + 0.05 * std::exp(-120 * (t - 0.13) * (t - 0.13)); }

Triangles frame(double h) {
  const double size = arc_length(frame_line);
  const int along = steps(size, h, 34);
  std::vector<Ring> rings;
  for (int i = 0; i < along; ++i) {
    const double t = static_cast<double>(i) / along;
    rings.push_back(
        {frame_line(t), frame_line(t + 1e-4) - frame_line(t - 1e-4 + 1), frame_radius(t)});
  }
  return closed_sweep(rings, steps(2 * kPi * 0.05, h, 8));
}

// The height of the frame's middle line above x, on the neck or on the soundboard.
double height_at(double x, double first, double last) {
  double best = 0;
  double nearest = 1e300;
  for (int i = 0; i <= 400; ++i) {
    const Vec3d p = frame_line(first + (last - first) * i / 400);
    if (std::fabs(p.x - x) < nearest) {
      nearest = std::fabs(p.x - x);
      best = p.y;
    }
  }
  return best;
}

}  // namespace

Triangles make_harp(int faces) {
  return with_faces(faces, 3 / std::sqrt(faces), [](double h) {
    Triangles mesh = frame(h);
    for (int i = 0; i < kStrings; ++i) {
      const double x = -0.6 + 1.0 * i / (kStrings - 1);
      const double low = height_at(x, 0.0, 0.27);
      const double high = height_at(x, 0.36, 0.6);
      const double thickness = 0.0035 + 0.0025 * (0.45 - x);
      for (const double side : {-1.0, 1.0}) {
        // Each row ends beside the neck, at a pin, and just above the soundboard.
        const double z = side * 0.025;
        append(mesh, rod({x, low + 0.2, z}, {x, high - 0.085, z}, thickness, h));
        append(mesh, rod({x, high - 0.01, side * 0.058}, {x, high - 0.01, side * 0.1}, 0.0045, h));
      }
    }
    // The foot.
    append(mesh, ellipsoid({-0.55, -1.12, 0}, {0.34, 0.055, 0.2}, h));
    return mesh;
  });
}

}  // namespace limn
