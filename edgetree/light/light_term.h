#pragma once
// How bright it is behind a box, seen from a shading point: the jump of radiance across an edge is
// about the radiance of what lies behind, so nodes of the edge forest in front of lights weigh
// more.
//
// Angles are measured by chords of the unit sphere: the cap whose rim is at the distance k from its
// center has the solid angle pi k^2.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "edgetree/simd.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// The lights of a scene as at most kMaxClusters groups of neighbouring triangles.
class LightClusters {
 public:
  static constexpr int kMaxClusters = 8;  // not tuned: a query looks at all of them

  LightClusters(std::span<const LightTriangle> lights, double environment_luminance);

  // Without area lights all boxes weigh alike, and no LightCones are needed.
  bool empty() const { return clusters_.empty(); }

 private:
  friend class LightCones;
  struct Cluster {
    std::vector<uint32_t> triangles;
    Vec3d center{};
    double radius = 0;     // of a sphere around center that holds all corners
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

// What shines towards one shading point. Made once per query.
class LightCones {
 public:
  LightCones(const LightClusters& lights, const Vec3d& p);

  // Estimate of the mean luminance over the directions of each box, with nothing in between:
  // environment, lights, and light scattered by objects. Its center minus p and half extents
  // (>= 0) are given. Positive everywhere if there is any light.
  Floats mean_over_boxes(Floats3 center, const Floats3& half) const;

 private:
  struct Cone {
    float axis[3];
    float luminance;
    float chord, chord_outer;  // of the cap with the light's solid angle, and of one that holds it
  };
  std::array<Cone, LightClusters::kMaxClusters> cones_;
  int count_ = 0;
  float base_ = 0;
};

}  // namespace limn
