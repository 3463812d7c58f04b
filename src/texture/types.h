#pragma once
// Factories of the texture types in the registry, and what they share.
#include <array>
#include <memory>

#include "limn/core/matrix.h"
#include "limn/core/properties.h"
#include "limn/core/texture.h"

namespace limn {

std::shared_ptr<Texture> read_bitmap(Properties& properties);
std::shared_ptr<Texture> read_checkerboard(Properties& properties);
std::shared_ptr<Texture> read_mesh_attribute(Properties& properties);

// A texture's own map of the surface's texture coordinates: affine.
struct UvTransform {
  double m[2][3] = {{1, 0, 0}, {0, 1, 0}};

  template <class S>
  std::array<S, 2> operator()(const std::array<S, 2>& uv) const {
    return {m[0][0] * uv[0] + m[0][1] * uv[1] + m[0][2],
            m[1][0] * uv[0] + m[1][1] * uv[1] + m[1][2]};
  }
  bool is_identity() const;
  // Whether coordinates that differ by integers are mapped to such.
  bool keeps_integers() const;
  std::string describe() const;  // ", to_uv ..."; "" for the identity
};

// Reads to_uv: a transform of (u, v, 0), as in Mitsuba.
UvTransform read_to_uv(Properties& properties);

// As Texture::add_discontinuities: where a coordinate of to_uv is a multiple of 1 / per_unit.
bool add_grid_lines(const std::array<std::array<double, 2>, 3>& uv, const UvTransform& to_uv,
                    const std::array<int, 2>& per_unit, size_t most,
                    Texture::Discontinuities& lines);

}  // namespace limn
