// Which BSDFs have derivatives, and whether the environment has.
#include "integrators/paths/moving_colours.h"

#include <algorithm>

namespace limn {
namespace {

// Texture or Environment: but for texels.
template <class Source>
bool is_constant(Source& source) {
  return std::ranges::all_of(source.parameters(), [](const ParameterRef& value) {
    return std::ranges::all_of(value.values, [](const Dual* x) { return limn::is_constant(*x); });
  });
}

}  // namespace

MovingColours::MovingColours(const Scene& scene, std::span<const Parameter> parameters)
    : sides_(scene.shapes.size()) {
  for (size_t s = 0; s < sides_.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    for (const bool front : {false, true}) {
      const Bsdf* const bsdf = shape.bsdf->side(front);
      if (!bsdf) continue;
      bool moves = !bsdf->is_constant();
      for (int k = 0; k < bsdf->texture_count(); ++k) {
        Texture& texture = bsdf->texture(k);
        moves |= !is_constant(texture);
        for (const Parameter& parameter : parameters) {
          moves |= parameter.texel_map(scene) == &texture.texels_on(shape.mesh);
        }
      }
      sides_[s][front] = moves;
    }
  }
  if (!scene.environment) return;
  sky_ = !is_constant(*scene.environment);
  for (const Parameter& parameter : parameters) {
    sky_ |= parameter.texel_map(scene) == scene.environment.get();
  }
}

}  // namespace limn
