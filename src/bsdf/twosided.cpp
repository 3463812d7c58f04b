// The two-sided BSDF: one nested BSDF for both sides of a surface, or one for each.
#include "src/bsdf/types.h"

namespace limn {
namespace {

// Scattering functions are those of the front; side(false) gives the back.
class TwoSided final : public Bsdf {
 public:
  // sides: one or two.
  explicit TwoSided(std::vector<std::shared_ptr<Bsdf>> sides) : sides_(std::move(sides)) {
    for (const auto& side : sides_) texture_count_ += side->texture_count();
    lobes_ = front().lobes();
  }

  Rgb<double> eval(const Vec3<double>& n, const Vec3<double>& wi, const Vec3<double>& wo,
                   const Rgb<double>* at) const override {
    return front().eval(n, wi, wo, at);
  }
  Rgb<Dual> eval(const Vec3<Dual>& n, const Vec3<Dual>& wi, const Vec3<Dual>& wo,
                 const Rgb<Dual>* at) const override {
    return front().eval(n, wi, wo, at);
  }
  double pdf_solid_angle(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                         const Rgb<double>* at) const override {
    return front().pdf_solid_angle(n, wi, wo, at);
  }
  BsdfValue eval_with_pdf(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                          const Rgb<double>* at) const override {
    return front().eval_with_pdf(n, wi, wo, at);
  }
  std::optional<Vec3d> sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                              const Rgb<double>* at) const override {
    return front().sample(n, wi, u1, u2, at);
  }
  const Bsdf* side(bool is_front) const override {
    return (is_front ? sides_.front() : sides_.back()).get();
  }
  int smooth_rays(const Vec3<double>& n, const Vec3<double>& wi, SmoothRays<double>& rays,
                  const Rgb<double>* at) const override {
    return front().smooth_rays(n, wi, rays, at);
  }
  int smooth_rays(const Vec3<Dual>& n, const Vec3<Dual>& wi, SmoothRays<Dual>& rays,
                  const Rgb<Dual>* at) const override {
    return front().smooth_rays(n, wi, rays, at);
  }
  LobeSummary lobe(const Rgb<double>* at) const override { return front().lobe(at); }

  // Names of a single nested BSDF are unchanged; with two, they are "front.NAME" and "back.NAME".
  std::vector<ParameterRef> parameters() override;
  // Of the front, then of the back.
  Texture& texture(int k) const override {
    const int first = front().texture_count();
    return k < first ? front().texture(k) : sides_[1]->texture(k - first);
  }
  std::string texture_name(int k) const override;
  std::shared_ptr<Bsdf> clone() const override;
  std::span<std::shared_ptr<Bsdf>> nested() override { return sides_; }
  std::string describe() const override {
    return sides_.size() == 1
               ? "twosided (" + front().describe() + ")"
               : "twosided (front " + front().describe() + "; back " + sides_[1]->describe() + ")";
  }

 private:
  const Bsdf& front() const { return *sides_.front(); }

  std::vector<std::shared_ptr<Bsdf>> sides_;
};

std::vector<ParameterRef> TwoSided::parameters() {
  if (sides_.size() == 1) return sides_[0]->parameters();
  std::vector<ParameterRef> all;
  for (size_t i = 0; i < 2; ++i) {
    for (ParameterRef& p : sides_[i]->parameters()) {
      p.name = (i == 0 ? "front." : "back.") + p.name;
      all.push_back(std::move(p));
    }
  }
  return all;
}

std::string TwoSided::texture_name(int k) const {
  if (sides_.size() == 1) return front().texture_name(k);
  const int first = front().texture_count();
  return k < first ? "front." + front().texture_name(k)
                   : "back." + sides_[1]->texture_name(k - first);
}

std::shared_ptr<Bsdf> TwoSided::clone() const {
  std::vector<std::shared_ptr<Bsdf>> copies;
  for (const auto& side : sides_) copies.push_back(side->clone());
  return std::make_shared<TwoSided>(std::move(copies));
}

}  // namespace

std::shared_ptr<Bsdf> read_twosided(Properties& properties) {
  std::vector<std::shared_ptr<Bsdf>> sides = properties.bsdfs();
  if (sides.empty() || sides.size() > 2) {
    properties.fail("twosided needs one or two nested bsdfs, not " + std::to_string(sides.size()));
  }
  for (const auto& side : sides) {
    if (side->lobes().through) {
      properties.fail("transmission inside twosided: " + side->describe());
    }
    if (side->side(false)) properties.fail("twosided cannot hold another twosided");
  }
  if (sides.size() == 2 && sides[0] == sides[1]) sides.pop_back();
  return std::make_shared<TwoSided>(std::move(sides));
}

}  // namespace limn
