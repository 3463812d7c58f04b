// A cloth that lies on a table, with folds, and hangs over its edge; and twigs with leaves.
#include <algorithm>
#include <cmath>

#include "tools/generate/generate_kinds.h"
#include "tools/generate/generate_parts.h"

namespace limn {
namespace {

constexpr double kWidth = 4.4, kDepth = 4.3;  // of the cloth
constexpr double kLying = 3.1;                // of its depth, on the table
constexpr double kBend = 0.1;                 // radius of the bend over the edge

double smooth_step(double from, double to, double x) {
  const double t = std::clamp((x - from) / (to - from), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

// Height of the folds where the cloth lies: flat in the middle, where things stand.
double fold_height(double x, double z) {
  const double away = std::hypot((x - 0.1) / 1.75, (z - 1.6) / 1.35);
  const double free = smooth_step(1.0, 1.4, away);
  const double ridge = [&] {
    const double line = 0.9 * x + 0.5 * z + 0.35 * noise({0.7 * x, 0.7 * z, 3});
    const double wave = 0.5 + 0.5 * std::sin(5.2 * line);
    return wave * wave * wave;
  }();
  const double crease = 0.5 + 0.5 * noise({1.6 * x, 1.6 * z, 7});
  return 0.012 + free * (0.13 * ridge + 0.05 * crease) + 0.004 * crease;
}

// A point of the cloth: u along its width, v along its depth, both in [0, 1]. The table's surface
// is y = 0, its edge z = kLying.
Vec3d cloth_point(double u, double v) {
  const double x = kWidth * (u - 0.5), s = kDepth * v;
  const double border = 0.05 * noise({2 * x, 2 * s, 11});
  if (s < kLying) {
    const double settled = 1 - smooth_step(kLying - 0.5, kLying, s);
    const double y = 0.012 + (fold_height(x, s) - 0.012) * settled;
    return {x + border, y, s + 0.05 * noise({1.3 * x, 0, 5}) * settled};
  }
  const double bent = std::min((s - kLying) / kBend, kPi / 2);
  const double hanging = std::max(0.0, s - kLying - kBend * kPi / 2);
  const double waves =
      (0.16 * std::sin(4.6 * x + 0.5 * std::sin(2.1 * x)) + 0.09 * noise({1.7 * x, s, 2})) *
      smooth_step(0, 1.1, hanging);
  return {x + border, 0.012 - kBend * (1 - std::cos(bent)) - hanging,
          kLying + kBend * std::sin(bent) + waves + 0.3 * smooth_step(0, 1.2, hanging)};
}

Triangles cloth(double h) {
  const int columns = steps(kWidth, h, 8), rows = steps(kDepth, h, 8);
  Triangles mesh;
  for (int i = 0; i <= rows; ++i) {
    for (int k = 0; k <= columns; ++k) {
      const double u = static_cast<double>(k) / columns, v = static_cast<double>(i) / rows;
      mesh.positions.push_back(cloth_point(u, v));
      mesh.uv.push_back({u, v});
    }
  }
  const auto at = [&](int i, int k) { return static_cast<uint32_t>(i * (columns + 1) + k); };
  for (int i = 0; i < rows; ++i) {
    for (int k = 0; k < columns; ++k) {
      add_quad(mesh, at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1));
    }
  }
  return mesh;
}

constexpr int kTwigs = 6;
constexpr int kLeaves = 22;  // tried along each

std::vector<Vec3d> twig(int i) {
  const double angle = kPi / 3 * i + 0.4, lean = 0.35 + 0.75 * std::fabs(std::sin(1.3 * i + 0.6));
  const Vec3d out{std::cos(angle), 0, 0.55 * std::sin(angle)};
  const Vec3d foot = Vec3d{std::cos(angle), 0, std::sin(angle)} * 0.06;
  const double size = 1.55 + 0.3 * std::sin(2.7 * i);
  return {foot, foot + out * (0.03 * lean) + Vec3d{0, 0.55, 0},
          foot + out * (0.4 * lean) + Vec3d{0, 0.62 * size, 0},
          foot + out * (1.1 * lean) + Vec3d{0, size, 0}};
}

// An oval leaf: where it starts, and unit vectors.
struct OvalLeaf {
  Vec3d foot, along, across;
  double size;
};

// Leaf k of twig i, which turn about it by the golden angle.
OvalLeaf oval_leaf(int i, int k) {
  const std::vector<Vec3d> line = twig(i);
  const double t = 0.42 + 0.57 * (k + 0.5) / kLeaves;
  const Vec3d onward = normalize(spline(line, std::min(1.0, t + 1e-3)) - spline(line, t - 1e-3));
  const Frame frame(onward);
  const double turn = kPi * (3 - std::sqrt(5.0)) * k + i;
  const Vec3d side = frame.s * std::cos(turn) + frame.t * std::sin(turn);
  const Vec3d along = normalize(side + onward * 0.55);
  return {spline(line, t) + side * 0.03, along, normalize(cross(onward, along)),
          0.2 + 0.1 * (1 - t)};
}

// Folded a little along its middle and bent down.
Triangles blade_of(const OvalLeaf& leaf, double h) {
  const Vec3d up = cross(leaf.across, leaf.along);
  return blade(steps(leaf.size, h, 4), 4, [&](double s, double v) {
    const double half = 0.3 * leaf.size * std::sin(kPi * std::pow(s, 0.85));
    return leaf.foot + leaf.along * (leaf.size * s) + leaf.across * (half * v) +
           up * (0.22 * half * std::fabs(v) - 0.25 * leaf.size * s * s);
  });
}

// The leaves that stay clear of those before them and of the twigs.
std::vector<OvalLeaf> clear_leaves() {
  constexpr double kApart = 0.019, kSpacing = 0.015;
  std::vector<OvalLeaf> leaves;
  std::vector<Vec3d> taken;
  for (int i = 0; i < kTwigs; ++i) {
    for (int k = 0; k < kLeaves; ++k) {
      const OvalLeaf leaf = oval_leaf(i, k);
      const std::vector<Vec3d> points = blade_of(leaf, kSpacing).positions;
      std::vector<Vec3d> others = taken;
      for (int j = 0; j < kTwigs; ++j) {
        for (int s = 0; s <= 100; ++s) others.push_back(spline(twig(j), s / 100.0));
      }
      const bool is_clear = std::ranges::all_of(points, [&](const Vec3d& p) {
        return std::ranges::all_of(others, [&](const Vec3d& q) { return length(p - q) > kApart; });
      });
      if (!is_clear) continue;
      leaves.push_back(leaf);
      taken.insert(taken.end(), points.begin(), points.end());
    }
  }
  return leaves;
}

Triangles twigs(const std::vector<OvalLeaf>& leaves, double h) {
  Triangles mesh;
  for (int i = 0; i < kTwigs; ++i) {
    const std::vector<Vec3d> line = twig(i);
    append(mesh, tube({[&](double t) { return spline(line, t); },
                       [](double t) { return 0.02 * (1 - 0.75 * t); }, 3},
                      h));
  }
  for (const OvalLeaf& leaf : leaves) append(mesh, blade_of(leaf, h));
  return mesh;
}

}  // namespace

Triangles make_cloth(int faces) { return with_faces(faces, 6 / std::sqrt(faces), cloth); }

Triangles make_twigs(int faces) {
  const std::vector<OvalLeaf> leaves = clear_leaves();
  return with_faces(faces, 4 / std::sqrt(faces), [&](double h) { return twigs(leaves, h); });
}

}  // namespace limn
