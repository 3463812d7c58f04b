#pragma once
// A BSDF that is another one from behind, with the same values: glass, for example.
#include <memory>

#include "limn/core/bsdf.h"

namespace limn {

// What derives from it has each function of Bsdf with the side from which the surface is seen;
// normals point to that side.
class SidedBsdf : public Bsdf {
 public:
  Rgb<double> eval(const Vec3<double>& n, const Vec3<double>& wi, const Vec3<double>& wo,
                   const Rgb<double>* at) const final {
    return eval_from(true, n, wi, wo, at);
  }
  Rgb<Dual> eval(const Vec3<Dual>& n, const Vec3<Dual>& wi, const Vec3<Dual>& wo,
                 const Rgb<Dual>* at) const final {
    return eval_from(true, n, wi, wo, at);
  }
  double pdf_solid_angle(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                         const Rgb<double>* at) const final {
    return pdf_from(true, n, wi, wo, at);
  }
  BsdfValue eval_with_pdf(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                          const Rgb<double>* at) const final {
    return eval_with_pdf_from(true, n, wi, wo, at);
  }
  std::optional<Vec3d> sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                              const Rgb<double>* at) const final {
    return sample_from(true, n, wi, u1, u2, at);
  }
  int smooth_rays(const Vec3<double>& n, const Vec3<double>& wi, SmoothRays<double>& rays,
                  const Rgb<double>* at) const final {
    return smooth_from(true, n, wi, rays, at);
  }
  int smooth_rays(const Vec3<Dual>& n, const Vec3<Dual>& wi, SmoothRays<Dual>& rays,
                  const Rgb<Dual>* at) const final {
    return smooth_from(true, n, wi, rays, at);
  }
  double eta(const Rgb<double>* at) const final { return eta_from(true, at); }
  LobeSummary lobe(const Rgb<double>* at) const final { return lobe_from(true, at); }
  PassedLobe passed_lobe(const Vec3d& n, const Vec3d& wi, const Rgb<double>* at) const final {
    return passed_lobe_from(true, n, wi, at);
  }
  Vec3d scattering_normal(const Vec3d& n, const Vec3d& wi, const Rgb<double>* at) const final {
    return scattering_normal_from(true, n, wi, at);
  }
  const Bsdf* side(bool front) const final {
    if (front) return this;
    return has_back_ ? &back_ : nullptr;
  }

 protected:
  SidedBsdf() : back_(*this) {}
  SidedBsdf(const SidedBsdf& other) : Bsdf(other), back_(*this) {
    back_.set(other.back_.lobes(), texture_count_);
    has_back_ = other.has_back_;
  }
  // For constructors, after textures. Without a call, the back is black.
  void set_back(const Lobes& lobes) {
    has_back_ = true;
    back_.set(lobes, texture_count_);
  }

  virtual Rgb<double> eval_from(bool /*front*/, const Vec3<double>& /*n*/,
                                const Vec3<double>& /*wi*/, const Vec3<double>& /*wo*/,
                                const Rgb<double>* /*at*/) const {
    return {};
  }
  virtual Rgb<Dual> eval_from(bool /*front*/, const Vec3<Dual>& /*n*/, const Vec3<Dual>& /*wi*/,
                              const Vec3<Dual>& /*wo*/, const Rgb<Dual>* /*at*/) const {
    return {};
  }
  virtual double pdf_from(bool /*front*/, const Vec3d& /*n*/, const Vec3d& /*wi*/,
                          const Vec3d& /*wo*/, const Rgb<double>* /*at*/) const {
    return 0;
  }
  virtual BsdfValue eval_with_pdf_from(bool front, const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                                       const Rgb<double>* at) const {
    return {eval_from(front, n, wi, wo, at), pdf_from(front, n, wi, wo, at)};
  }
  virtual std::optional<Vec3d> sample_from(bool /*front*/, const Vec3d& /*n*/, const Vec3d& /*wi*/,
                                           double /*u1*/, double /*u2*/,
                                           const Rgb<double>* /*at*/) const {
    return {};
  }
  virtual int smooth_from(bool /*front*/, const Vec3<double>& /*n*/, const Vec3<double>& /*wi*/,
                          SmoothRays<double>& /*rays*/, const Rgb<double>* /*at*/) const {
    return 0;
  }
  virtual int smooth_from(bool /*front*/, const Vec3<Dual>& /*n*/, const Vec3<Dual>& /*wi*/,
                          SmoothRays<Dual>& /*rays*/, const Rgb<Dual>* /*at*/) const {
    return 0;
  }
  virtual double eta_from(bool /*front*/, const Rgb<double>* /*at*/) const { return 1; }
  virtual LobeSummary lobe_from(bool /*front*/, const Rgb<double>* /*at*/) const {
    return {kHemisphere, 1, 0};  // none
  }
  virtual PassedLobe passed_lobe_from(bool /*front*/, const Vec3d& n, const Vec3d& /*wi*/,
                                      const Rgb<double>* /*at*/) const {
    return {-n, {}};
  }
  virtual Vec3d scattering_normal_from(bool /*front*/, const Vec3d& n, const Vec3d& /*wi*/,
                                       const Rgb<double>* /*at*/) const {
    return n;
  }

 private:
  // The same from behind.
  class Back final : public Bsdf {
   public:
    explicit Back(SidedBsdf& of) : of_(of) {}
    void set(const Lobes& lobes, int texture_count) {
      lobes_ = lobes;
      texture_count_ = texture_count;
    }
    Rgb<double> eval(const Vec3<double>& n, const Vec3<double>& wi, const Vec3<double>& wo,
                     const Rgb<double>* at) const override {
      return of_.eval_from(false, n, wi, wo, at);
    }
    Rgb<Dual> eval(const Vec3<Dual>& n, const Vec3<Dual>& wi, const Vec3<Dual>& wo,
                   const Rgb<Dual>* at) const override {
      return of_.eval_from(false, n, wi, wo, at);
    }
    double pdf_solid_angle(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                           const Rgb<double>* at) const override {
      return of_.pdf_from(false, n, wi, wo, at);
    }
    BsdfValue eval_with_pdf(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                            const Rgb<double>* at) const override {
      return of_.eval_with_pdf_from(false, n, wi, wo, at);
    }
    std::optional<Vec3d> sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                                const Rgb<double>* at) const override {
      return of_.sample_from(false, n, wi, u1, u2, at);
    }
    int smooth_rays(const Vec3<double>& n, const Vec3<double>& wi, SmoothRays<double>& rays,
                    const Rgb<double>* at) const override {
      return of_.smooth_from(false, n, wi, rays, at);
    }
    int smooth_rays(const Vec3<Dual>& n, const Vec3<Dual>& wi, SmoothRays<Dual>& rays,
                    const Rgb<Dual>* at) const override {
      return of_.smooth_from(false, n, wi, rays, at);
    }
    double eta(const Rgb<double>* at) const override { return of_.eta_from(false, at); }
    LobeSummary lobe(const Rgb<double>* at) const override { return of_.lobe_from(false, at); }
    PassedLobe passed_lobe(const Vec3d& n, const Vec3d& wi, const Rgb<double>* at) const override {
      return of_.passed_lobe_from(false, n, wi, at);
    }
    Vec3d scattering_normal(const Vec3d& n, const Vec3d& wi, const Rgb<double>* at) const override {
      return of_.scattering_normal_from(false, n, wi, at);
    }
    const Bsdf* side(bool front) const override { return of_.side(front); }
    bool is_constant() const override { return of_.is_constant(); }
    std::vector<ParameterRef> parameters() override { return of_.parameters(); }
    Texture& texture(int k) const override { return of_.texture(k); }
    std::string texture_name(int k) const override { return of_.texture_name(k); }
    std::shared_ptr<Bsdf> clone() const override {
      const auto copy = std::dynamic_pointer_cast<SidedBsdf>(of_.clone());
      return {copy, &copy->back_};
    }
    std::span<std::shared_ptr<Bsdf>> nested() override { return of_.nested(); }
    std::string describe() const override { return of_.describe(); }

   private:
    SidedBsdf& of_;
  };

  Back back_;
  bool has_back_ = false;
};

}  // namespace limn
