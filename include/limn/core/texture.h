#pragma once
// A number or colour that varies over a surface: looked up by texture coordinates, or interpolated
// from attributes of the mesh.
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "limn/core/ids.h"
#include "limn/core/mesh.h"
#include "limn/core/parameter_ref.h"
#include "limn/core/texel_map.h"

namespace limn {

class MeshAttribute;
class Properties;

// A point of a face of a textured mesh. S: double or Dual.
template <class S>
struct TexturePoint {
  const Mesh* mesh = nullptr;
  FaceId face;
  std::array<S, 2> b;   // barycentric coordinates of the face's second and third corner
  std::array<S, 2> uv;  // texture coordinates of the surface, before a texture's own to_uv
};

// The point with its texture coordinates (0, 0 if the mesh has none).
template <class S>
TexturePoint<S> texture_point(const Mesh& mesh, FaceId face, const std::array<S, 2>& b);

class Texture : public TexelMap {
 public:
  // Three channels; a texture of numbers (see for_numbers) gives one number three times.
  virtual Rgb<double> eval(const TexturePoint<double>& point) const = 0;
  virtual Rgb<Dual> eval(const TexturePoint<Dual>& point) const = 0;
  // Brings what `eval` reads there into the cache.
  virtual void fetch(const TexturePoint<double>& /*point*/) const {}

  // The same texture where one number is expected (a roughness, a weight): texels give their
  // luminance, other colours number_of. It shares no mutable data with this one.
  virtual std::shared_ptr<Texture> for_numbers() const = 0;
  bool of_numbers() const { return of_numbers_; }

  // The mean over texture coordinates, a stand-in where the point is unknown.
  virtual Rgb<double> mean() const = 0;
  // Range of the values over all channels and points.
  struct Range {
    double least, most;
  };
  virtual Range range() const = 0;
  // The range in which texels may move as parameters (at first [0, 1]).
  void set_valid(const Range& valid) { valid_ = valid; }
  const Range& valid() const { return valid_; }
  // Whether `eval` reads texture coordinates, not only barycentric ones.
  virtual bool needs_uv() const { return true; }
  // The attribute of the mesh that it reads ("vertex_color"); "" if none. Its numbers count times
  // `attribute_scale`.
  virtual std::string attribute() const { return ""; }
  virtual double attribute_scale() const { return 1; }
  // What holds the texels of points of a mesh: this, or an attribute of the mesh.
  virtual const TexelMap& texels_on(const Mesh& /*mesh*/) const { return *this; }

  // Whether it is the tangent of the surface (tangent.h), which no file names.
  virtual bool is_tangent() const { return false; }
  // Whether a channel of the value acts on all channels of what is scattered, as a vector's does.
  bool mixes_channels() const { return mixes_channels_; }
  void set_mixes_channels() { mixes_channels_ = true; }

  // The weights of texels at a point, where there are texels. For numbers the luminance of the
  // weighted sum is looked up.
  virtual TexelWeights texel_weights(const TexturePoint<double>& /*point*/) const { return {}; }

  // Where `eval` is discontinuous on a face.
  struct Discontinuity {
    std::array<double, 2> from, to;  // barycentric coordinates of the second and third corner
  };
  struct Discontinuities {
    std::vector<Discontinuity> inside;  // line segments
    uint8_t sides = 0;                  // bit k: along the side from corner k to the next
  };
  // Adds those of a face over which texture coordinates are linear, from these of its corners.
  // False if there would be more than `most` inside; then what is added is not all.
  virtual bool add_discontinuities(const std::array<std::array<double, 2>, 3>& /*uv*/,
                                   size_t /*most*/, Discontinuities& /*lines*/) const {
    return true;
  }
  // Whether `eval` may be discontinuous at every edge of the mesh.
  virtual bool discontinuous_between_faces() const { return false; }
  // Whether it is discontinuous at the borders of texels. Where these are no edges (of light, of
  // bumps), derivatives with respect to what moves are refused.
  virtual bool discontinuous_between_texels() const { return false; }
  // Whether texture coordinates that differ by integers look up the same value.
  virtual bool has_period_one() const { return false; }

  // Values other than texels that derivatives take.
  virtual std::vector<ParameterRef> parameters() = 0;
  virtual std::shared_ptr<Texture> clone() const = 0;
  // One phrase, part of what `limn info` prints of a BSDF.
  virtual std::string describe() const = 0;

 protected:
  bool of_numbers_ = false;
  Range valid_{0, 1};

 private:
  bool mixes_channels_ = false;
};

// Creates the texture that an element describes. InputError for bad values and for an unknown type
// (the message lists the known ones).
std::shared_ptr<Texture> make_texture(Properties& properties);

// What a scene gives for a colour or a number: a constant, or a texture (then `constant` is
// unused).
struct ConstantOrTexture {
  ConstantOrTexture(const Rgb<double>& c) : constant(c) {}                  // NOLINT: either is one
  ConstantOrTexture(double c) : constant(grey(c)) {}                        // NOLINT
  ConstantOrTexture(std::shared_ptr<Texture> t) : texture(std::move(t)) {}  // NOLINT
  Rgb<double> constant;
  std::shared_ptr<Texture> texture;
};

}  // namespace limn
