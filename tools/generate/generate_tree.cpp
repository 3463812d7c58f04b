// A tree: open leaves along closed branches around a closed trunk. The parts do not touch.
#include <algorithm>
#include <cmath>

#include "tools/generate/generate_kinds.h"
#include "tools/generate/generate_parts.h"

namespace limn {
namespace {

constexpr int kBranches = 40;
constexpr int kLeaves = 24;  // of each branch
constexpr double kHeight = 2;

double trunk_radius(double y) { return 0.06 * (1 - 0.8 * y / kHeight); }

// A branch in the plane z = 0, before it is turned about the trunk.
struct Branch {
  double angle, reach;
  std::vector<Vec3d> line;
};

Branch branch(int i) {
  const double u = (i + 0.5) / kBranches;  // 0 below, 1 at the top
  const double y = 0.5 + 1.42 * u;
  const double reach = (0.25 + 0.6 * std::sqrt(1 - u)) * (0.85 + 0.15 * std::sin(5.0 * i));
  const double rise = 0.25 + 0.5 * u;
  const Vec3d foot{trunk_radius(y) + 0.015, y, 0};
  return {i * kPi * (3 - std::sqrt(5.0)),
          reach,
          {foot, foot + Vec3d{0.5 * reach, 0.5 * rise * reach + 0.03, 0},
           foot + Vec3d{reach, 0.7 * rise * reach, 0}}};
}

double branch_radius(double t) { return 0.012 * (1 - 0.7 * t); }

// A leaf from its foot, a diamond that is folded along its middle and cut into steps.
Triangles leaf(const Vec3d& foot, const Vec3d& along, const Vec3d& across, double size, double h) {
  const Vec3d up = cross(across, along);
  return blade(steps(size, h, 2), 2, [&](double s, double v) {
    const double half = 0.19 * size * std::sin(kPi * std::pow(s, 0.8));
    return foot + along * (size * s) + across * (half * v) + up * (0.3 * half * std::fabs(v));
  });
}

// Leaves to both sides, and one at the end.
Triangles leaves(const Branch& branch, int number, double h) {
  Triangles mesh;
  for (int k = 0; k < kLeaves; ++k) {
    const double t = 0.25 + 0.75 * (k + 0.5) / kLeaves;
    const Vec3d at = spline(branch.line, t);
    const Vec3d onward =
        normalize(spline(branch.line, std::min(1.0, t + 1e-3)) - spline(branch.line, t - 1e-3));
    const double side = k % 2 == 0 ? 1 : -1;
    const double tilt = 0.5 * std::sin(3.0 * k + number);
    const Vec3d out = normalize(Vec3d{0, std::sin(tilt), side * std::cos(tilt)} + onward * 0.7);
    const Vec3d across = normalize(cross(cross(out, onward), out));
    append(mesh, leaf(at + out * 0.02, out, across, 0.13 * branch.reach, h));
  }
  return mesh;
}

Triangles tree(double h) {
  Triangles mesh = tube({[](double t) {
                           return Vec3d{0, kHeight * t, 0};
                         },
                         [](double t) { return trunk_radius(kHeight * t); }, 4},
                        h);
  for (int i = 0; i < kBranches; ++i) {
    const Branch b = branch(i);
    const auto line = [&](double t) { return spline(b.line, t); };
    append(mesh, turned(tube({line, branch_radius, 4}, h), b.angle));
    append(mesh, turned(leaves(b, i, h), b.angle));
  }
  return mesh;
}

}  // namespace

Triangles make_tree(int faces) { return with_faces(faces, 3 / std::sqrt(faces), tree); }

}  // namespace limn
