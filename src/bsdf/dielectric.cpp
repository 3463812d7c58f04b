// A smooth border between two media without absorption: glass, water.
#include "limn/core/make_bsdf.h"
#include "src/bsdf/smooth_border.h"

namespace limn {
namespace {

class Dielectric final : public BothScalars<Dielectric, SmoothBorder> {
 public:
  using BothScalars::BothScalars;

  template <class S>
  int rays(bool front, const Vec3<S>& n, const Vec3<S>& wi, SmoothRays<S>& rays,
           const Rgb<S>* at) const {
    const S eta = front ? as<S>(eta_) : 1.0 / as<S>(eta_);
    const Fresnel<S> f = fresnel_dielectric<S>(dot(n, wi), eta);
    rays[0] = {reflected(wi, n), specular_reflectance_.of(at) * f.reflected};
    if (f.total) {
      rays[1] = {.wo = rays[0].wo, .weight = {}, .eta = 1, .total = true};
    } else {
      const S passed = (1.0 - f.reflected) / (eta * eta);
      rays[1] = {refracted(wi, n, eta, f.cos_t), specular_transmittance_.of(at) * passed,
                 value(eta)};
    }
    return 2;
  }
};

}  // namespace

std::shared_ptr<Bsdf> read_dielectric(Properties& properties) {
  const double eta = read_relative_ior(properties, "bk7");
  if (properties.smooth_as() > 0 && eta != 1) {
    return make_roughdielectric({RoughConductorValues::Distribution::kGgx,
                                 properties.smooth_as(),
                                 {},
                                 eta,
                                 read_reflectance(properties, "specular_reflectance", 1),
                                 read_reflectance(properties, "specular_transmittance", 1)});
  }
  return read_smooth_border<Dielectric>("dielectric", properties, eta);
}

}  // namespace limn
