#pragma once
// Light from infinity, from all directions: what a ray sees that leaves the scene.
#include <array>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "limn/core/image.h"
#include "limn/core/light.h"

namespace limn {

class Environment : public Light {
 public:
  // Radiance arriving from the unit direction d. The Dual version carries the motion of d (a
  // turning camera) and of the environment's own parameters; it is continuous in d.
  Rgb<double> radiance(const Vec3<double>& d) const override = 0;
  Rgb<Dual> radiance(const Vec3<Dual>& d) const override = 0;
  // Importance sampling: a unit direction from two numbers in [0, 1), and its density [1/sr]
  // (which rounding at the border of a black region may turn into 0: such a draw counts as none).
  struct Drawn {
    Vec3d direction;
    double pdf;
    std::array<double, 2> place;  // see LightSample
  };
  using Numbers = std::array<double, 2>;
  // drawn[i] from u[i]; what is drawn does not depend on what is drawn beside it.
  virtual void sample_directions(std::span<const Numbers> u, std::span<Drawn> drawn) const = 0;
  Drawn sample_direction(double u1, double u2) const {
    const Numbers u{u1, u2};
    Drawn drawn;
    sample_directions({&u, 1}, {&drawn, 1});
    return drawn;
  }
  virtual double pdf_solid_angle(const Vec3d& d) const = 0;

  // Where a unit direction lies, in an environment's own terms (see LightSample). What `look` reads
  // there is asked for, so that it is at hand some work later.
  virtual std::array<double, 2> find(const Vec3d& /*d*/) const { return {}; }
  // The same for many at once, some of them side by side. What one comes to does not depend on the
  // others; it may differ from the above in rounding.
  struct Found {
    const Vec3d* d;
    std::array<double, 2>* place;
  };
  virtual void find_each(std::span<const Found> found) const {
    for (const Found& f : found) *f.place = find(*f.d);
  }
  // `radiance` of a direction that has been found.
  virtual Rgb<double> radiance_at(const Vec3d& d, const std::array<double, 2>& /*place*/) const {
    return radiance(d);
  }
  // Radiance from a unit direction that is held, and its density, found at once. place: that of
  // `find`.
  template <class S>
  struct Sight {
    Rgb<S> radiance;  // derivatives: those of the environment's own parameters alone
    double pdf;       // [1/sr]
  };
  virtual void look(const Vec3d& d, const std::array<double, 2>& place,
                    Sight<double>& sight) const = 0;
  virtual void look(const Vec3d& d, const std::array<double, 2>& place,
                    Sight<Dual>& sight) const = 0;

  // Whether the radiance is the same from all directions.
  virtual bool is_uniform() const = 0;
  // Mean over the sphere of the luminance of `radiance`, exact.
  virtual double mean_luminance() const = 0;

  // Radiance that is bilinear between points of a grid over azimuth and polar angle: column i lies
  // at the azimuth 2 pi (i + 1/2) / columns from `zero` towards `quarter`, row j at the angle pi j
  // / (rows - 1) from the pole. Unit vectors, across each other.
  struct Grid {
    Vec3d pole, zero, quarter;
    int columns, rows;
  };
  virtual std::optional<Grid> grid() const { return std::nullopt; }

  virtual std::vector<ParameterRef> parameters() = 0;  // constant: radiance; envmap: scale

  // A map of texels that radiance is linear in; 0 by 0 where it is not that of a map, and then none
  // of what follows may be called. A map of a single row holds it twice: it stands for all.
  struct Map {
    int width = 0, height = 0;
    double mean = 0;  // of the magnitudes of the texels
  };
  virtual Map map() const { return {}; }
  // Height by width by 3, row 0 on top, as the file has them, without the map's scale.
  virtual Image texels() const { return {}; }
  // The map with other texels, as a file with them would make it: what directions are drawn in
  // proportion to changes with them. As many as there are, all finite.
  virtual void set_texels(const Image& /*texels*/) {}
  // Adds `velocity`, of texels, to what derivative lane `lane` of the radiance carries.
  virtual void add_texel_tangents(const Image& /*velocity*/, int /*lane*/) {}
  // The radiance from the unit direction d is the sum of four texels so weighed, in each channel
  // alike; texel: counted row by row from the top.
  struct TexelWeight {
    uint32_t texel;
    double weight;
  };
  virtual std::array<TexelWeight, 4> texel_weights(const Vec3d& /*d*/) const { return {}; }

  virtual std::shared_ptr<Environment> clone() const = 0;
  virtual std::string describe() const = 0;

  // As a sample of a light that is chosen with that probability; none where the density is 0.
  std::optional<LightSample> light_sample(const Drawn& drawn, double probability) const;
  std::optional<LightSample> sample(const Vec3d&, double probability,
                                    const LightNumbers& u) const final {
    return light_sample(sample_direction(u[0], u[1]), probability);
  }
  double pdf(const LightView& view, double probability) const final {
    return pdf_solid_angle(view.wo) * probability;
  }
};

std::shared_ptr<Environment> make_constant_environment(const Rgb<double>& radiance);

}  // namespace limn
