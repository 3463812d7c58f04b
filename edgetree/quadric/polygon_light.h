#pragma once
// The share of a box's solid angle that polygonal lights cover, weighted by the lobe (Soroka,
// Peters, Marschner 2025, Sec. 3.6).
#include <span>
#include <vector>

#include "edgetree/lobe/ltc.h"
#include "limn/edgetree/edges.h"

namespace limn {

class PolygonLights {
 public:
  // environment: mean luminance of the environment.
  PolygonLights(std::span<const LightTriangle> lights, double environment);

  bool empty() const { return lights_.empty(); }
  // Luminance from any direction at p: the environment, and objects lit by the lights. The paper
  // omits the latter; without an environment an edge in front of a lit object would then never be
  // drawn. Positive if there is any light.
  double base(const Vec3d& p) const;
  // Sum over lights of luminance times the integral of the transformed cosine (LtcLobe::ltc) over
  // the light's part of the box's solid angle, divided by that solid angle. The box: center minus p
  // and half extents, at least one of them positive.
  double mean_over_box(const LtcLobe& lobe, const Vec3d& p, const Vec3d& center, const Vec3d& half,
                       double unit) const;

 private:
  std::vector<LightTriangle> lights_;
  double environment_;
  double least_ = 0;
};

}  // namespace limn
