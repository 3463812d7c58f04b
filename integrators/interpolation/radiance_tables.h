#pragma once
// Light of a region of directions from its polygons alone: in closed form for a constant sky, by
// tables of sums over a map for others.
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "limn/core/environment.h"
#include "limn/core/vec.h"

namespace limn {

// Integrals over the directions w of a region, for three colours: of L w, and of L.
struct SkyLight {
  using Colour [[gnu::vector_size(16)]] = float;
  Colour x{}, y{}, z{}, all{};

  Rgb<double> along(const Vec3d& n) const {
    const auto of = [&](int c) { return n.x * x[c] + n.y * y[c] + n.z * z[c]; };
    return {of(0), of(1), of(2)};
  }
  SkyLight operator+(const SkyLight& o) const { return {x + o.x, y + o.y, z + o.z, all + o.all}; }
  SkyLight operator-(const SkyLight& o) const { return {x - o.x, y - o.y, z - o.z, all - o.all}; }
  SkyLight operator*(float s) const { return {x * s, y * s, z * s, all * s}; }
};

// Unit directions of closed loops. starts: of loops, and the end. Regions lie on their left.
struct DirectionLoops {
  std::vector<Vec3d> directions;
  std::vector<uint32_t> starts{0};

  void clear() { directions.clear(), starts.assign(1, 0); }
  void close() { starts.push_back(static_cast<uint32_t>(directions.size())); }
  // Calls visit(a, b) for all segments.
  template <class Visit>
  void for_segments(const Visit& visit) const {
    for (size_t l = 0; l + 1 < starts.size(); ++l) {
      for (uint32_t i = starts[l]; i < starts[l + 1]; ++i) {
        visit(directions[i], directions[i + 1 < starts[l + 1] ? i + 1 : starts[l]]);
      }
    }
  }
  // What of the region lies before a plane, around a direction there: sides along the plane go by
  // its point that is nearest to that, as they may take half a turn.
  void cut(const Vec3d& normal, const Vec3d& around);
};

// The integral of w over a region (Lambert): half the angles of its segments times the normals of
// their planes.
Vec3d mean_direction(const DirectionLoops& loops);

class RadianceTables {
 public:
  // radiance: from a unit direction; evaluated at four points of each cell.
  RadianceTables(const Environment::Grid& grid, int columns, int rows,
                 const std::function<Rgb<double>(const Vec3d&)>& radiance);

  // Of a region that holds no two opposite directions: by an estimate of how much of the light in
  // each segment's box of azimuths and polar angles lies above it.
  SkyLight light(const DirectionLoops& loops) const;

 private:
  struct Place {
    double phi, theta;  // in cells
  };
  Place place(const Vec3d& w) const;
  SkyLight sum(double phi, double theta) const;
  double share_above(const SkyLight& box, const Vec3d& a, const Vec3d& b) const;

  Environment::Grid grid_;
  double turns_right_;  // 1 if azimuths grow counter-clockwise around the pole, else -1
  int columns_, rows_;
  std::vector<SkyLight> cells_;  // rows + 1 by columns + 1: sums over what is before both
};

// A sky blurred by a power of the cosine, normalised.
class BlurredSky {
 public:
  BlurredSky(const Environment& environment, double power);
  Rgb<double> radiance(const Vec3d& w) const;

 private:
  std::vector<std::vector<Rgb<double>>> rows_;
};

}  // namespace limn
