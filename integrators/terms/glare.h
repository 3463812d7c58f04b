#pragma once
// Prototype.
#include <array>
#include <optional>
#include <vector>

#include "integrators/terms/bright_patches.h"
#include "limn/core/scene.h"
#include "limn/core/shading.h"

namespace limn {

class Glare {
 public:
  static constexpr size_t kMost = 4;
  struct Mix {
    double share = 0;  // of all images
    int count = 0;
    std::array<uint8_t, kMost> index;
    std::array<double, kMost> part;  // sums to 1
  };
  explicit Glare(const Scene& scene);
  bool empty() const { return images_.empty(); }

  template <class S>
  Mix mix(const SurfacePoint<S>& surface, const Scattering<S>& scattering) const {
    Mix mix;
    double sum = 0;
    const Vec3d x = value(surface.p);
    for (size_t k = 0; k < images_.size(); ++k) {
      const Image& image = images_[k];
      if (!seen(image, x)) continue;
      const double power = luminance(scattering.eval_value(image.w)) * image.power;
      if (!(power > 0)) continue;
      mix.index[mix.count] = static_cast<uint8_t>(k);
      mix.part[mix.count++] = power;
      sum += power;
    }
    if (!(sum > 0)) return mix;
    for (int i = 0; i < mix.count; ++i) mix.part[i] /= sum;
    mix.share = boost_ * sum / (sum + rest_);
    if (mix.share > 0.5) mix.share = 0.5;
    return mix;
  }
  double pdf(const Mix& mix, const Vec3d& w, double bsdf) const {
    double sum = 0;
    for (int i = 0; i < mix.count; ++i) sum += mix.part[i] * pdf(images_[mix.index[i]], w);
    return mix.share * sum + (1 - mix.share) * bsdf;
  }
  std::optional<Vec3d> draw(const Mix& mix, double u, double u1, double u2) const;

 private:
  struct Image {
    const Bsdf* bsdf;
    Vec3d n, s, w;
    Vec3d center;
    double radius;
    double power;
  };
  static bool seen(const Image& image, const Vec3d& x);
  static double pdf(const Image& image, const Vec3d& w);
  std::vector<Image> images_;
  double rest_ = 0, boost_ = 1;
};

}  // namespace limn
