// A smooth conductor: a mirror.
#include <fmt/format.h>

#include "limn/core/make_bsdf.h"
#include "src/bsdf/both_scalars.h"
#include "src/bsdf/fresnel.h"
#include "src/bsdf/indices.h"
#include "src/bsdf/microfacet.h"
#include "src/bsdf/types.h"

namespace limn {
namespace {

class Conductor final : public BothScalars<Conductor> {
 public:
  Conductor(const ConductorIndices& indices, const ConstantOrTexture& specular_reflectance)
      : eta_(colour("eta", indices.eta)),
        k_(colour("k", indices.k)),
        specular_reflectance_(colour("specular_reflectance", specular_reflectance)) {
    lobes_ = {.above = false, .smooth = true};
  }

  bool is_constant() const override {
    return limn::is_constant(eta_.constant) && limn::is_constant(k_.constant) &&
           limn::is_constant(specular_reflectance_.constant);
  }
  std::vector<ParameterRef> parameters() override {
    constexpr double kMost = std::numeric_limits<double>::infinity();
    std::vector<ParameterRef> list;
    add_parameter("eta", eta_, 0, kMost, list);
    add_parameter("k", k_, 0, kMost, list);
    add_parameter("specular_reflectance", specular_reflectance_, 0, 1, list);
    return list;
  }
  std::string describe() const override {
    return fmt::format("conductor, eta {}, k {}, specular_reflectance {}", text_of(eta_),
                       text_of(k_), text_of(specular_reflectance_));
  }

  template <class S>
  int rays(const Vec3<S>& n, const Vec3<S>& wi, SmoothRays<S>& rays, const Rgb<S>* at) const {
    const S cos_i = dot(n, wi);
    const Rgb<S> eta = eta_.of(at), k = k_.of(at);
    Rgb<S> f;
    for (int c = 0; c < 3; ++c) f[c] = microfacet::fresnel_conductor(cos_i, eta[c], k[c]);
    rays[0] = {reflected(wi, n), specular_reflectance_.of(at) * f};
    return 1;
  }

 private:
  BsdfColour eta_, k_, specular_reflectance_;
};

}  // namespace

std::shared_ptr<Bsdf> read_conductor(Properties& properties) {
  const ConductorIndices indices = read_conductor_indices(properties);
  if (properties.smooth_as() > 0) {
    RoughConductorValues rough;
    rough.distribution = RoughConductorValues::Distribution::kGgx;
    rough.alpha = properties.smooth_as();
    rough.eta = indices.eta;
    rough.k = indices.k;
    rough.specular_reflectance = read_reflectance(properties, "specular_reflectance", 1);
    return make_roughconductor(rough);
  }
  return std::make_shared<Conductor>(indices,
                                     read_reflectance(properties, "specular_reflectance", 1));
}

}  // namespace limn
