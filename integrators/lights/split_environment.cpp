// Texels, sorted out by the patches that hold them.
#include "integrators/lights/split_environment.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "integrators/lights/bright_patches.h"
#include "limn/core/memory.h"
#include "limn/core/parallel.h"

namespace limn {
namespace {

// Two images; then two maps of at most 16 bytes, and what the second's density is made of.
constexpr double kBytesPerTexel = 2 * 12 + 2 * 16 + 4;

}  // namespace

std::optional<SplitEnvironment> split_environment(const Environment& environment, int threads) {
  const auto grid = environment.grid();
  if (!grid) return std::nullopt;
  const std::vector<BrightPatch> found = find_bright_patches(environment);
  if (found.empty()) return std::nullopt;
  require_memory({}, kBytesPerTexel * grid->columns * grid->rows,
                 "to keep the bright patches of the environment's map apart",
                 "use a smaller map, or another method (lines, rays)");
  Image patches = environment.texels(), rest = patches;
  std::vector<Vec3d> around;
  for (int i = 0; i < grid->columns; ++i) {
    const double phi = 2 * kPi * (i + 0.5) / grid->columns;
    around.push_back(grid->zero * std::cos(phi) + grid->quarter * std::sin(phi));
  }
  std::atomic<bool> any = false;
  parallel_for(grid->rows, threads, [&](size_t row) {
    const auto j = static_cast<int>(row);
    const double theta = kPi * j / (grid->rows - 1), c = std::cos(theta), s = std::sin(theta);
    for (int i = 0; i < grid->columns; ++i) {
      const Vec3d w = grid->pole * c + around[i] * s;
      const bool bright = std::any_of(found.begin(), found.end(),
                                      [&](const BrightPatch& patch) { return patch.holds(w); });
      if (bright) any = true;
      for (int k = 0; k < 3; ++k) (bright ? rest : patches).at(i, j, k) = 0;
    }
  });
  if (!any) return std::nullopt;
  const auto with = [&](const Image& texels) {
    const std::shared_ptr<Environment> map = environment.clone();
    map->set_texels(texels);
    return map;
  };
  return SplitEnvironment{with(patches), with(rest)};
}

}  // namespace limn
