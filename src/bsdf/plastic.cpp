// A smooth plastic: a diffuse base under a smooth dielectric boundary, as in Mitsuba. With F the
// boundary's reflectance and R that from inside for diffuse light, the base is
//   rho / (1 - rho R) (1 - F(cos_i)) (1 - F(cos_o)) cos_o / (pi eta^2),
// with 1 - R for 1 - rho R unless `nonlinear`, and the coat a smooth lobe of weight ks F(cos_i).
#include <fmt/format.h>

#include "limn/core/make_bsdf.h"
#include "src/bsdf/both_scalars.h"
#include "src/bsdf/cosine.h"
#include "src/bsdf/fresnel.h"
#include "src/bsdf/indices.h"
#include "src/bsdf/types.h"

namespace limn {
namespace {

class Plastic final : public BothScalars<Plastic> {
 public:
  Plastic(double eta, bool nonlinear, const ConstantOrTexture& diffuse,
          const ConstantOrTexture& specular)
      : eta_(eta),
        nonlinear_(nonlinear),
        diffuse_(colour("diffuse_reflectance", diffuse)),
        specular_(colour("specular_reflectance", specular)) {
    lobes_ = {.smooth = true};
  }

  bool is_constant() const override {
    return limn::is_constant(eta_) && limn::is_constant(diffuse_.constant) &&
           limn::is_constant(specular_.constant);
  }
  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list;
    list.push_back({"eta", {&eta_}, ParameterRef::Unit::kValue, 1, kMostIor});
    add_parameter("diffuse_reflectance", diffuse_, 0, 1, list);
    add_parameter("specular_reflectance", specular_, 0, 1, list);
    return list;
  }
  std::string describe() const override {
    return fmt::format("plastic, eta {:g}, {}diffuse_reflectance {}, specular_reflectance {}",
                       eta_.v, nonlinear_ ? "nonlinear, " : "", text_of(diffuse_),
                       text_of(specular_));
  }

  template <class S>
  Rgb<S> evaluate(const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo, const Rgb<S>* at) const {
    const S cos_i = dot(n, wi), cos_o = dot(n, wo);
    if (!(value(cos_i) > 0 && value(cos_o) > 0)) return {};
    const S eta = as<S>(eta_);
    const S passes = (1.0 - fresnel_dielectric(cos_i, eta).reflected) *
                     (1.0 - fresnel_dielectric(cos_o, eta).reflected);
    const Rgb<S> rho = diffuse_.of(at);
    return Rgb<S>{factor(rho.r, eta), factor(rho.g, eta), factor(rho.b, eta)} *
           (passes * cos_o * (1 / kPi));
  }
  template <class S>
  int rays(const Vec3<S>& n, const Vec3<S>& wi, SmoothRays<S>& rays, const Rgb<S>* at) const {
    const S f = fresnel_dielectric<S>(dot(n, wi), as<S>(eta_)).reflected;
    rays[0] = {reflected(wi, n), specular_.of(at) * f};
    return 1;
  }

 private:
  double pdf_from(bool, const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                  const Rgb<double>*) const override {
    return dot(n, wi) > 0 ? std::fmax(0.0, dot(n, wo)) / kPi : 0;
  }
  std::optional<Vec3d> sample_from(bool, const Vec3d& n, const Vec3d& wi, double u1, double u2,
                                   const Rgb<double>*) const override {
    if (!(dot(n, wi) > 0)) return std::nullopt;
    return sample_cosine(n, u1, u2);
  }
  // F is least at normal incidence.
  LobeSummary lobe_from(bool, const Rgb<double>* at) const override {
    const double rho = diffuse_.bound(at), eta = eta_.v;
    const double passes = 1 - fresnel_dielectric<double>(1, eta).reflected;
    return {kHemisphere, 1, passes * passes * factor(rho, eta)};
  }

  // rho / ((1 - rho R) eta^2).
  template <class S>
  S factor(const S& rho, const S& eta) const {
    const S inner = inner_diffuse_reflectance(eta);
    return rho / ((1.0 - (nonlinear_ ? rho * inner : inner)) * (eta * eta));
  }

  Dual eta_;  // the index of refraction inside over that outside, at least 1
  bool nonlinear_;
  BsdfColour diffuse_, specular_;
};

}  // namespace

std::shared_ptr<Bsdf> read_plastic(Properties& properties) {
  const double eta = read_relative_ior(properties, "polypropylene");
  if (!(eta > 1)) properties.fail("int_ior", "int_ior must be greater than ext_ior");
  const bool nonlinear = properties.boolean("nonlinear", false);
  const ConstantOrTexture diffuse = read_reflectance(properties, "diffuse_reflectance", 0.5),
                          specular = read_reflectance(properties, "specular_reflectance", 1);
  // For any alpha its base is darker, by 1 to 5 % where nothing is absorbed and eta is 1.3 to 1.9:
  // Mitsuba has R as a sum over 64 cosines there, as a fit here.
  if (const double alpha = properties.smooth_as(); alpha > 0) {
    return make_roughplastic(
        {RoughConductorValues::Distribution::kGgx, alpha, eta, nonlinear, diffuse, specular});
  }
  return std::make_shared<Plastic>(eta, nonlinear, diffuse, specular);
}

}  // namespace limn
