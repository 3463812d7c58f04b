#pragma once
// Scattering at a surface, seen from the front. All BSDFs are isotropic and opaque, so they are
// functions of world-space directions and the shading normal alone: no tangent frame enters, and
// nothing jumps where a frame would.
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "limn/core/dual.h"
#include "limn/core/lobe.h"
#include "limn/core/vec.h"

namespace limn {

class Properties;

// A differentiable value that belongs to an object: "alpha", "reflectance", "radiance", ...
// Colours are differentiated along grey (all channels move by the same amount): channels never mix,
// so channel c of the derivative image is the derivative with respect to channel c.
struct ParameterRef {
  std::string name;
  std::vector<Dual*> values;  // one, or the three channels
  enum class Unit { kValue, kLength, kRadians } unit = Unit::kValue;
  // What each value may be, both ends included: what the reader of scenes takes.
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
};

// A value and the density of `sample` at one pair of directions.
struct BsdfValue {
  Rgb<double> value;
  double pdf = 0;  // [1/sr]
};

class Bsdf {
 public:
  virtual ~Bsdf() = default;

  // Value times |cos(n, wo)| [1/sr]. n: unit shading normal; wi: unit, towards the viewer,
  // n.wi > 0; wo: unit, towards the light. Zero if n.wo <= 0, and continuous there.
  virtual Rgb<double> eval(const Vec3<double>& n, const Vec3<double>& wi,
                           const Vec3<double>& wo) const = 0;
  virtual Rgb<Dual> eval(const Vec3<Dual>& n, const Vec3<Dual>& wi, const Vec3<Dual>& wo) const = 0;

  // Density of `sample` [1/sr], 0 if n.wo <= 0.
  virtual double pdf_solid_angle(const Vec3d& n, const Vec3d& wi, const Vec3d& wo) const = 0;
  // eval and pdf_solid_angle at the cost of little more than one of them.
  virtual BsdfValue eval_with_pdf(const Vec3d& n, const Vec3d& wi, const Vec3d& wo) const = 0;
  // Draws wo from two numbers in [0, 1). Nothing if the draw falls below the surface (that
  // probability is missing from the integral of pdf_solid_angle).
  virtual std::optional<Vec3d> sample(const Vec3d& n, const Vec3d& wi, double u1,
                                      double u2) const = 0;

  // The same for many at once, some of them side by side. What one comes to does not depend on the
  // others; it may differ from the above in rounding.
  struct Evaluation {
    const Vec3d *n, *wi, *wo;
    BsdfValue* value;
  };
  virtual void eval_with_pdf_each(std::span<const Evaluation> evaluations) const;
  struct Draw {
    const Vec3d *n, *wi;
    const double* u;  // two numbers in [0, 1)
    Vec3d* wo;        // zero: none
  };
  virtual void sample_each(std::span<const Draw> draws) const;

  // The BSDF that acts on the front or on the back; null if that side is black. The back is then
  // treated as a front with reversed normals.
  virtual const Bsdf* side(bool front) const { return front ? this : nullptr; }

  // Whether no parameter of the pass moves its values: `eval` is then as good in plain numbers
  // wherever its arguments are still. May be false without need.
  virtual bool is_still() const { return false; }

  // What edge samplers go by. The default knows nothing: the hemisphere.
  virtual LobeSummary lobe() const { return {}; }
  virtual std::vector<ParameterRef> parameters() = 0;
  virtual std::shared_ptr<Bsdf> clone() const = 0;  // deep
  // The BSDFs inside this one, so that a copy of a scene can share what the original shares.
  virtual std::span<std::shared_ptr<Bsdf>> nested() { return {}; }
  // One line for `limn info`.
  virtual std::string describe() const = 0;
};

// Makes the BSDF that an element describes; InputError for an unknown type (listing the known ones)
// or bad values.
std::shared_ptr<Bsdf> make_bsdf(Properties& properties);
std::shared_ptr<Bsdf> make_diffuse(const Rgb<double>& reflectance);

// A rough metal. The defaults are Mitsuba's: eta = 0, k = 1 reflects everything at every angle.
struct RoughConductorValues {
  enum class Distribution { kBeckmann, kGgx };
  Distribution distribution = Distribution::kBeckmann;
  double alpha = 0.1;  // the microfacet distribution's own parameter, not squared
  Rgb<double> eta{0, 0, 0};
  Rgb<double> k{1, 1, 1};
  Rgb<double> specular_reflectance{1, 1, 1};
};
std::shared_ptr<Bsdf> make_roughconductor(const RoughConductorValues& values);

}  // namespace limn
