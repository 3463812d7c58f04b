#pragma once
// How much of a box's solid angle polygonal lights fill, weighted by the lobe (Soroka, Peters,
// Marschner 2025, Sec. 3.6).
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
  // Luminance that may come from anywhere, seen from p: of the environment, and of objects that the
  // lights shine on, which the paper leaves out (an edge before a lit object then would never be
  // drawn where there is no environment). Positive if there is any light.
  double base(const Vec3d& p) const;
  // Sum over lights of the luminance times the integral of the transformed cosine (LtcLobe::ltc)
  // over what the light fills of the box's solid angle, over that solid angle. The box: its center
  // minus p and its half extents, of which one at least is positive.
  double mean_over_box(const LtcLobe& lobe, const Vec3d& p, const Vec3d& center, const Vec3d& half,
                       double unit) const;

 private:
  std::vector<LightTriangle> lights_;
  double environment_;
  double least_ = 0;
};

}  // namespace limn
