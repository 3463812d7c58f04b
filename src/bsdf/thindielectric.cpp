// A pane of a smooth dielectric that is thinner than anything seen through it: light that is
// reflected between its faces comes out on either side, and what passes goes straight on.
#include <fmt/format.h>

#include "src/bsdf/fresnel.h"
#include "src/bsdf/indices.h"
#include "src/bsdf/sides.h"
#include "src/bsdf/types.h"

namespace limn {
namespace {

class ThinDielectric final : public SidedBsdf {
 public:
  ThinDielectric(double eta, const ConstantOrTexture& reflectance,
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
  std::shared_ptr<Bsdf> clone() const override { return std::make_shared<ThinDielectric>(*this); }
  std::string describe() const override {
    return fmt::format(
        "thindielectric, eta {:g}, specular_reflectance {}, specular_transmittance {}", eta_.v,
        text_of(specular_reflectance_), text_of(specular_transmittance_));
  }

 private:
  int smooth_from(bool, const Vec3<double>& n, const Vec3<double>& wi, SmoothRays<double>& rays,
                  const Rgb<double>* at) const override {
    return split(n, wi, rays, at);
  }
  int smooth_from(bool, const Vec3<Dual>& n, const Vec3<Dual>& wi, SmoothRays<Dual>& rays,
                  const Rgb<Dual>* at) const override {
    return split(n, wi, rays, at);
  }

  // One face reflects r; with t = 1 - r, both r + t^2 r (1 + r^2 + r^4 + ...) = 2 r / (1 + r).
  template <class S>
  int split(const Vec3<S>& n, const Vec3<S>& wi, SmoothRays<S>& rays, const Rgb<S>* at) const {
    const S r = fresnel_dielectric<S>(dot(n, wi), as<S>(eta_)).reflected;
    const S all = 2.0 * r / (1.0 + r);
    rays[0] = {reflected(wi, n), specular_reflectance_.of(at) * all};
    rays[1] = {-wi, specular_transmittance_.of(at) * (1.0 - all)};
    return 2;
  }

  Dual eta_;  // the index of refraction inside over that outside
  BsdfColour specular_reflectance_, specular_transmittance_;
};

}  // namespace

std::shared_ptr<Bsdf> read_thindielectric(Properties& properties) {
  const double eta = read_relative_ior(properties, "bk7");
  return std::make_shared<ThinDielectric>(
      eta, read_reflectance(properties, "specular_reflectance", 1),
      read_reflectance(properties, "specular_transmittance", 1));
}

}  // namespace limn
