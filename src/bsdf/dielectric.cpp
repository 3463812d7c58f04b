// A smooth border between two media without absorption: glass, water.
#include <fmt/format.h>

#include "src/bsdf/fresnel.h"
#include "src/bsdf/indices.h"
#include "src/bsdf/sides.h"
#include "src/bsdf/types.h"

namespace limn {
namespace {

class Dielectric final : public SidedBsdf {
 public:
  Dielectric(double eta, const ConstantOrTexture& reflectance,
             const ConstantOrTexture& transmittance)
      : eta_(eta),
        specular_reflectance_(colour("specular_reflectance", reflectance)),
        specular_transmittance_(colour("specular_transmittance", transmittance)) {
    lobes_ = {.above = false, .smooth = true, .through = true};
    set_back(lobes_);
  }

  bool is_constant() const override {
    return limn::is_constant(eta_) && limn::is_constant(specular_reflectance_.constant) &&
           limn::is_constant(specular_transmittance_.constant);
  }
  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list;
    list.push_back({"eta", {&eta_}, ParameterRef::Unit::kValue, kLeastIor, kMostIor});
    add_parameter("specular_reflectance", specular_reflectance_, 0, 1, list);
    add_parameter("specular_transmittance", specular_transmittance_, 0, 1, list);
    return list;
  }
  std::shared_ptr<Bsdf> clone() const override { return std::make_shared<Dielectric>(*this); }
  std::string describe() const override {
    return fmt::format("dielectric, eta {:g}, specular_reflectance {}, specular_transmittance {}",
                       eta_.v, text_of(specular_reflectance_), text_of(specular_transmittance_));
  }

 private:
  int smooth_from(bool front, const Vec3<double>& n, const Vec3<double>& wi,
                  SmoothRays<double>& rays, const Rgb<double>* at) const override {
    return split(front, n, wi, rays, at);
  }
  int smooth_from(bool front, const Vec3<Dual>& n, const Vec3<Dual>& wi, SmoothRays<Dual>& rays,
                  const Rgb<Dual>* at) const override {
    return split(front, n, wi, rays, at);
  }

  template <class S>
  int split(bool front, const Vec3<S>& n, const Vec3<S>& wi, SmoothRays<S>& rays,
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

  Dual eta_;  // the index of refraction inside over that outside
  BsdfColour specular_reflectance_, specular_transmittance_;
};

}  // namespace

std::shared_ptr<Bsdf> read_dielectric(Properties& properties) {
  const double eta = read_relative_ior(properties, "bk7");
  if (properties.smooth_as() > 0 && eta != 1) {
    return make_roughdielectric({RoughConductorValues::Distribution::kGgx, properties.smooth_as(),
                                 eta, read_reflectance(properties, "specular_reflectance", 1),
                                 read_reflectance(properties, "specular_transmittance", 1)});
  }
  return std::make_shared<Dielectric>(eta, read_reflectance(properties, "specular_reflectance", 1),
                                      read_reflectance(properties, "specular_transmittance", 1));
}

}  // namespace limn
