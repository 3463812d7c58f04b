// A chandelier of hundreds of parts, which do not touch.
#include <cmath>

#include "tools/generate/generate_kinds.h"
#include "tools/generate/generate_parts.h"

namespace limn {
namespace {

// A ring of arms, each with a pan, a candle, a flame, and strings of beads between them.
struct Tier {
  int arms;
  double reach;   // of the candles from the axis
  double height;  // of the candles
  double root;    // where the arms leave the column
  double phase;   // of the first arm, in arms
};

constexpr double kColumn = 0.1;  // the arms start outside the column's widest place there

Triangles candle_set(const Vec3d& top, double h) {
  Triangles mesh =
      smooth_lathe({{0, 0.012}, {0.05, 0.014}, {0.085, 0.045}, {0.05, 0.03}, {0, 0.026}}, h, 8);
  append(mesh,
         smooth_lathe({{0, 0.045}, {0.024, 0.05}, {0.022, 0.1}, {0.022, 0.17}, {0, 0.182}}, h, 8));
  append(mesh,
         smooth_lathe({{0, 0.19}, {0.017, 0.205}, {0.02, 0.235}, {0.008, 0.27}, {0, 0.29}}, h, 8));
  return moved(mesh, top);
}

Triangles drop(const Vec3d& top, double size, double h) {
  return moved(smooth_lathe({{0, -size},
                             {0.3 * size, -0.85 * size},
                             {0.28 * size, -0.6 * size},
                             {0.09 * size, -0.2 * size},
                             {0, 0}},
                            h, 8),
               top);
}

Triangles arm(const Tier& tier, double h) {
  const double drop_of_arm = tier.height - tier.root;
  const std::vector<Vec3d> line = {{kColumn, tier.root, 0},
                                   {0.35 * tier.reach, tier.root - 0.1, 0},
                                   {0.75 * tier.reach, tier.root - 0.08, 0},
                                   {0.99 * tier.reach, tier.root + 0.45 * drop_of_arm, 0},
                                   {tier.reach, tier.height - 0.018, 0}};
  Triangles mesh = tube(
      {[&](double t) { return spline(line, t); }, [](double t) { return 0.021 - 0.006 * t; }, 1.5},
      h);
  append(mesh, candle_set({tier.reach, tier.height, 0}, h));
  // A curl under the arm, and drops that hang below it.
  append(mesh, torus({0.5 * tier.reach, tier.root - 0.215, 0}, {0, 0, 1}, 0.06, 0.011, h));
  append(mesh, drop({0.5 * tier.reach, tier.root - 0.295, 0}, 0.09, h));
  append(mesh, drop({0.8 * tier.reach, tier.root - 0.125, 0}, 0.07, h));
  append(mesh, drop({tier.reach + 0.03, tier.root - 0.03, 0}, 0.08, h));
  return mesh;
}

// Beads that hang in a curve from one arm to the next.
Triangles garland(const Tier& tier, double h) {
  constexpr int kBeads = 13;
  const double half = kPi / tier.arms;
  Triangles mesh;
  for (int i = 0; i < kBeads; ++i) {
    const double u = -1 + 2 * (i + 1.0) / (kBeads + 1);
    const double sag = 0.22 * (1 - u * u);
    const Vec3d center = turned({0.86 * tier.reach, tier.height - 0.02 - sag, 0}, half * (1 + u));
    const double radius = i == kBeads / 2 ? 0.0155 : 0.0115;
    append(mesh, ellipsoid(center, {radius, radius, radius}, h));
    if (i == kBeads / 2) append(mesh, drop(center - Vec3d{0, 0.022, 0}, 0.075, h));
  }
  return mesh;
}

Triangles chandelier(double h) {
  Triangles mesh = smooth_lathe({{0, -0.62},
                                 {0.05, -0.6},
                                 {0.11, -0.5},
                                 {0.05, -0.4},
                                 {0.04, -0.3},
                                 {0.06, -0.22},
                                 {0.06, -0.1},
                                 {0.035, 0.0},
                                 {0.045, 0.12},
                                 {0.06, 0.24},
                                 {0.06, 0.34},
                                 {0.03, 0.45},
                                 {0.05, 0.6},
                                 {0.02, 0.7},
                                 {0, 0.72}},
                                h, 8);
  append(mesh, drop({0, -0.635, 0}, 0.2, h));
  for (const Tier& tier : {Tier{12, 0.92, 0.0, -0.15, 0}, Tier{8, 0.56, 0.44, 0.3, 0.5}}) {
    Triangles sector = arm(tier, h);
    append(sector, garland(tier, h));
    for (int i = 0; i < tier.arms; ++i) {
      append(mesh, turned(sector, 2 * kPi * (i + tier.phase) / tier.arms));
    }
  }
  // A chain whose links hang in one another.
  for (int i = 0; i < 6; ++i) {
    const Vec3d axis = i % 2 == 0 ? Vec3d{1, 0, 0} : Vec3d{0, 0, 1};
    append(mesh, torus({0, 0.79 + 0.068 * i, 0}, axis, 0.045, 0.0095, h));
  }
  return mesh;
}

}  // namespace

Triangles make_chandelier(int faces) { return with_faces(faces, 5 / std::sqrt(faces), chandelier); }

}  // namespace limn
