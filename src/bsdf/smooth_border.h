#pragma once
// What smooth borders between two media without absorption share: one ray that is reflected, one
// that passes.
#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "src/bsdf/both_scalars.h"
#include "src/bsdf/fresnel.h"
#include "src/bsdf/indices.h"
#include "src/bsdf/types.h"

namespace limn {

// What derives from it, by way of BothScalars, has rays(front, n, wi, rays, at), which writes two.
class SmoothBorder : public SidedBsdf {
 public:
  SmoothBorder(const char* name, double eta, const ConstantOrTexture& reflectance,
               const ConstantOrTexture& transmittance)
      : name_(name),
        eta_(eta),
        specular_reflectance_(colour("specular_reflectance", reflectance)),
        specular_transmittance_(colour("specular_transmittance", transmittance)) {
    lobes_ = {.above = false, .smooth = true, .through = true};
    set_back(lobes_);
  }

  bool is_constant() const final {
    return limn::is_constant(eta_) && limn::is_constant(specular_reflectance_.constant) &&
           limn::is_constant(specular_transmittance_.constant);
  }
  std::vector<ParameterRef> parameters() final {
    std::vector<ParameterRef> list;
    list.push_back({"eta", {&eta_}, ParameterRef::Unit::kValue, kLeastIor, kMostIor});
    add_parameter("specular_reflectance", specular_reflectance_, 0, 1, list);
    add_parameter("specular_transmittance", specular_transmittance_, 0, 1, list);
    return list;
  }
  std::string describe() const final {
    return fmt::format("{}, eta {:g}, specular_reflectance {}, specular_transmittance {}", name_,
                       eta_.v, text_of(specular_reflectance_), text_of(specular_transmittance_));
  }

 protected:
  const char* name_;
  Dual eta_;  // the index of refraction inside over that outside
  BsdfColour specular_reflectance_, specular_transmittance_;
};

// eta: what the element says of it.
template <class Border>
std::shared_ptr<Bsdf> read_smooth_border(const char* name, Properties& properties, double eta) {
  const ConstantOrTexture reflectance = read_reflectance(properties, "specular_reflectance", 1);
  return std::make_shared<Border>(name, eta, reflectance,
                                  read_reflectance(properties, "specular_transmittance", 1));
}

}  // namespace limn
