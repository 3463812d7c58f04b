#pragma once
// Environment emitters: radiance that arrives from infinity, for rays that leave the scene.
#include <array>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "limn/core/image.h"
#include "limn/core/light.h"
#include "limn/core/texel_map.h"

namespace limn {

class Environment : public Light, public TexelMap {
 public:
  // Radiance arriving from the unit direction d. The Dual version includes the derivatives of d (a
  // rotating camera) and of the environment's parameters. It is continuous in d.
  Rgb<double> radiance(const Vec3<double>& d) const override = 0;
  Rgb<Dual> radiance(const Vec3<Dual>& d) const override = 0;
  // Importance sampling: a unit direction from two uniform numbers in [0, 1), and its density
  // [1/sr]. A sample whose density is rounded to 0 (beside a black region) has the value zero.
  struct Drawn {
    Vec3d direction;
    double pdf;
    std::array<double, 2> place;  // see LightSample
  };
  using Numbers = std::array<double, 2>;
  // drawn[i] is sampled from u[i], independently of the other elements.
  virtual void sample_directions(std::span<const Numbers> u, std::span<Drawn> drawn) const = 0;
  Drawn sample_direction(double u1, double u2) const {
    const Numbers u{u1, u2};
    Drawn drawn;
    sample_directions({&u, 1}, {&drawn, 1});
    return drawn;
  }
  virtual double pdf_solid_angle(const Vec3d& d) const = 0;

  // The position of a unit direction in the environment's own coordinates (see LightSample).
  // Prefetches the data that `look` will read there.
  virtual std::array<double, 2> find(const Vec3d& /*d*/) const { return {}; }
  // `find` for a batch, with SIMD. An element's result does not depend on the others; it may differ
  // from `find` by rounding.
  struct Found {
    const Vec3d* d;
    std::array<double, 2>* place;
  };
  virtual void find_each(std::span<const Found> found) const {
    for (const Found& f : found) *f.place = find(*f.d);
  }
  // `radiance` of a direction whose position `find` gave.
  virtual Rgb<double> radiance_at(const Vec3d& d, const std::array<double, 2>& /*place*/) const {
    return radiance(d);
  }
  // Radiance and density for a static unit direction, evaluated together. place: from
  // `find`.
  template <class S>
  struct Sight {
    Rgb<S> radiance;  // derivatives with respect to the environment's own parameters alone
    double pdf;       // [1/sr]
  };
  virtual void look(const Vec3d& d, const std::array<double, 2>& place,
                    Sight<double>& sight) const = 0;
  virtual void look(const Vec3d& d, const std::array<double, 2>& place,
                    Sight<Dual>& sight) const = 0;

  // True if the radiance is the same from all directions.
  virtual bool is_uniform() const = 0;
  // Mean luminance over the sphere, exact.
  virtual double mean_luminance() const = 0;

  // A grid over azimuth and polar angle between whose points radiance is bilinear. Column i has the
  // azimuth 2 pi (i + 1/2) / columns from `zero` towards `quarter`, row j the angle pi j / (rows -
  // 1) from `pole`. The three are orthogonal unit vectors.
  struct Grid {
    Vec3d pole, zero, quarter;
    int columns, rows;
  };
  virtual std::optional<Grid> grid() const { return std::nullopt; }

  virtual std::vector<ParameterRef> parameters() = 0;  // constant: radiance; envmap: scale

  // The radiance from the unit direction d as a sum of texels, where there is a map.
  virtual TexelWeights texel_weights(const Vec3d& /*d*/) const { return {}; }

  virtual std::shared_ptr<Environment> clone() const = 0;
  virtual std::string describe() const = 0;

  // Converts a draw to a LightSample; nothing if its density is 0. probability: of this light.
  std::optional<LightSample> light_sample(const Drawn& drawn, double probability) const;
  std::optional<LightSample> sample(const Vec3d&, double probability,
                                    const LightNumbers& u) const final {
    return light_sample(sample_direction(u[0], u[1]), probability);
  }
  double pdf(const Vec3d&, const LightView& view, double probability) const final {
    return pdf_solid_angle(view.wo) * probability;
  }
};

std::shared_ptr<Environment> make_constant_environment(const Rgb<double>& radiance);

// A map of one or three channels, all finite, rotated as by <rotate y="1"/> [degrees]. file: its
// name for describe().
std::shared_ptr<Environment> make_map_environment(const Image& image, double scale, double turn,
                                                  const std::string& file);

// `moved`, of whose map the texels alone may differ from those of `unmoved`, with directions drawn
// as by `unmoved`. An environment without a map is left as it is.
std::shared_ptr<Environment> drawn_alike(const std::shared_ptr<Environment>& moved,
                                         const Environment& unmoved);

}  // namespace limn
