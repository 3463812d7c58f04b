#pragma once
// What smooth borders between two media without absorption share: one ray that is reflected, one
// that passes.
#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "src/bsdf/fresnel.h"
#include "src/bsdf/indices.h"
#include "src/bsdf/sides.h"
#include "src/bsdf/types.h"

namespace limn {

// Border: derives from this and has kName and split(front, n, wi, rays, at), which is smooth_rays
// of that side and writes two.
template <class Border>
class SmoothBorder : public SidedBsdf {
 public:
  SmoothBorder(double eta, const ConstantOrTexture& reflectance,
               const ConstantOrTexture& transmittance)
      : eta_(eta),
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
  std::shared_ptr<Bsdf> clone() const final { return std::make_shared<Border>(border()); }
  std::string describe() const final {
    return fmt::format("{}, eta {:g}, specular_reflectance {}, specular_transmittance {}",
                       Border::kName, eta_.v, text_of(specular_reflectance_),
                       text_of(specular_transmittance_));
  }

 protected:
  Dual eta_;  // the index of refraction inside over that outside
  BsdfColour specular_reflectance_, specular_transmittance_;

 private:
  const Border& border() const { return static_cast<const Border&>(*this); }
  int smooth_from(bool front, const Vec3<double>& n, const Vec3<double>& wi,
                  SmoothRays<double>& rays, const Rgb<double>* at) const final {
    return border().split(front, n, wi, rays, at);
  }
  int smooth_from(bool front, const Vec3<Dual>& n, const Vec3<Dual>& wi, SmoothRays<Dual>& rays,
                  const Rgb<Dual>* at) const final {
    return border().split(front, n, wi, rays, at);
  }
};

// eta: what the element says of it.
template <class Border>
std::shared_ptr<Bsdf> read_smooth_border(Properties& properties, double eta) {
  const ConstantOrTexture reflectance = read_reflectance(properties, "specular_reflectance", 1);
  return std::make_shared<Border>(eta, reflectance,
                                  read_reflectance(properties, "specular_transmittance", 1));
}

}  // namespace limn
