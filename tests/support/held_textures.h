#pragma once
// A BSDF whose textures have the same values everywhere, for tests that know no points.
#include <memory>
#include <utility>
#include <vector>

#include "limn/core/bsdf.h"

namespace limn::test {

class HeldTextures final : public Bsdf {
 public:
  HeldTextures(std::shared_ptr<Bsdf> bsdf, std::vector<Rgb<double>> values, bool front = true)
      : bsdf_(std::move(bsdf)), of_(bsdf_->side(front)), values_(std::move(values)) {
    lobes_ = of_->lobes();
    if (front && bsdf_->side(false)) back_ = std::make_shared<HeldTextures>(bsdf_, values_, false);
  }

  // The values of all textures; derivatives may be added.
  std::vector<Rgb<Dual>> duals() const {
    std::vector<Rgb<Dual>> duals;
    for (const Rgb<double>& v : values_) duals.push_back({v.r, v.g, v.b});
    return duals;
  }
  const std::vector<Rgb<double>>& values() const { return values_; }
  const Bsdf& inside() const { return *bsdf_; }

  Rgb<double> eval(const Vec3<double>& n, const Vec3<double>& wi, const Vec3<double>& wo,
                   const Rgb<double>*) const override {
    return of_->eval(n, wi, wo, values_.data());
  }
  Rgb<Dual> eval(const Vec3<Dual>& n, const Vec3<Dual>& wi, const Vec3<Dual>& wo,
                 const Rgb<Dual>*) const override {
    return of_->eval(n, wi, wo, duals().data());
  }
  double pdf_solid_angle(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                         const Rgb<double>*) const override {
    return of_->pdf_solid_angle(n, wi, wo, values_.data());
  }
  BsdfValue eval_with_pdf(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                          const Rgb<double>*) const override {
    return of_->eval_with_pdf(n, wi, wo, values_.data());
  }
  std::optional<Vec3d> sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                              const Rgb<double>*) const override {
    return of_->sample(n, wi, u1, u2, values_.data());
  }
  Vec3d scattering_normal(const Vec3d& n, const Vec3d& wi, const Rgb<double>*) const override {
    return of_->scattering_normal(n, wi, values_.data());
  }
  LobeSummary lobe(const Rgb<double>*) const override { return of_->lobe(values_.data()); }
  double eta(const Rgb<double>*) const override { return of_->eta(values_.data()); }
  const Bsdf* side(bool front) const override { return front ? this : back_.get(); }
  // Not those of textures.
  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list = bsdf_->parameters();
    std::erase_if(list,
                  [](const ParameterRef& p) { return p.name.find('.') != std::string::npos; });
    return list;
  }
  std::shared_ptr<Bsdf> clone() const override {
    return std::make_shared<HeldTextures>(bsdf_->clone(), values_);
  }
  std::string describe() const override { return bsdf_->describe(); }

 private:
  std::shared_ptr<Bsdf> bsdf_;
  const Bsdf* of_;  // its side
  std::shared_ptr<HeldTextures> back_;
  std::vector<Rgb<double>> values_;
};

}  // namespace limn::test
