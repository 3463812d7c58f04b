#pragma once
// The contract of a light: what a path tracer, the edge samplers and the edges of shadows ask of
// it.
//
// Directions are what is sampled: while a parameter moves the scene they are held fixed, so
// densities are constants. A delta light (a point, a spot, a direction) has no directions to choose
// from: the one direction is a function of the parameters and carries their derivative.
#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "limn/core/bsdf.h"
#include "limn/core/dual.h"
#include "limn/core/mesh.h"
#include "limn/core/rng.h"
#include "limn/core/vec.h"

namespace limn {

class DeltaLight;
class Light;
class Properties;
struct Scene;
struct Shape;

// A direction in which a point may see a light.
struct LightSample {
  Vec3d wo;             // unit, from the point towards the light
  double distance = 0;  // infinite for light from infinity
  // [1/sr], of this light among all and this direction; of a delta light the probability of the
  // light alone.
  double pdf = 0;
  std::optional<FaceRef> face = {};  // of an area light
  const Light* light = nullptr;
  std::array<double, 2> place = {};  // of the direction, in a light's own terms
};

// A light as a ray meets it.
struct LightView {
  Vec3d wo;         // unit, of the ray
  double distance;  // along it; infinite for light from infinity
  Vec3d n_g;        // unit geometric normal there; unused for light from infinity
};

// What one sample of a light is drawn from: in [0, 1).
using LightNumbers = std::array<double, 3>;

class Light {
 public:
  virtual ~Light() = default;

  // A direction from p to the light, which is chosen with that probability among all. None, a sample
  // of value zero, if the point that was drawn does not shine on p, or rounding leaves no density.
  virtual std::optional<LightSample> sample(const Vec3d& p, double probability,
                                            const LightNumbers& u) const = 0;
  // The density [1/sr] with which `sample` draws this view; 0 of a delta light.
  virtual double pdf(const LightView& view, double probability) const = 0;

  // Radiance that arrives from the unit direction wo at the points that the light shines on; none
  // of a delta light.
  virtual Rgb<double> radiance(const Vec3<double>& wo) const = 0;
  virtual Rgb<Dual> radiance(const Vec3<Dual>& wo) const = 0;
  // The same from the direction of a sample that this light drew, which is held: derivatives are
  // those of the light's own parameters alone.
  template <class S>
  Rgb<S> drawn_radiance(const LightSample& sample) const {
    if constexpr (std::is_same_v<S, double>) {
      return drawn_value(sample);
    } else {
      return drawn_dual(sample);
    }
  }

  // This light as a delta light; null if it is none.
  virtual const DeltaLight* delta() const { return nullptr; }
  // Appends its outline as triangles, for edge samplers; nothing for light from infinity and for
  // delta lights.
  virtual void add_triangles(std::vector<LightTriangle>& /*triangles*/) const {}

 protected:
  virtual Rgb<double> drawn_value(const LightSample& sample) const { return radiance(sample.wo); }
  virtual Rgb<Dual> drawn_dual(const LightSample& sample) const {
    return radiance(Vec3<Dual>{sample.wo.x, sample.wo.y, sample.wo.z});
  }
};

// Light that arrives at a point from one direction.
template <class S>
struct Arrival {
  Vec3<S> wo;         // unit, towards the light
  Rgb<S> irradiance;  // through an area across wo [W / m^2]
};

// Where the light of a delta light comes from.
struct LightOrigin {
  Vec3<Dual> v;  // the position; at infinity the unit direction in which light travels
  bool infinite = false;

  // The direction, not normalised, in which light passes through y.
  template <class S>
  Vec3<S> through(const Vec3<S>& y) const {
    return infinite ? as<S>(v) : y - as<S>(v);
  }
};

class DeltaLight : public Light {
 public:
  std::string id;  // "" if the file gives none

  // What arrives at p if nothing is in the way. None if nothing ever does: outside the cone of a
  // spot, or at the light's own position.
  virtual std::optional<Arrival<double>> arriving(const Vec3<double>& p) const = 0;
  virtual std::optional<Arrival<Dual>> arriving(const Vec3<Dual>& p) const = 0;
  virtual LightOrigin origin() const = 0;
  // A bound of the luminance that leaves it: of the intensity [W/sr], at infinity of the
  // irradiance [W / m^2].
  virtual double power() const = 0;

  virtual std::vector<ParameterRef> parameters() = 0;
  virtual std::shared_ptr<DeltaLight> clone() const = 0;
  virtual std::string describe() const = 0;  // one line for `limn info`

  std::optional<LightSample> sample(const Vec3d& p, double probability,
                                    const LightNumbers& u) const final;
  double pdf(const LightView&, double) const final { return 0; }
  Rgb<double> radiance(const Vec3<double>&) const final { return {}; }
  Rgb<Dual> radiance(const Vec3<Dual>&) const final { return {}; }
  const DeltaLight* delta() const final { return this; }
};

// Reads an emitter element into the scene: into `shape` if it stands inside one (else null).
// InputError for an unknown type (listing the known ones), one in the wrong place, or bad values.
void read_light(Properties& properties, Scene& scene, Shape* shape);

// The light of an emitting shape, uniform in area. The scene must outlive it.
std::unique_ptr<Light> make_area_light(const Scene& scene, ShapeId shape);

}  // namespace limn
