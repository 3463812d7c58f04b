#pragma once
// Small bright lights as flat glossy surfaces show them. A diffuse point sees the highlight of the
// sun, or of an emitter, on a glossy floor within a few degrees; its own scattering finds these
// once in a hundred samples, and each is then a hundred times as bright as the rest: they ruled the
// squared error of whole images. Scattering functions are reciprocal, so the directions of the
// highlight are those into which the floor scatters the light; where it is far away they are the
// same from all points, and a near emitter is seen as a far one would be from a nearer point. A
// plate of rough glass shows a light straight behind it. So a share of a vertex's directions is
// drawn from there: a mixture of densities, which changes no mean.
#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <cstddef>
#include <memory>
#include <new>
#include <optional>
#include <type_traits>
#include <vector>

#include "integrators/lights/bright_patches.h"
#include "limn/core/lights.h"
#include "limn/core/scene.h"
#include "limn/core/shading.h"

namespace limn {

class MirroredLight {
 public:
  static constexpr size_t kMostImages = 4;  // not tuned
  // The specular reflection of a light in a flat part of a surface, as one point sees it.
  struct Highlight {
    const Bsdf* bsdf;  // of the surface
    Vec3d normal;      // unit, of its lit side
    Vec3d light;       // unit, from where it is best seen towards the light; through glass mirrored
    Vec3d toward;      // unit, from the point to there
    double depth;      // that what lies behind the surface's plane has from the point, along it
    double nearness;  // how far a far light's highlight would be seen from, over the distance there
    double half_angle;  // of the cap of directions that holds most of it [rad]
    double cone;        // 1 - the cosine of the angle of directions that are uniform; 0: others are
    double irradiance;  // of its light at the point, across it, without what hides it
  };
  // The part that a vertex takes of its directions from each highlight.
  struct Mixture {
    Mixture() {}           // NOLINT: a path has hundreds of bytes here that are hardly ever used
    double share = 0;      // of all together; 0: from the scattering function alone
    double elsewhere = 0;  // luminance of what is seen beside them, about, if any is seen
    double rough = 1;  // the probability of directions from here, or from the scattering function
    int count = 0;
    std::array<double, kMostImages> part;  // sum to 1

    Highlight& highlight(int i) {
      return std::launder(reinterpret_cast<Highlight*>(highlights_))[i];
    }
    const Highlight& highlight(int i) const {
      return std::launder(reinterpret_cast<const Highlight*>(highlights_))[i];
    }

   private:
    // In bytes such objects live as soon as they are written to: what there is none of is not
    // filled.
    static_assert(std::is_aggregate_v<Highlight> && std::is_trivially_copyable_v<Highlight>);
    alignas(Highlight) std::byte highlights_[kMostImages * sizeof(Highlight)];
  };

  enum class Use { kDerivatives, kImage };
  // Both must outlive it. Null where the scene has no such light or surface; for an image also
  // where such highlights add little noise: they may still rule a derivative at edges before them.
  static std::unique_ptr<MirroredLight> make(const Scene& scene, const Lights& lights,
                                             Use use = Use::kDerivatives);

  // surface: of the same scene, or of it as it has moved, where the materials that it had count.
  template <class S>
  Mixture mixture(const SurfacePoint<S>& surface, const Scattering<S>& scattering) const {
    Mixture mixture;
    mixture.rough = scattering.rough_share();
    double sum = 0, of_emitters = 0, least = 0;
    const Bsdf& bsdf = *scene_.shape(surface.face.shape).bsdf->side(scattering.front());
    for (const Image& image : images_) {
      Highlight& highlight = mixture.highlight(mixture.count);
      if (image.holds(surface.face) || !sees(image, value(surface.p), highlight)) continue;
      const bool flank =
          !bsdf.lobes().below && turn_to_flank(highlight, value(scattering.normal()));
      const double power = image.weight * luminance(scattering.eval_value(bsdf, highlight.toward)) *
                           highlight.irradiance;
      if (!(power > 0)) continue;
      if (flank) least = kFlankShare;
      mixture.part[mixture.count++] = power;
      sum += power;
      if (image.emitter) of_emitters += image.weight * highlight.irradiance;
    }
    if (!(sum > 0)) return mixture;
    for (int i = 0; i < mixture.count; ++i) mixture.part[i] /= sum;
    mixture.elsewhere = environment_ + std::max(lit_, kScattered / kPi * of_emitters);
    // Five times as much gave the same error in the demo.
    const double share = sum / (sum + mixture.elsewhere);
    if (std::isfinite(share)) mixture.share = std::clamp(share, least, kMostShare);
    return mixture;
  }
  // The density at the unit direction w [1/sr], of which scattering alone has this one there; both
  // integrate to mixture.rough.
  static double pdf(const Mixture& mixture, const Vec3d& w, double scattered);
  // Of directions of one highlight.
  static double pdf(const Highlight& highlight, const Vec3d& w);
  // Greater where the highlight is brighter: along an edge, its brightest point has the most.
  static double alignment(const Highlight& highlight, const Vec3d& w);
  // A direction of the highlights, from three numbers in [0, 1).
  static std::optional<Vec3d> sample(const Mixture& mixture, double u, double u1, double u2);

 private:
  static constexpr double kMostShare = 0.5;  // not tuned
  // Flanks have at least this share, though little of the light: it comes from a few directions,
  // and derivatives there are large. Not tuned.
  static constexpr double kFlankShare = 0.1;
  // What emitters send comes back from other surfaces with this share of it. Not tuned.
  static constexpr double kScattered = 0.5;
  static constexpr size_t kMostFaces = 256;  // of a mesh that is looked through for flat parts
  // A light in a flat part of a surface.
  struct Image {
    // What lies in the part sees nothing in it, wherever the part has moved since.
    bool holds(FaceRef face) const { return face.shape == shape && faces[face.face.index()]; }
    ShapeId shape;
    std::bitset<kMostFaces> faces;
    const Bsdf* bsdf = nullptr;
    Vec3d normal;  // unit, of the lit side
    Vec3d center;  // of a sphere around the flat part
    double radius = 0;
    double width = 0, albedo = 0;  // of the lobe
    bool infinite = false;         // the light is
    double passed_cone = 0;        // half-angle of what a plate passes [rad]; 0: it mirrors
    double least_cosine = 1;       // of the half vector where it is bright (`sees`), if infinite
    Vec3d light;                   // its center, or the unit direction towards it
    double size = 0;  // radius of a sphere around it; at infinity the sine of its angle
    std::optional<size_t> emitter;  // which of all lights it is; none: a patch
    double irradiance = 0;          // across it, at the part's center
    double light_in_part = 0;       // how much of it falls on the part
    double weight = 1;              // of the share of directions that it gets
  };
  struct FlatPart;
  MirroredLight(const Scene& scene, const Lights& lights) : scene_(scene), lights_(lights) {}
  std::vector<Image> find_lights(const Scene& scene);
  void add(const FlatPart& part, const Bsdf& bsdf, const Vec3d& normal, const Image& source);
  double noise(const Image& image) const;
  static std::vector<FlatPart> flat_parts(const Mesh& mesh, ShapeId shape);
  bool sees(const Image& image, const Vec3d& p, Highlight& highlight) const;
  // If the middle of a highlight is behind a surface of normal n or hardly before it, makes it the
  // flank that the surface sees: directions within a cone, and their part of the irradiance.
  static bool turn_to_flank(Highlight& highlight, const Vec3d& n);

  const Scene& scene_;
  const Lights& lights_;
  std::vector<Image> images_;  // in the order in which they are found
  double environment_ = 0;     // mean luminance of it
  double lit_ = 0;             // and of surfaces by emitters, about
};

// Of a vertex behind which the path scatters again; none at others.
template <class S>
MirroredLight::Mixture mixture_at(const MirroredLight* mirrored, const SurfacePoint<S>& surface,
                                  const Scattering<S>& scattering, bool scatters_again) {
  return mirrored && scatters_again ? mirrored->mixture(surface, scattering)
                                    : MirroredLight::Mixture{};
}

}  // namespace limn
