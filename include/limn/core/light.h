#pragma once
// The interface of a light for path tracing, edge samplers and shadow boundaries.
//
// Lights sample directions, and sampled directions are static (detached):
// densities are constants. A delta light (point, spot, directional) has a single
// direction per point, which is a function of the parameters and carries their
// derivatives.
#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "limn/core/bsdf.h"
#include "limn/core/dual.h"
#include "limn/core/matrix.h"
#include "limn/core/mesh.h"
#include "limn/core/rng.h"
#include "limn/core/vec.h"

namespace limn {

class DeltaLight;
class Light;
class Properties;
struct Scene;
struct Shape;

// A sampled direction from a shading point towards a light.
struct LightSample {
  Vec3d wo;             // unit, from the point towards the light
  double distance = 0;  // infinite for environment and directional lights
  // Density of this light and direction [1/sr]. For a delta light: the probability of choosing the
  // light.
  double pdf = 0;
  std::optional<FaceRef> face = {};  // of an area light
  const Light* light = nullptr;
  std::array<double, 2> place = {};  // of the direction, in coordinates of the light's own
};

// A light as hit by a ray.
struct LightView {
  Vec3d wo;          // unit, of the ray
  double distance;   // along the ray; infinite for an environment
  Vec3d n_g;         // unit geometric normal at the hit; unused for an environment
  FaceId face = {};  // at the hit; unused for an environment, and if faces are drawn by area
};

// The uniform numbers in [0, 1) that one light sample consumes.
using LightNumbers = std::array<double, 3>;

class Light {
 public:
  virtual ~Light() = default;

  // Samples a direction from p towards the light. probability: of choosing this light. Nothing (a
  // sample of value zero) if the sampled point does not face p, or its density underflows.
  virtual std::optional<LightSample> sample(const Vec3d& p, double probability,
                                            const LightNumbers& u) const = 0;
  // The density [1/sr] of `sample` for this view from p; 0 for a delta light.
  virtual double pdf(const Vec3d& p, const LightView& view, double probability) const = 0;

  // Radiance arriving from the unit direction wo at points that the light illuminates; zero for a
  // delta light.
  virtual Rgb<double> radiance(const Vec3<double>& wo) const = 0;
  virtual Rgb<Dual> radiance(const Vec3<Dual>& wo) const = 0;
  // Radiance of a direction that this light sampled. The direction is static, so derivatives are
  // those of the light's own parameters alone.
  template <class S>
  Rgb<S> drawn_radiance(const LightSample& sample) const {
    if constexpr (std::is_same_v<S, double>) {
      return drawn_value(sample);
    } else {
      return drawn_dual(sample);
    }
  }

  // This light as a delta light, or null.
  virtual const DeltaLight* delta() const { return nullptr; }
  // Appends the light's surface as triangles, for edge samplers. Appends nothing for environments
  // and delta lights.
  virtual void add_triangles(std::vector<LightTriangle>& /*triangles*/) const {}

 protected:
  virtual Rgb<double> drawn_value(const LightSample& sample) const { return radiance(sample.wo); }
  virtual Rgb<Dual> drawn_dual(const LightSample& sample) const {
    return radiance(Vec3<Dual>{sample.wo.x, sample.wo.y, sample.wo.z});
  }
};

// Light arriving at a point from a single direction.
template <class S>
struct Arrival {
  Vec3<S> wo;         // unit, towards the light
  Rgb<S> irradiance;  // on a surface perpendicular to wo [W / m^2]
};

// The origin of a delta light.
struct LightOrigin {
  Vec3<Dual> v;  // position; if infinite, the unit direction of light transport
  bool infinite = false;

  // The unnormalised direction of light transport at y.
  template <class S>
  Vec3<S> through(const Vec3<S>& y) const {
    return infinite ? as<S>(v) : y - as<S>(v);
  }
};

class DeltaLight : public Light {
 public:
  std::string id;    // "" if the file gives none
  Matrix4 to_world;  // as read; a position becomes a translation, a direction a rotation of z

  // Unoccluded light arriving at p. Nothing if p is outside the cone of a spot, or is the position
  // of the light itself.
  virtual std::optional<Arrival<double>> arriving(const Vec3<double>& p) const = 0;
  virtual std::optional<Arrival<Dual>> arriving(const Vec3<Dual>& p) const = 0;
  virtual LightOrigin origin() const = 0;
  // Upper bound of the luminance of the emitted intensity [W/sr], or of the irradiance [W / m^2] of
  // a directional light.
  virtual double power() const = 0;

  // The bitmap that multiplies what it sends, and that one's name; null if there is none.
  virtual Texture* texture() const { return nullptr; }
  virtual std::string texture_name() const { return ""; }
  // The irradiance at p as a sum of its texels.
  virtual TexelMap::TexelWeights texel_weights(const Vec3d& /*p*/) const { return {}; }

  virtual std::vector<ParameterRef> parameters() = 0;
  virtual std::shared_ptr<DeltaLight> clone() const = 0;  // with a texture of its own
  virtual std::string describe() const = 0;               // one line for `limn info`

  std::optional<LightSample> sample(const Vec3d& p, double probability,
                                    const LightNumbers& u) const final;
  double pdf(const Vec3d&, const LightView&, double) const final { return 0; }
  Rgb<double> radiance(const Vec3<double>&) const final { return {}; }
  Rgb<Dual> radiance(const Vec3<Dual>&) const final { return {}; }
  const DeltaLight* delta() const final { return this; }
};

// Reads an emitter element into the scene: into `shape` if it is nested in one (else null).
// InputError for an unknown type (lists the known ones), a wrong place, or bad values.
void read_light(Properties& properties, Scene& scene, Shape* shape);

// How area lights draw their faces.
enum class DrawFaces {
  kByLight,  // mostly by what they send to the point, unoccluded
  kByArea,
};

// The area light of an emitting shape. The scene must outlive it.
std::unique_ptr<Light> make_area_light(const Scene& scene, ShapeId shape, DrawFaces draw);

}  // namespace limn
