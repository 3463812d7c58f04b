// A BSDF that scatters as one does and draws directions as two others do.
#include "integrators/methods/drawn_alike.h"

#include <array>

#include "limn/core/bsdf.h"
#include "limn/core/image.h"

namespace limn {
namespace {

class DrawnAlike final : public Bsdf {
 public:
  using Held = std::array<std::shared_ptr<Bsdf>, 3>;  // what scatters, and the two that draw
  DrawnAlike(const Held& held, bool front) : held_(held) {
    for (size_t i = 0; i < held.size(); ++i) sides_[i] = held[i]->side(front);
    if (front) back_ = std::make_shared<DrawnAlike>(held, false);
    if (!sides_[0]) return;
    lobes_ = sides_[0]->lobes();
    int all = 0;
    for (const Bsdf* side : sides_) all += side->texture_count();
    // Where there is no room for the textures of all, they look up the same.
    own_textures_ = all <= kMostTextures;
    texture_count_ = own_textures_ ? all : sides_[0]->texture_count();
  }

  Rgb<double> eval(const Vec3<double>& n, const Vec3<double>& wi, const Vec3<double>& wo,
                   const Rgb<double>* at) const override {
    return sides_[0]->eval(n, wi, wo, at);
  }
  Rgb<Dual> eval(const Vec3<Dual>& n, const Vec3<Dual>& wi, const Vec3<Dual>& wo,
                 const Rgb<Dual>* at) const override {
    return sides_[0]->eval(n, wi, wo, at);
  }
  double pdf_solid_angle(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                         const Rgb<double>* at) const override {
    return 0.5 * (sides_[1]->pdf_solid_angle(n, wi, wo, part_of(at, 1)) +
                  sides_[2]->pdf_solid_angle(n, wi, wo, part_of(at, 2)));
  }
  BsdfValue eval_with_pdf(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                          const Rgb<double>* at) const override {
    return {eval(n, wi, wo, at), pdf_solid_angle(n, wi, wo, at)};
  }
  std::optional<Vec3d> sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                              const Rgb<double>* at) const override {
    const int i = u1 < 0.5 ? 1 : 2;
    return sides_[i]->sample(n, wi, 2 * u1 - (i - 1), u2, part_of(at, i));
  }
  int smooth_rays(const Vec3<double>& n, const Vec3<double>& wi, SmoothRays<double>& rays,
                  const Rgb<double>* at) const override {
    return sides_[0]->smooth_rays(n, wi, rays, at);
  }
  int smooth_rays(const Vec3<Dual>& n, const Vec3<Dual>& wi, SmoothRays<Dual>& rays,
                  const Rgb<Dual>* at) const override {
    return sides_[0]->smooth_rays(n, wi, rays, at);
  }
  double eta(const Rgb<double>* at) const override { return sides_[0]->eta(at); }
  const Bsdf* side(bool front) const override {
    const Bsdf* side = front ? this : back_.get();
    return held_[0]->side(front) ? side : nullptr;
  }
  Vec3d scattering_normal(const Vec3d& n, const Vec3d& wi, const Rgb<double>* at) const override {
    return sides_[0]->scattering_normal(n, wi, at);
  }
  LobeSummary lobe(const Rgb<double>* at) const override { return sides_[0]->lobe(at); }
  PassedLobe passed_lobe(const Vec3d& n, const Vec3d& wi, const Rgb<double>* at) const override {
    return sides_[0]->passed_lobe(n, wi, at);
  }
  // None: nothing more is to be moved.
  std::vector<ParameterRef> parameters() override { return {}; }
  Texture& texture(int k) const override {
    const Bsdf* const* side = sides_.data();
    while (k >= (*side)->texture_count()) k -= (*side++)->texture_count();
    return (*side)->texture(k);
  }
  std::string texture_name(int) const override { return held_[0]->describe(); }
  std::shared_ptr<Bsdf> clone() const override { return std::make_shared<DrawnAlike>(held_, true); }
  std::string describe() const override { return held_[0]->describe(); }

 private:
  // Of the values of all textures those of one of the three.
  const Rgb<double>* part_of(const Rgb<double>* at, int which) const {
    if (!at || !own_textures_) return at;
    for (int i = 0; i < which; ++i) at += sides_[i]->texture_count();
    return at;
  }

  Held held_;
  std::array<const Bsdf*, 3> sides_{};
  std::shared_ptr<DrawnAlike> back_;  // of the front
  bool own_textures_ = false;
};

bool differ(const Shape& a, const Shape& b) {
  const auto refs = a.bsdf->parameters(), others = b.bsdf->parameters();
  for (size_t i = 0; i < refs.size(); ++i) {
    for (size_t k = 0; k < refs[i].values.size(); ++k) {
      if (refs[i].values[k]->v != others[i].values[k]->v) return true;
    }
  }
  for (int k = 0; k < a.bsdf->texture_count(); ++k) {
    const TexelMap& map = a.bsdf->texture(k).texels_on(a.mesh);
    if (map.map().width == 0) continue;
    if (map.texels().data != b.bsdf->texture(k).texels_on(b.mesh).texels().data) return true;
  }
  return false;
}

}  // namespace

void draw_alike(std::span<Scene> scenes, size_t first, size_t second) {
  for (size_t s = 0; s < scenes[first].shapes.size(); ++s) {
    if (!differ(scenes[first].shapes[s], scenes[second].shapes[s])) continue;
    const std::shared_ptr<Bsdf> drawn[2] = {scenes[first].shapes[s].bsdf,
                                            scenes[second].shapes[s].bsdf};
    for (Scene& scene : scenes) {
      std::shared_ptr<Bsdf>& bsdf = scene.shapes[s].bsdf;
      bsdf = std::make_shared<DrawnAlike>(DrawnAlike::Held{bsdf, drawn[0], drawn[1]}, true);
    }
  }
}

}  // namespace limn
