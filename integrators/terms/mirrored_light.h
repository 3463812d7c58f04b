#pragma once
// Small bright lights of an environment as flat glossy surfaces show them. A diffuse point sees the
// sun's glare on a glossy floor within a few degrees; its own scattering finds these once in a
// hundred samples, and each is then a hundred times as bright as the rest: they ruled the squared
// error of whole images. Scattering functions are reciprocal, so the directions of the glare are
// those into which the floor scatters the sun's light, and where light and floor are flat and far
// they are the same for all points. So a share of a vertex's directions is drawn from there: a
// mixture of densities, which changes no mean.
#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "integrators/terms/bright_patches.h"
#include "limn/core/scene.h"
#include "limn/core/shading.h"

namespace limn {

class MirroredLight {
 public:
  static constexpr size_t kMostImages = 4;  // not tuned
  // The part that a vertex takes of its directions from each image.
  struct Mixture {
    double share = 0;  // of all images together; 0: from the scattering function alone
    int count = 0;
    std::array<uint8_t, kMostImages> image{};
    std::array<double, kMostImages> part{};  // sum to 1
  };

  // The scene must outlive it. Null where it has no such light or surface.
  static std::unique_ptr<MirroredLight> make(const Scene& scene);

  template <class S>
  Mixture mixture(const SurfacePoint<S>& surface, const Scattering<S>& scattering) const {
    Mixture mixture;
    double sum = 0;
    for (size_t k = 0; k < images_.size(); ++k) {
      if (!reaches(images_[k], value(surface.p))) continue;
      const Rgb<double> f = scattering.eval_value(images_[k].toward);
      const double power = luminance(f) * images_[k].irradiance;
      if (!(power > 0)) continue;
      mixture.image[mixture.count] = static_cast<uint8_t>(k);
      mixture.part[mixture.count++] = power;
      sum += power;
    }
    for (int i = 0; i < mixture.count; ++i) mixture.part[i] /= sum;
    // Five times as much gave the same error in the demo.
    if (sum > 0) mixture.share = std::min(sum / (sum + mean_), kMostShare);
    return mixture;
  }
  // The density at the unit direction w [1/sr], of which scattering alone has this one there.
  double pdf(const Mixture& mixture, const Vec3d& w, double scattered) const;
  // A direction of the images, from three numbers in [0, 1).
  std::optional<Vec3d> sample(const Mixture& mixture, double u, double u1, double u2) const;

 private:
  static constexpr double kMostShare = 0.5;  // not tuned
  // A light in a flat part of a surface.
  struct Image {
    const Bsdf* bsdf;
    Vec3d normal;   // unit, of the lit side
    Vec3d light;    // unit, towards it
    Vec3d toward;   // unit, from a point to the image of the light in a perfect mirror
    Vec3d nearest;  // the steepest direction in which it is still bright
    Vec3d center;   // of a sphere around the flat part
    double radius;
    double irradiance;  // of the light, across it
    double cone;        // cosine of the angle of the directions, if these are uniform; else > 1
  };
  struct FlatPart;
  MirroredLight() = default;
  void add(const FlatPart& part, const Bsdf& bsdf, const Vec3d& normal, const BrightPatch& patch);
  static std::vector<FlatPart> flat_parts(const Mesh& mesh);
  static bool reaches(const Image& image, const Vec3d& p);
  static double pdf(const Image& image, const Vec3d& w);

  std::vector<Image> images_;
  double mean_ = 0;  // luminance of the environment
};

// Of a vertex behind which the path scatters again; none at others.
template <class S>
MirroredLight::Mixture mixture_at(const MirroredLight* mirrored, const SurfacePoint<S>& surface,
                                  const Scattering<S>& scattering, bool scatters_again) {
  return mirrored && scatters_again ? mirrored->mixture(surface, scattering)
                                    : MirroredLight::Mixture{};
}

}  // namespace limn
