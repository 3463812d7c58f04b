// Texels, sorted out by the patches that hold them.
#include "integrators/lights/split_environment.h"

#include <algorithm>
#include <cmath>

#include "integrators/lights/bright_patches.h"

namespace limn {

std::optional<SplitEnvironment> split_environment(const Environment& environment) {
  const auto grid = environment.grid();
  if (!grid) return std::nullopt;
  const std::vector<BrightPatch> found = find_bright_patches(environment);
  Image patches = environment.texels();
  // (A map of a single row stands for all.)
  if (found.empty() || patches.height != grid->rows) return std::nullopt;
  Image rest = patches;
  bool any = false;
  for (int j = 0; j < grid->rows; ++j) {
    const double theta = kPi * j / (grid->rows - 1);
    for (int i = 0; i < grid->columns; ++i) {
      const double phi = 2 * kPi * (i + 0.5) / grid->columns;
      const Vec3d w =
          grid->pole * std::cos(theta) +
          (grid->zero * std::cos(phi) + grid->quarter * std::sin(phi)) * std::sin(theta);
      const bool bright = std::any_of(found.begin(), found.end(),
                                      [&](const BrightPatch& patch) { return patch.cap.holds(w); });
      any = any || bright;
      for (int c = 0; c < 3; ++c) (bright ? rest : patches).at(i, j, c) = 0;
    }
  }
  if (!any) return std::nullopt;
  const auto with = [&](const Image& texels) {
    const std::shared_ptr<Environment> map = environment.clone();
    map->set_texels(texels);
    return map;
  };
  return SplitEnvironment{with(patches), with(rest)};
}

}  // namespace limn
