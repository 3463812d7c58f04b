// A mixture of two BSDFs: 1 - weight of the first, weight of the second.
#include <fmt/format.h>

#include "src/bsdf/both_scalars.h"
#include "src/bsdf/nested.h"

namespace limn {
namespace {

class Blend final : public BothScalars<Blend, NestingBsdf> {
 public:
  Blend(std::vector<std::shared_ptr<Bsdf>> nested, const ConstantOrTexture& weight)
      : BothScalars(std::move(nested)), weight_(number("weight", weight)) {
    add_nested(false);
  }

  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list;
    add_parameter("weight", weight_, 0, 1, list);
    add_nested_parameters(list);
    return list;
  }
  std::string describe() const override {
    const auto both = const_cast<Blend*>(this)->nested();  // NOLINT
    return fmt::format("blendbsdf, weight {} ({}; {})", text_of(weight_), both[0]->describe(),
                       both[1]->describe());
  }

  template <class S>
  Rgb<S> evaluate(bool front, const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo,
                  const Rgb<S>* at) const {
    Rgb<S> f;
    for (size_t i = 0; i < 2; ++i) {
      const Bsdf* const bsdf = side_of(i, front);
      if (bsdf) f += bsdf->eval(n, wi, wo, at_of(i, front, at)) * weight(i, at);
    }
    return f;
  }
  template <class S>
  int rays(bool front, const Vec3<S>& n, const Vec3<S>& wi, SmoothRays<S>& rays,
           const Rgb<S>* at) const {
    int count = 0;
    for (size_t i = 0; i < 2; ++i) {
      const Bsdf* const bsdf = side_of(i, front);
      SmoothRays<S> of;
      const int more = bsdf ? bsdf->smooth_rays(n, wi, of, at_of(i, front, at)) : 0;
      for (int k = 0; k < more; ++k) {
        rays[count] = of[k];
        rays[count].weight = of[k].weight * weight(i, at);
        ++count;
      }
    }
    return count;
  }

 private:
  bool own_is_constant() const override { return limn::is_constant(weight_.constant); }
  // Of the i-th.
  template <class S>
  S weight(size_t i, const Rgb<S>* at) const {
    const S w = within_unit(weight_.of(at));
    return i == 0 ? 1.0 - w : w;
  }
  // What paths draw by: the second's share. Neither is left out, as each has a derivative where its
  // weight is 0. Not tuned.
  double second_share(bool front, const Rgb<double>* at) const {
    double albedo[2] = {0, 0};
    for (size_t i = 0; i < 2; ++i) {
      const Bsdf* const bsdf = side_of(i, front);
      if (bsdf && bsdf->is_rough())
        albedo[i] = weight(i, at) * bsdf->lobe(at_of(i, front, at)).albedo;
    }
    const auto is_rough = [&](size_t i) {
      const Bsdf* const bsdf = side_of(i, front);
      return bsdf && bsdf->is_rough();
    };
    if (!is_rough(0) || !is_rough(1)) return is_rough(1) ? 1 : 0;
    const double sum = albedo[0] + albedo[1];
    return sum > 0 ? std::clamp(albedo[1] / sum, 0.05, 0.95) : 0.5;
  }

  double pdf_from(bool front, const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                  const Rgb<double>* at) const override {
    const double share = second_share(front, at);
    double pdf = 0;
    for (size_t i = 0; i < 2; ++i) {
      const Bsdf* const bsdf = side_of(i, front);
      if (bsdf)
        pdf += (i ? share : 1 - share) * bsdf->pdf_solid_angle(n, wi, wo, at_of(i, front, at));
    }
    return pdf;
  }
  std::optional<Vec3d> sample_from(bool front, const Vec3d& n, const Vec3d& wi, double u1,
                                   double u2, const Rgb<double>* at) const override {
    const double share = second_share(front, at);
    const size_t i = u1 < share ? 1 : 0;
    const double rest = i ? u1 / share : (u1 - share) / (1 - share);
    const Bsdf* const bsdf = side_of(i, front);
    return bsdf ? bsdf->sample(n, wi, rest, u2, at_of(i, front, at)) : std::nullopt;
  }
  double eta_from(bool front, const Rgb<double>* at) const override {
    for (size_t i = 0; i < 2; ++i) {
      const Bsdf* const bsdf = side_of(i, front);
      if (bsdf && bsdf->lobes().below) return bsdf->eta(at_of(i, front, at));
    }
    return 1;
  }
  // The one's that is rough; of two the cosine about the normal.
  LobeSummary lobe_from(bool front, const Rgb<double>* at) const override {
    LobeSummary all(kHemisphere, 1, 0);
    for (size_t i = 0; i < 2; ++i) {
      const Bsdf* const bsdf = side_of(i, front);
      if (!bsdf || !bsdf->is_rough()) continue;
      LobeSummary lobe = bsdf->lobe(at_of(i, front, at));
      if (at || weight_.texture < 0) lobe.albedo *= weight(i, at);
      all = all.albedo == 0 ? lobe : LobeSummary(kHemisphere, 1, all.albedo + lobe.albedo);
    }
    return all;
  }
  PassedLobe passed_lobe_from(bool front, const Vec3d& n, const Vec3d& wi,
                              const Rgb<double>* at) const override {
    PassedLobe all{-n, {kHemisphere, 1, 0}};
    for (size_t i = 0; i < 2; ++i) {
      const Bsdf* const bsdf = side_of(i, front);
      if (!bsdf || !bsdf->lobes().below) continue;
      const PassedLobe of = bsdf->passed_lobe(n, wi, at_of(i, front, at));
      all = all.lobe.albedo == 0 ? of : PassedLobe{-n, {kHemisphere, 1, 1}};
    }
    return all;
  }

  BsdfNumber weight_;
};

}  // namespace

std::shared_ptr<Bsdf> read_blendbsdf(Properties& properties) {
  const ConstantOrTexture weight = read_unit_number(properties, "weight");
  if (!weight.texture && !properties.has("weight")) properties.fail("needs a weight");
  return std::make_shared<Blend>(read_nested(properties, 2, weight.texture ? 1 : 0, 0), weight);
}

}  // namespace limn
