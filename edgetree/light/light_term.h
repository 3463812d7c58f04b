#pragma once
// Estimated radiance behind a box as seen from a shading point. The radiance difference across an
// edge is about the radiance behind it, so nodes of the edge forest in front of lights get larger
// weights.
//
// Angles are chords of the unit sphere: a cap whose boundary has the distance k from its center has
// the solid angle pi k^2.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "edgetree/simd.h"
#include "limn/edgetree/edge_sampler.h"
#include "limn/edgetree/radiance_pyramid.h"

namespace limn {

// The area lights of a scene as at most kMaxClusters groups of neighbouring triangles.
class LightClusters {
 public:
  static constexpr int kMaxClusters = 8;  // not tuned: a query visits all of them

  LightClusters(std::span<const LightTriangle> lights, double environment_luminance);

  // True without area lights: all boxes then have equal light weights, without LightCones.
  bool empty() const { return clusters_.empty(); }

 private:
  friend class LightCones;
  struct Cluster {
    std::vector<uint32_t> triangles;
    Vec3d center{};
    double radius = 0;     // of a bounding sphere around `center`
    Vec3d area_vector{};   // sum of area times normal
    double area = 0;       // sum
    double luminance = 0;  // mean over the area
  };
  static Cluster make_cluster(std::span<const LightTriangle> lights,
                              std::vector<uint32_t> triangles);
  static bool is_compact(const Cluster& cluster);
  static std::array<Cluster, 2> split(std::span<const LightTriangle> lights,
                                      const Cluster& cluster);

  std::vector<Cluster> clusters_;
  double environment_ = 0;
  double floor_ = 0;
};

// The light clusters as seen from one shading point. Created once per query.
class LightCones {
 public:
  LightCones(const LightClusters& lights, const Vec3d& p);

  // Estimated mean luminance over the directions of each box, without occlusion: environment,
  // lights, and light scattered by objects. Arguments: centers minus p and half extents (>= 0).
  // Positive if there is any light.
  Floats mean_over_boxes(Floats3 center, const Floats3& half) const;

 private:
  struct Cone {
    float axis[3];
    float luminance;
    float chord, chord_outer;  // of the cap with the light's solid angle, and of a bounding cap
  };
  std::array<Cone, LightClusters::kMaxClusters> cones_;
  int count_ = 0;
  float base_ = 0;
};

// RadiancePyramid::mean element-wise; unspecified where d or the tangent is invalid.
Floats means(const RadiancePyramid& pyramid, const Floats3& d, Floats tangent);

}  // namespace limn
