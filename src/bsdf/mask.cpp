// A surface that lets some of the light pass straight on: opacity times another BSDF. With opacity
// 0 it is not seen at all (`null`), but ends shadow rays, as in Mitsuba's path tracer.
#include "limn/core/make_bsdf.h"
#include "src/bsdf/both_scalars.h"
#include "src/bsdf/nested.h"

namespace limn {
namespace {

class Mask : public BothScalars<Mask, NestingBsdf> {
 public:
  Mask(std::vector<std::shared_ptr<Bsdf>> nested, const ConstantOrTexture& opacity)
      : BothScalars(std::move(nested)), opacity_(number("opacity", opacity)) {
    add_nested(true);
  }

  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list;
    add_parameter("opacity", opacity_, 0, 1, list);
    add_nested_parameters(list);
    return list;
  }
  std::string describe() const override {
    return "mask, opacity " + text_of(opacity_) + " (" + inside().describe() + ")";
  }

  template <class S>
  Rgb<S> evaluate(bool front, const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo,
                  const Rgb<S>* at) const {
    const Bsdf* const bsdf = side_of(0, front);
    return bsdf ? bsdf->eval(n, wi, wo, at_of(0, front, at)) * opacity(at) : Rgb<S>{};
  }
  // What is nested, then straight on.
  template <class S>
  int rays(bool front, const Vec3<S>& n, const Vec3<S>& wi, SmoothRays<S>& rays,
           const Rgb<S>* at) const {
    const Bsdf* const bsdf = side_of(0, front);
    const int count = bsdf ? bsdf->smooth_rays(n, wi, rays, at_of(0, front, at)) : 0;
    const S o = opacity(at);
    for (int k = 0; k < count; ++k) rays[k].weight = rays[k].weight * o;
    rays[count] = {-wi, grey(S(1.0 - o))};
    return count + 1;
  }

 private:
  const Bsdf& inside() const { return *const_cast<Mask*>(this)->nested()[0]; }  // NOLINT
  bool own_is_constant() const override { return limn::is_constant(opacity_.constant); }
  template <class S>
  S opacity(const Rgb<S>* at) const {
    return within_unit(opacity_.of(at));
  }

  double pdf_from(bool front, const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                  const Rgb<double>* at) const override {
    const Bsdf* const bsdf = side_of(0, front);
    return bsdf ? bsdf->pdf_solid_angle(n, wi, wo, at_of(0, front, at)) : 0;
  }
  std::optional<Vec3d> sample_from(bool front, const Vec3d& n, const Vec3d& wi, double u1,
                                   double u2, const Rgb<double>* at) const override {
    const Bsdf* const bsdf = side_of(0, front);
    return bsdf ? bsdf->sample(n, wi, u1, u2, at_of(0, front, at)) : std::nullopt;
  }
  double eta_from(bool front, const Rgb<double>* at) const override {
    const Bsdf* const bsdf = side_of(0, front);
    return bsdf ? bsdf->eta(at_of(0, front, at)) : 1;
  }
  LobeSummary lobe_from(bool front, const Rgb<double>* at) const override {
    const Bsdf* const bsdf = side_of(0, front);
    LobeSummary lobe = bsdf ? bsdf->lobe(at_of(0, front, at)) : LobeSummary(kHemisphere, 1, 0);
    if (at || opacity_.texture < 0) lobe.albedo *= opacity(at);
    return lobe;
  }
  PassedLobe passed_lobe_from(bool front, const Vec3d& n, const Vec3d& wi,
                              const Rgb<double>* at) const override {
    if (!side_of(0, front)) return {-n, {}};
    PassedLobe passed = side_of(0, front)->passed_lobe(n, wi, at_of(0, front, at));
    if (at || opacity_.texture < 0) passed.lobe.albedo *= opacity(at);
    return passed;
  }

  BsdfNumber opacity_;
};

// It has no numbers, as in Mitsuba.
class Null final : public Mask {
 public:
  using Mask::Mask;
  std::vector<ParameterRef> parameters() override { return {}; }
  std::string describe() const override { return "null"; }
  std::shared_ptr<Bsdf> clone() const override { return std::make_shared<Null>(*this); }
};

}  // namespace

std::shared_ptr<Bsdf> read_mask(Properties& properties) {
  const ConstantOrTexture opacity = read_unit_number(properties, "opacity");
  return std::make_shared<Mask>(read_nested(properties, 1, opacity.texture ? 1 : 0, 1), opacity);
}

std::shared_ptr<Bsdf> read_null(Properties& /*properties*/) {
  std::vector<std::shared_ptr<Bsdf>> nothing{make_diffuse(grey(0.0))};
  return std::make_shared<Null>(std::move(nothing), 0.0);
}

}  // namespace limn
