// Clips boxes to polygonal lights and integrates the transformed cosine over the rest.
#include "edgetree/quadric/polygon_light.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// As in light_term.cpp: objects receive the same light as the shading point and scatter this share
// of it over the hemisphere; at least this share of the brightest luminance. Not tuned.
constexpr double kReflectance = 0.5;
constexpr double kFloor = 1.0 / 4096;
// Minimum width of a box relative to its longest half extent, so that it has a solid angle.
constexpr double kThin = 1.0 / 256;

// A convex cone from p, given by vectors along its edges, in order.
struct Cone {
  static constexpr int kMost = 9;  // of four, each of five planes adds one
  Vec3d w[kMost];
  int count = 0;

  void add(const Vec3d& v) { w[count++] = v; }
  // Clips to the front of the plane through p.
  void clip(const Vec3d& plane) {
    Cone kept;
    for (int i = 0; i < count; ++i) {
      const Vec3d &a = w[i], &b = w[(i + 1) % count];
      const double h_a = dot(plane, a), h_b = dot(plane, b);
      if (h_a >= 0) kept.add(a);
      if ((h_a >= 0) != (h_b >= 0)) kept.add(a + (b - a) * (h_a / (h_a - h_b)));
    }
    *this = kept;
  }
};

// Signed solid angle of the triangle of three vectors (van Oosterom and Strackee).
double solid_angle(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const double l_a = length(a), l_b = length(b), l_c = length(c);
  const double under = l_a * l_b * l_c + dot(a, b) * l_c + dot(b, c) * l_a + dot(c, a) * l_b;
  return 2 * std::atan2(dot(a, cross(b, c)), under);
}

double solid_angle(const Cone& cone) {
  double sum = 0;
  for (int i = 2; i < cone.count; ++i) sum += solid_angle(cone.w[0], cone.w[i - 1], cone.w[i]);
  return std::fabs(sum);
}

// Integral of LtcLobe::ltc over the cone: Lambert's formula after the transform.
double integral(const LtcLobe& lobe, const Cone& cone) {
  Cone turned;
  for (int i = 0; i < cone.count; ++i) turned.add(lobe.transform(cone.w[i]));
  turned.clip({0, 0, 1});
  double sum = 0;
  for (int i = 0; i < turned.count; ++i) {
    const Vec3d &a = turned.w[i], &b = turned.w[(i + 1) % turned.count], normal = cross(a, b);
    const double sine = length(normal);
    if (sine > 0) sum += normal.z / sine * std::atan2(sine, dot(a, b));
  }
  return std::fabs(sum) / (2 * kPi);
}

// The sides of a box that p sees, at most three; none from inside.
int sides_of(const Vec3d& center, const Vec3d& half, Cone (&sides)[3]) {
  int count = 0;
  for (int k = 0; k < 3; ++k) {
    if (std::fabs(center[k]) <= half[k]) continue;
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    Vec3d corner = center;
    corner[k] += center[k] > 0 ? -half[k] : half[k];
    Cone& side = sides[count++];
    const double signs[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    for (const auto& sign : signs) {
      Vec3d w = corner;
      w[i] += sign[0] * half[i];
      w[j] += sign[1] * half[j];
      side.add(w);
    }
  }
  return count;
}

}  // namespace

PolygonLights::PolygonLights(std::span<const LightTriangle> lights, double environment)
    : environment_(environment) {
  for (const LightTriangle& light : lights) {
    const Vec3d* c = light.corners;
    if (!(light.luminance > 0) || length_squared(cross(c[1] - c[0], c[2] - c[0])) == 0) continue;
    lights_.push_back(light);
    least_ = std::max(least_, kFloor * light.luminance);
  }
}

double PolygonLights::base(const Vec3d& p) const {
  double arriving = 0;
  for (const LightTriangle& light : lights_) {
    const Vec3d* c = light.corners;
    arriving += light.luminance * std::fabs(solid_angle(c[0] - p, c[1] - p, c[2] - p));
  }
  return environment_ + std::max(kReflectance / kPi * arriving, least_);
}

double PolygonLights::mean_over_box(const LtcLobe& lobe, const Vec3d& p, const Vec3d& center,
                                    const Vec3d& half, double unit) const {
  const double thin = kThin * std::max({half.x, half.y, half.z});
  const Vec3d wide{std::max(half.x, thin), std::max(half.y, thin), std::max(half.z, thin)};
  Cone sides[3];
  const int count = sides_of(center, wide, sides);
  double whole = count > 0 ? 0 : 4 * kPi;
  for (int i = 0; i < count; ++i) whole += solid_angle(sides[i]);
  if (!(whole > 0)) return 0;
  double sum = 0;
  for (const LightTriangle& light : lights_) {
    Vec3d w[3];
    for (int k = 0; k < 3; ++k) w[k] = (light.corners[k] - p) * unit;
    if (!(dot(w[0], cross(w[1], w[2])) < 0)) continue;  // p sees its back
    const Vec3d planes[3] = {cross(w[1], w[0]), cross(w[2], w[1]), cross(w[0], w[2])};
    if (count == 0) {
      Cone all;
      for (const Vec3d& corner : w) all.add(corner);
      sum += light.luminance * integral(lobe, all);
    }
    for (int i = 0; i < count; ++i) {
      Cone part = sides[i];
      for (int k = 0; k < 3 && part.count > 0; ++k) part.clip(planes[k]);
      if (part.count > 2) sum += light.luminance * integral(lobe, part);
    }
  }
  return sum / whole;
}

}  // namespace limn
