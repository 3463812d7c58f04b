#pragma once
// Scattering at a surface, seen from the front. All BSDFs are isotropic and opaque. They are
// functions of world-space directions and the shading normal alone. No tangent frame enters, so
// none can introduce a discontinuity.
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

// A differentiable value of an object: "alpha", "reflectance", "radiance", ... A colour is
// differentiated along grey: all channels change by the same amount. Channels never mix, so channel
// c of the derivative image is the derivative with respect to channel c.
struct ParameterRef {
  std::string name;
  std::vector<Dual*> values;  // one, or the three channels
  enum class Unit { kValue, kLength, kRadians } unit = Unit::kValue;
  // Range of valid values, inclusive; equal to the range that the scene reader accepts.
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
};

// The value of a BSDF and the density of `sample` for one pair of directions.
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

  // Density of `sample` with respect to solid angle [1/sr]; 0 if n.wo <= 0.
  virtual double pdf_solid_angle(const Vec3d& n, const Vec3d& wi, const Vec3d& wo) const = 0;
  // Both of the above, at little more than the cost of one.
  virtual BsdfValue eval_with_pdf(const Vec3d& n, const Vec3d& wi, const Vec3d& wo) const = 0;
  // Samples wo from two uniform numbers in [0, 1). Returns nothing if the sample falls below the
  // surface; pdf_solid_angle then integrates to less than 1 by that probability.
  virtual std::optional<Vec3d> sample(const Vec3d& n, const Vec3d& wi, double u1,
                                      double u2) const = 0;

  // Batched versions for SIMD. An element's result does not depend on the other elements; it may
  // differ from the scalar functions by rounding.
  struct Evaluation {
    const Vec3d *n, *wi, *wo;
    BsdfValue* value;
  };
  virtual void eval_with_pdf_each(std::span<const Evaluation> evaluations) const;
  struct Draw {
    const Vec3d *n, *wi;
    const double* u;  // two numbers in [0, 1)
    Vec3d* wo;        // zero if nothing was sampled
  };
  virtual void sample_each(std::span<const Draw> draws) const;

  // The BSDF of the front or the back; null if that side is black. The back is evaluated as a front
  // with reversed normals.
  virtual const Bsdf* side(bool front) const { return front ? this : nullptr; }

  // True if no parameter of the pass changes this BSDF: `eval` on doubles is then exact where its
  // arguments are constant, too. False is always a safe answer.
  virtual bool is_constant() const { return false; }

  // The summary that edge samplers use as importance. By default the hemisphere with albedo 1.
  virtual LobeSummary lobe() const { return {}; }
  virtual std::vector<ParameterRef> parameters() = 0;
  virtual std::shared_ptr<Bsdf> clone() const = 0;  // deep
  // Nested BSDFs. deep_copy() uses them to preserve sharing.
  virtual std::span<std::shared_ptr<Bsdf>> nested() { return {}; }
  // One line of description, printed by `limn info`.
  virtual std::string describe() const = 0;
};

// Creates the BSDF that an element describes. InputError for bad values and for an unknown type
// (the message lists the known ones).
std::shared_ptr<Bsdf> make_bsdf(Properties& properties);
std::shared_ptr<Bsdf> make_diffuse(const Rgb<double>& reflectance);

// A rough conductor. The defaults are Mitsuba's: eta = 0, k = 1 reflects all light at every angle.
struct RoughConductorValues {
  enum class Distribution { kBeckmann, kGgx };
  Distribution distribution = Distribution::kBeckmann;
  double alpha = 0.1;  // roughness of the microfacet distribution, not squared
  Rgb<double> eta{0, 0, 0};
  Rgb<double> k{1, 1, 1};
  Rgb<double> specular_reflectance{1, 1, 1};
};
std::shared_ptr<Bsdf> make_roughconductor(const RoughConductorValues& values);

}  // namespace limn
