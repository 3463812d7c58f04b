#pragma once
// Texels that derivatives take: of an environment map, or of a texture.
#include <array>
#include <cstdint>
#include <limits>

namespace limn {

struct Image;

class TexelMap {
 public:
  virtual ~TexelMap() = default;

  // What is looked up is linear in the texels. 0 by 0 if there are none, and then none of the
  // functions below may be called. An environment's map of one row is stored as two equal rows.
  struct Map {
    int width = 0;
    int height = 0;
    double mean = 0;  // mean magnitude of the texels
    // Range of valid values, inclusive.
    double least = -std::numeric_limits<float>::max();
    double most = std::numeric_limits<float>::max();
  };
  virtual Map map() const { return {}; }
  // Height by width by 3 texels, row 0 on top, without an environment's scale factor.
  virtual Image texels() const;
  // Replaces the texels, and the sampling density with them, as if read from a file. texels: of the
  // same size, all finite.
  virtual void set_texels(const Image& /*texels*/) {}
  // Adds the texel derivatives `velocity` to derivative `lane` of what is looked up.
  virtual void add_texel_tangents(const Image& /*velocity*/, int /*lane*/) {}
  // What is looked up is a weighted sum of four texels, with the same weights in all channels.
  // texel: index in row-major order, from the top.
  struct TexelWeight {
    uint32_t texel;
    double weight;
  };
  using TexelWeights = std::array<TexelWeight, 4>;
};

}  // namespace limn
