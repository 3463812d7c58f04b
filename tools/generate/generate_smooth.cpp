// Smooth closed shapes of several genera, and a creature.
#include <algorithm>
#include <cmath>

#include "tools/generate/generate_implicit.h"
#include "tools/generate/generate_kinds.h"
#include "tools/generate/generate_parts.h"

namespace limn {
namespace {

// Where the surface is nearly as fine as the cubes, surface nets may pinch it: another size is
// tried.
Triangles surface_with_faces(const Implicit& surface, int faces) {
  const double size = length(surface.upper - surface.lower);
  // Starts coarse: a grid of cubes costs the cube of its resolution.
  const double first_h = size / std::min(60.0, 0.7 * std::sqrt(faces));
  double target = faces;
  while (true) {
    Triangles mesh = with_faces(static_cast<int>(target), first_h,
                                [&](double h) { return polygonise(surface, h); });
    if (every_side_is_paired(mesh)) return mesh;
    target *= 1.01;
  }
}

// The bone and its mirror image in x.
void add_mirrored(std::vector<Bone>& bones, const Bone& bone) {
  bones.push_back(bone);
  bones.push_back(
      {{-bone.a.x, bone.a.y, bone.a.z}, {-bone.b.x, bone.b.y, bone.b.z}, bone.r_a, bone.r_b});
}

std::vector<Bone> creature_bones() {
  std::vector<Bone> bones = {
      {{0, 0.62, -0.5}, {0, 0.66, 0.28}, 0.32, 0.26},    // body
      {{0, 0.72, 0.3}, {0, 1.15, 0.5}, 0.19, 0.14},      // neck
      {{0, 1.25, 0.52}, {0, 1.18, 0.78}, 0.23, 0.14},    // head
      {{0, 1.14, 0.8}, {0, 1.1, 0.92}, 0.12, 0.1},       // snout
      {{0, 0.72, -0.66}, {0, 0.95, -0.98}, 0.15, 0.1},   // tail, which curls up
      {{0, 1.05, -1.05}, {0, 1.28, -1.06}, 0.07, 0.06},  //
      {{0, 1.38, -0.98}, {0, 1.44, -0.82}, 0.06, 0.075}};
  add_mirrored(bones, {{0.12, 1.4, 0.47}, {0.34, 1.66, 0.38}, 0.1, 0.055});     // ears
  add_mirrored(bones, {{0.22, 0.5, 0.3}, {0.26, 0.25, 0.34}, 0.15, 0.11});      // forelegs
  add_mirrored(bones, {{0.27, 0.12, 0.34}, {0.27, 0.11, 0.44}, 0.1, 0.1});      // and feet
  add_mirrored(bones, {{0.22, 0.55, -0.5}, {0.3, 0.27, -0.58}, 0.2, 0.12});     // hind legs
  add_mirrored(bones, {{0.31, 0.12, -0.56}, {0.31, 0.11, -0.45}, 0.1, 0.1});    // and feet
  add_mirrored(bones, {{0.13, 1.3, 0.66}, {0.13, 1.305, 0.67}, 0.065, 0.065});  // eyes
  return bones;
}

}  // namespace

// A sphere with hollows and bumps.
Triangles make_pebble(int faces) {
  return surface_with_faces({[](const Vec3d& p) {
                               const double waves =
                                   std::sin(5 * p.x + 0.5) * std::sin(5 * p.y + 1.2) *
                                       std::sin(5 * p.z - 0.4) +
                                   0.5 * std::sin(3.1 * p.x - 1) * std::cos(2.7 * p.z + 0.3);
                               return length(Vec3d{p.x, 1.15 * p.y, 1.05 * p.z}) - 1 - 0.16 * waves;
                             },
                             {-1.35, -1.35, -1.35},
                             {1.35, 1.35, 1.35}},
                            faces);
}

// A trefoil.
Triangles make_knot(int faces) {
  constexpr double kTube = 0.34;
  const auto path = [](double a) {
    return Vec3d{std::sin(a) + 2 * std::sin(2 * a), std::cos(a) - 2 * std::cos(2 * a),
                 -std::sin(3 * a)};
  };
  const double around_once = arc_length([&](double t) { return path(2 * kPi * t); });
  return with_faces(faces, std::sqrt(2 * 2 * kPi * kTube * around_once / faces), [&](double h) {
    const int along = steps(around_once, h, 24);
    std::vector<Ring> rings;
    for (int i = 0; i < along; ++i) {
      const double a = 2 * kPi * i / along;
      const Vec3d axis{std::cos(a) + 4 * std::cos(2 * a), -std::sin(a) + 4 * std::sin(2 * a),
                       -3 * std::cos(3 * a)};
      rings.push_back({path(a), axis, kTube});
    }
    return closed_sweep(rings, steps(2 * kPi * kTube, h, 6));
  });
}

// Two rings that have grown together.
Triangles make_pretzel(int faces) {
  constexpr double kCenter = 0.72;
  constexpr double kWidth = 0.06;
  const auto ring = [](const Vec3d& p, double center, double lean) {
    const double x = p.x - center;
    const double z = p.z - lean * x;
    return std::hypot(std::hypot(x, p.y) - 0.58, z) - 0.2;
  };
  return surface_with_faces({[&](const Vec3d& p) {
                               const double a = ring(p, -kCenter, 0.35);
                               const double b = ring(p, kCenter, -0.35);
                               return -kWidth *
                                      std::log(std::exp(-a / kWidth) + std::exp(-b / kWidth));
                             },
                             {-1.75, -1.05, -0.75},
                             {1.75, 1.05, 0.75}},
                            faces);
}

// The six edges of a tetrahedron, as a skeleton grown thick.
Triangles make_tetrapod(int faces) {
  const std::vector<Vec3d> corners = {
      {0.9, -0.62, -0.45}, {-0.9, -0.62, -0.5}, {0.05, -0.62, 1.0}, {-0.08, 0.9, 0.05}};
  std::vector<Bone> bones;
  for (int i = 0; i < 4; ++i) {
    for (int k = i + 1; k < 4; ++k) bones.push_back({corners[i], corners[k], 0.15, 0.15});
  }
  return surface_with_faces(
      {[&](const Vec3d& p) { return blend(bones, 0.06, p); }, {-1.3, -1.0, -0.9}, {1.3, 1.3, 1.4}},
      faces);
}

Triangles make_creature(int faces) {
  const std::vector<Bone> bones = creature_bones();
  return surface_with_faces({[&](const Vec3d& p) { return blend(bones, 0.04, p); },
                             {-0.65, -0.2, -1.35},
                             {0.65, 2.0, 1.25}},
                            faces);
}

}  // namespace limn
