// The diffuse (Lambertian) BSDF; its back is black.
#include <algorithm>
#include <limits>

#include "limn/core/make_bsdf.h"
#include "src/bsdf/both_scalars.h"
#include "src/bsdf/cosine.h"
#include "src/bsdf/types.h"

namespace limn {
namespace {

class Diffuse final : public BothScalars<Diffuse, Bsdf> {
 public:
  explicit Diffuse(const ConstantOrTexture& reflectance)
      : reflectance_(colour("reflectance", reflectance)) {}

  double pdf_solid_angle(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                         const Rgb<double>* /*at*/) const override {
    return dot(n, wi) > 0 ? std::fmax(0.0, dot(n, wo)) / kPi : 0;
  }
  BsdfValue eval_with_pdf(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                          const Rgb<double>* at) const override {
    return {evaluate(n, wi, wo, at), pdf_solid_angle(n, wi, wo, at)};
  }
  std::optional<Vec3d> sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                              const Rgb<double>* at) const override;
  void sample_each(std::span<const Draw> draws) const override;

  bool is_lambertian() const override { return texture_count() == 0; }
  bool is_constant() const override { return limn::is_constant(reflectance_.constant); }
  LobeSummary lobe(const Rgb<double>* at) const override {
    return {kHemisphere, 1, reflectance_.bound(at)};
  }
  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list;
    add_parameter("reflectance", reflectance_, 0, 1, list);
    return list;
  }
  std::string describe() const override { return "diffuse, reflectance " + text_of(reflectance_); }

  template <class S>
  Rgb<S> evaluate(const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo, const Rgb<S>* at) const {
    const S cos_o = dot(n, wo);
    if (!(value(cos_o) > 0 && dot(value(n), value(wi)) > 0)) return {};
    return reflectance_.of(at) * (cos_o * (1 / kPi));
  }

 private:
  BsdfColour reflectance_;
};

std::optional<Vec3d> Diffuse::sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                                     const Rgb<double>* /*at*/) const {
  if (!(dot(n, wi) > 0)) return std::nullopt;
  return sample_cosine(n, u1, u2);
}

void Diffuse::sample_each(std::span<const Draw> draws) const {
  wide::for_blocks(draws.size(), [&](size_t first, size_t last) {
    const auto of = [&](int i) -> const Draw& { return draws[std::min(first + i, last - 1)]; };
    const auto number = [&](int k) { return wide::gather([&](int i) { return of(i).u[k]; }); };
    const wide::Vec n = wide::gather_vectors([&](int i) { return of(i).n; });
    const wide::Vec wo = sample_cosine(n, number(0), number(1));
    for (size_t i = first; i < last; ++i) {
      const bool seen = dot(*draws[i].n, *draws[i].wi) > 0;
      *draws[i].wo = seen ? wide::lane(wo, static_cast<int>(i - first)) : Vec3d{};
    }
  });
}

// Batches gain too little from SIMD here.
}  // namespace

std::shared_ptr<Bsdf> make_diffuse(const ConstantOrTexture& reflectance) {
  return std::make_shared<Diffuse>(reflectance);
}

std::shared_ptr<Bsdf> read_diffuse(Properties& properties) {
  // Mitsuba takes brighter texels with a warning, too, which the reader of the scene gives.
  return make_diffuse(
      read_reflectance(properties, "reflectance", 0.5, std::numeric_limits<double>::infinity()));
}

}  // namespace limn
