// A pane of a smooth dielectric that is thinner than anything seen through it: light that is
// reflected between its faces comes out on either side, and what passes goes straight on.
#include "src/bsdf/smooth_border.h"

namespace limn {
namespace {

class ThinDielectric final : public BothScalars<ThinDielectric, SmoothBorder> {
 public:
  using BothScalars::BothScalars;

  // One face reflects r; with t = 1 - r, both r + t^2 r (1 + r^2 + r^4 + ...) = 2 r / (1 + r).
  template <class S>
  int rays(bool /*front*/, const Vec3<S>& n, const Vec3<S>& wi, SmoothRays<S>& rays,
           const Rgb<S>* at) const {
    const S r = fresnel_dielectric<S>(dot(n, wi), as<S>(eta_)).reflected;
    const S all = 2.0 * r / (1.0 + r);
    rays[0] = {reflected(wi, n), specular_reflectance_.of(at) * all};
    rays[1] = {-wi, specular_transmittance_.of(at) * (1.0 - all)};
    return 2;
  }
};

}  // namespace

std::shared_ptr<Bsdf> read_thindielectric(Properties& properties) {
  return read_smooth_border<ThinDielectric>("thindielectric", properties,
                                            read_relative_ior(properties, "bk7"));
}

}  // namespace limn
