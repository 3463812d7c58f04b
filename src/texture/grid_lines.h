#pragma once
// Lines of a grid of texture coordinates, where textures are discontinuous.
#include <array>

#include "src/texture/types.h"

namespace limn {

// As Texture::add_discontinuities: where a coordinate of to_uv is a multiple of 1 / per_unit.
bool add_grid_lines(const std::array<std::array<double, 2>, 3>& uv, const UvTransform& to_uv,
                    const std::array<int, 2>& per_unit, size_t most,
                    Texture::Discontinuities& lines);

}  // namespace limn
