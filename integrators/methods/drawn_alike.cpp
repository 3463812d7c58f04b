// A BSDF that scatters as one does and draws directions as two others do.
#include "integrators/methods/drawn_alike.h"

#include <algorithm>
#include <array>
#include <vector>

#include "limn/core/bsdf.h"
#include "limn/core/image.h"

namespace limn {
namespace {

class DrawnAlike final : public Bsdf {
 public:
  struct Held {
    std::array<std::shared_ptr<Bsdf>, 3> bsdfs;  // what scatters, and the two that draw
    std::vector<bool> moved;                     // which of their textures differ
  };
  DrawnAlike(const Held& held, bool front) : held_(held) {
    for (size_t i = 0; i < sides_.size(); ++i) sides_[i] = held.bsdfs[i]->side(front);
    if (front) back_ = std::make_shared<DrawnAlike>(held, false);
    if (!sides_[0]) return;
    lobes_ = sides_[0]->lobes();
    for (int k = 0; k < sides_[0]->texture_count(); ++k) {
      textures_.push_back(&sides_[0]->texture(k));
      for (auto& places : places_) places.push_back(k);
    }
    for (size_t i = 1; i < sides_.size(); ++i) add_moved_textures(i);
    texture_count_ = static_cast<int>(textures_.size());
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
    return 0.5 * (sides_[1]->pdf_solid_angle(n, wi, wo, AtSide(*this, 1, at).get()) +
                  sides_[2]->pdf_solid_angle(n, wi, wo, AtSide(*this, 2, at).get()));
  }
  BsdfValue eval_with_pdf(const Vec3d& n, const Vec3d& wi, const Vec3d& wo,
                          const Rgb<double>* at) const override {
    return {eval(n, wi, wo, at), pdf_solid_angle(n, wi, wo, at)};
  }
  std::optional<Vec3d> sample(const Vec3d& n, const Vec3d& wi, double u1, double u2,
                              const Rgb<double>* at) const override {
    if (sides_[1] == sides_[2]) return sides_[1]->sample(n, wi, u1, u2, AtSide(*this, 1, at).get());
    const int i = u1 < 0.5 ? 1 : 2;
    return sides_[i]->sample(n, wi, 2 * u1 - (i - 1), u2, AtSide(*this, i, at).get());
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
    return held_.bsdfs[0]->side(front) ? side : nullptr;
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
  Texture& texture(int k) const override { return *textures_[k]; }
  std::string texture_name(int) const override { return held_.bsdfs[0]->describe(); }
  std::shared_ptr<Bsdf> clone() const override { return std::make_shared<DrawnAlike>(held_, true); }
  std::string describe() const override { return held_.bsdfs[0]->describe(); }

 private:
  // Of the values of all textures those of one of the three.
  class AtSide {
   public:
    AtSide(const DrawnAlike& alike, int side, const Rgb<double>* at) : at_(at) {
      if (!at || alike.texture_count_ == static_cast<int>(alike.places_[side].size())) return;
      int k = 0;
      for (const int place : alike.places_[side]) values_[k++] = at[place];
      at_ = values_;
    }
    const Rgb<double>* get() const { return at_; }

   private:
    const Rgb<double>* at_;
    Rgb<double> values_[kMostTextures];
  };

  // Those of a side that draws follow the ones that scatter; one used twice is looked up once.
  void add_moved_textures(size_t side) {
    const auto unmoved = static_cast<std::ptrdiff_t>(textures_.size());
    for (size_t j = 0; j < held_.moved.size(); ++j) {
      if (!held_.moved[j]) continue;
      Texture* const moved = &held_.bsdfs[side]->texture(static_cast<int>(j));
      for (size_t k = 0; k < places_[side].size(); ++k) {
        if (&sides_[side]->texture(static_cast<int>(k)) != moved) continue;
        const auto place = std::find(textures_.begin() + unmoved, textures_.end(), moved);
        // Where there is no room, what draws sees the texture of what scatters.
        if (place == textures_.end() && textures_.size() == kMostTextures) continue;
        places_[side][k] = static_cast<int>(place - textures_.begin());
        if (place == textures_.end()) textures_.push_back(moved);
      }
    }
  }

  Held held_;
  std::array<const Bsdf*, 3> sides_{};
  std::shared_ptr<DrawnAlike> back_;        // of the front
  std::vector<Texture*> textures_;          // what is looked up
  std::array<std::vector<int>, 3> places_;  // in textures_, of each side's
};

bool differ(const std::vector<ParameterRef>& refs, const std::vector<ParameterRef>& others) {
  for (size_t i = 0; i < refs.size(); ++i) {
    for (size_t k = 0; k < refs[i].values.size(); ++k) {
      if (refs[i].values[k]->v != others[i].values[k]->v) return true;
    }
  }
  return false;
}

bool textures_differ(const Shape& a, const Shape& b, int k) {
  Texture& texture = a.bsdf->texture(k);
  Texture& other = b.bsdf->texture(k);
  const TexelMap& map = texture.texels_on(a.mesh);
  return differ(texture.parameters(), other.parameters()) ||
         (map.map().width > 0 && map.texels().data != other.texels_on(b.mesh).texels().data);
}

// Shapes that differ between a and b draw as those two in `drawn`.
void draw(std::span<Scene> scenes, const Scene& a, const Scene& b,
          const std::array<const Scene*, 2>& drawn) {
  for (size_t s = 0; s < a.shapes.size(); ++s) {
    const auto& bsdf = a.shapes[s].bsdf;
    DrawnAlike::Held held{{nullptr, drawn[0]->shapes[s].bsdf, drawn[1]->shapes[s].bsdf}, {}};
    bool any = differ(bsdf->parameters(), b.shapes[s].bsdf->parameters());
    for (int k = 0; k < bsdf->texture_count(); ++k) {
      held.moved.push_back(textures_differ(a.shapes[s], b.shapes[s], k));
      any = any || held.moved.back();
    }
    if (!any) continue;
    for (Scene& scene : scenes) {
      held.bsdfs[0] = scene.shapes[s].bsdf;
      scene.shapes[s].bsdf = std::make_shared<DrawnAlike>(held, true);
    }
  }
}

}  // namespace

void draw_alike(std::span<Scene> scenes, size_t first, size_t second) {
  const Scene &a = scenes[first], &b = scenes[second];
  draw(scenes, a, b, {&a, &b});
}

void draw_as(std::span<Scene> scenes, const Scene& unmoved) {
  draw(scenes, scenes[0], unmoved, {&unmoved, &unmoved});
}

}  // namespace limn
