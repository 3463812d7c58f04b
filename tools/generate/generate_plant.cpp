// A plant in a pot: open leaves on closed stems. The parts do not touch.
#include <algorithm>
#include <cmath>

#include "tools/generate/generate_kinds.h"
#include "tools/generate/generate_parts.h"

namespace limn {
namespace {

constexpr int kLeaves = 34;

// A leaf and its stem lie about a vertical plane through the axis; the inner ones stand higher.
struct Growth {
  double angle;                    // of the plane
  double start;                    // radius where the stem leaves the ground
  std::vector<Vec3d> stem, blade;  // middle lines in the plane z = 0
  double width;                    // half of the blade's
};

Growth growth(int i) {
  const double u = (i + 0.5) / kLeaves;  // 0 inside, 1 outside
  Growth g;
  g.angle = i * kPi * (3 - std::sqrt(5.0));
  g.start = 0.24 * std::sqrt(u);
  const double lean = 0.2 + 1.05 * u;  // from the vertical
  const double size = 0.75 + 0.15 * std::sin(7.0 * i);
  const Vec3d foot{g.start, 0.02, 0};
  const Vec3d out{std::sin(lean), std::cos(lean), 0};
  const Vec3d half_out{std::sin(0.4 * lean), std::cos(0.4 * lean), 0};
  const Vec3d knee = foot + half_out * (0.4 * size);
  const Vec3d end = knee + out * (0.3 * size);
  g.stem = {foot, knee, end};
  const Vec3d down{std::sin(lean + 0.7), std::cos(lean + 0.7), 0};
  const Vec3d base = end + out * 0.03;
  g.blade = {base, base + out * (0.3 * size), base + out * (0.3 * size) + down * (0.35 * size)};
  g.width = 0.13 * size;
  return g;
}

// A point of the blade: s in [0, 1] from base to tip, v in [-1, 1] across.
Vec3d blade_point(const Growth& g, double s, double v) {
  const Vec3d middle = spline(g.blade, s);
  const Vec3d along = normalize(spline(g.blade, std::min(1.0, s + 1e-3)) -
                                spline(g.blade, std::max(0.0, s - 1e-3)));
  const Vec3d up = cross(Vec3d{0, 0, 1}, along);
  const double half = g.width * std::sin(kPi * std::pow(s, 0.75));
  const double fold = 0.45 * std::fabs(v) * (1 - 0.4 * std::fabs(v)) * half;
  const double wave = 0.012 * v * v * std::sin(14 * s + 3 * v);
  return middle + Vec3d{0, 0, 1} * (v * half) + up * (fold + wave);
}

Triangles leaf(const Growth& g, double h) {
  const int rows = steps(arc_length([&](double t) { return spline(g.blade, t); }), h, 5);
  return blade(rows, 2 * steps(g.width, h, 1),
               [&](double s, double v) { return blade_point(g, s, v); });
}

Triangles plant(double h) {
  // The pot: outside from below, over the rim, down to the earth.
  Triangles mesh = smooth_lathe({{0, -0.62},
                                 {0.2, -0.62},
                                 {0.26, -0.58},
                                 {0.33, -0.3},
                                 {0.4, -0.06},
                                 {0.45, 0.0},
                                 {0.44, 0.05},
                                 {0.38, 0.04},
                                 {0.34, -0.02},
                                 {0.2, -0.03},
                                 {0, -0.025}},
                                h, 8);
  for (int i = 0; i < kLeaves; ++i) {
    const Growth g = growth(i);
    append(mesh, turned(tube({[&](double t) { return spline(g.stem, t); },
                              [](double t) { return 0.014 - 0.005 * t; }, 2},
                             h),
                        g.angle));
    append(mesh, turned(leaf(g, h), g.angle));
  }
  return mesh;
}

}  // namespace

Triangles make_plant(int faces) { return with_faces(faces, 4 / std::sqrt(faces), plant); }

}  // namespace limn
