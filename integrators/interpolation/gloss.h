#pragma once
// Gloss by Phong's lobe: the blurred sky, times the visible share of a cap around the mirror
// direction.
#include "integrators/interpolation/radiance_tables.h"
#include "limn/core/shading.h"

namespace limn {

class Gloss {
 public:
  // alpha: roughness; the exponent is a quarter of that of its facets, 2 / alpha^2 - 2. share: of
  // the lobe's energy within the cap.
  Gloss(const Environment& sky, double alpha, double share);
  // Radiance that is scattered to the viewer, of the region of the loops, which it changes.
  Rgb<double> radiance(const RadianceTables& tables, const Scattering<double>& scattering,
                       DirectionLoops& loops) const;

 private:
  double power_, cap_;  // cap_: cosine of its radius
  BlurredSky sky_;
};

}  // namespace limn
