// An orange, a lemon, a pear and grapes: spheres that are displaced, with colours at their
// vertices.
#include <algorithm>
#include <cmath>

#include "tools/generate/generate_kinds.h"
#include "tools/generate/generate_parts.h"

namespace limn {
namespace {

double bell(double x, double width) { return std::exp(-x * x / (width * width)); }

// A unit sphere of about `faces` faces, each of whose points p becomes place(p).
Triangles displaced(int faces, const std::function<Vec3d(const Vec3d&)>& place) {
  Triangles mesh = with_faces(faces, 4 / std::sqrt(faces), [](double h) {
    return ellipsoid({}, {1, 1, 1}, h);
  });
  for (Vec3d& p : mesh.positions) p = place(p);
  return mesh;
}

void paint(Triangles& mesh, const std::function<Rgb<double>(const Vec3d&)>& colour) {
  for (const Vec3d& p : mesh.positions) mesh.colours.push_back(colour(p));
}

Rgb<double> mixed(const Rgb<double>& a, const Rgb<double>& b, double t) {
  return a * (1 - t) + b * t;
}

struct Grape {
  Vec3d center;
  double radius;
};

// The height at which a ball comes to rest at (x, z) on those that lie there and on the ground.
double resting_height(const std::vector<Grape>& heap, double x, double z, double radius) {
  constexpr double kGap = 1.02;  // so that they do not touch
  double height = radius;
  for (const Grape& other : heap) {
    const double reach = kGap * (radius + other.radius);
    const double apart = std::hypot(x - other.center.x, z - other.center.z);
    if (apart < reach) {
      height = std::max(height, other.center.y + std::sqrt(reach * reach - apart * apart));
    }
  }
  return height;
}

// Grapes of a bunch that lies on the ground: each where, of many places tried, it comes to rest
// lowest.
std::vector<Grape> heap_of_grapes(int count) {
  std::vector<Grape> heap;
  for (int i = 0; i < count; ++i) {
    const double radius = 0.17 + 0.012 * noise({0.5, 0.5, 1.7 * i});
    Grape best{{0, 1e9, 0}, radius};
    for (int k = 0; k < 400; ++k) {
      // Even over an ellipse, by steps of the golden angle; each grape tries other places.
      const double r = std::sqrt((k + 0.5) / 400);
      const double a = (k + 0.37 * i) * kPi * (3 - std::sqrt(5.0));
      const double x = 0.86 * r * std::cos(a), z = 0.48 * r * std::sin(a);
      const double lean = 0.06 * (x * x + 3 * z * z);  // The bunch is higher in its middle.
      const double y = resting_height(heap, x, z, radius);
      if (y + lean < best.center.y + 0.06 * (best.center.x * best.center.x +
                                             3 * best.center.z * best.center.z)) {
        best.center = {x, y, z};
      }
    }
    heap.push_back(best);
  }
  return heap;
}

}  // namespace

Triangles make_orange(int faces) {
  Triangles mesh = displaced(faces, [](const Vec3d& d) {
    const double dimple = 0.07 * bell(std::acos(std::min(1.0, d.y)), 0.22);
    const double pores = 0.004 * noise(d * 34) + 0.012 * noise(d * 2.3);
    const double r = 1 - dimple + pores;
    return Vec3d{d.x * r, 0.94 * d.y * r, d.z * r};
  });
  paint(mesh, [](const Vec3d& p) {
    const double green = 0.5 * bell(std::hypot(p.x, p.z), 0.16) * (p.y > 0 ? 1 : 0);
    const Rgb<double> skin =
        mixed({0.86, 0.27, 0.015}, {0.9, 0.36, 0.025}, 0.5 + 0.5 * noise(p * 3.1));
    return mixed(skin, {0.2, 0.22, 0.03}, green);
  });
  return mesh;
}

Triangles make_lemon(int faces) {
  Triangles mesh = displaced(faces, [](const Vec3d& d) {
    const double c = std::fabs(d.y);
    const double tip = 0.2 * bell(std::acos(std::min(1.0, c)), 0.3) * (d.y > 0 ? 1 : 0.6);
    const double r = 1 + 0.006 * noise(d * 26) + 0.02 * noise(d * 2.1);
    return Vec3d{0.77 * d.x * r, d.y * r + std::copysign(tip, d.y), 0.77 * d.z * r};
  });
  paint(mesh, [](const Vec3d& p) {
    const double green = 0.35 * bell(std::fabs(p.y) - 1.2, 0.25);
    const Rgb<double> skin =
        mixed({0.88, 0.62, 0.03}, {0.84, 0.66, 0.06}, 0.5 + 0.5 * noise(p * 2.7));
    return mixed(skin, {0.5, 0.5, 0.05}, green);
  });
  return mesh;
}

Triangles make_pear(int faces) {
  Triangles mesh = with_faces(faces, 4 / std::sqrt(faces), [](double h) {
    return smooth_lathe({{0, -0.88},
                         {0.07, -0.91},
                         {0.15, -0.97},
                         {0.26, -1.0},
                         {0.42, -0.95},
                         {0.58, -0.8},
                         {0.66, -0.58},
                         {0.66, -0.35},
                         {0.6, -0.1},
                         {0.48, 0.14},
                         {0.37, 0.35},
                         {0.31, 0.55},
                         {0.28, 0.72},
                         {0.22, 0.85},
                         {0.14, 0.9},
                         {0.07, 0.885},
                         {0, 0.84}},
                        h, steps(2 * kPi * 0.66, h, 8));
  });
  for (Vec3d& p : mesh.positions) {
    const double swell = 1 + 0.05 * noise(p * 1.7);
    p = {p.x * swell + 0.05 * (p.y + 1) * (p.y + 1), p.y, p.z * swell};
  }
  paint(mesh, [](const Vec3d& p) {
    const double blush = std::clamp(0.25 + 0.8 * p.x + 0.25 * p.z + 0.35 * noise(p * 3), 0.0, 1.0);
    const double speckle = noise(p * 30) > 0.62 ? 0.35 : 0;
    const Rgb<double> skin = mixed({0.5, 0.5, 0.07}, {0.62, 0.16, 0.05}, blush * blush);
    return mixed(skin, {0.3, 0.2, 0.06}, speckle);
  });
  return mesh;
}

Triangles make_grapes(int faces) {
  const std::vector<Grape> heap = heap_of_grapes(34);
  return with_faces(faces, 8 / std::sqrt(faces), [&](double h) {
    Triangles mesh;
    for (const Grape& grape : heap) {
      append(mesh, ellipsoid(grape.center, Vec3d{1, 1, 1} * grape.radius, h));
    }
    return mesh;
  });
}

}  // namespace limn
