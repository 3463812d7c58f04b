#pragma once
// Light from infinity.
#include <memory>
#include <string>
#include <vector>

#include "limn/core/bsdf.h"
#include "limn/core/dual.h"
#include "limn/core/vec.h"

namespace limn {

class Properties;

class Environment {
 public:
  virtual ~Environment() = default;

  // Radiance arriving from the unit direction d. The Dual version carries the motion of d (a
  // turning camera) and of the environment's own parameters; it is continuous in d.
  virtual Rgb<double> radiance(const Vec3<double>& d) const = 0;
  virtual Rgb<Dual> radiance(const Vec3<Dual>& d) const = 0;
  // Importance sampling: a unit direction from two numbers in [0, 1), its density [1/sr]
  // (which rounding at the border of a black region may turn into 0: such a draw counts as none).
  virtual Vec3d sample(double u1, double u2) const = 0;
  virtual double pdf_solid_angle(const Vec3d& d) const = 0;

  // Whether the radiance is the same from all directions.
  virtual bool is_uniform() const = 0;
  // Mean over the sphere of the luminance of `radiance`, exact.
  virtual double mean_luminance() const = 0;

  virtual std::vector<ParameterRef> parameters() = 0;  // constant: radiance; envmap: scale
  virtual std::shared_ptr<Environment> clone() const = 0;
  virtual std::string describe() const = 0;
};

std::shared_ptr<Environment> make_constant_environment(const Rgb<double>& radiance);
// Elements <emitter type="constant"> and <emitter type="envmap">.
std::shared_ptr<Environment> make_environment(Properties& properties);

}  // namespace limn
