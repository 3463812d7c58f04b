// What BSDFs that are made of others have in common.
#include "src/bsdf/nested.h"

#include <fmt/format.h>

namespace limn {

namespace {

int count_smooth(const Bsdf& bsdf) {
  int most = 0;
  for (const bool front : {true, false}) {
    const Bsdf* const side = bsdf.side(front);
    if (!side || !side->lobes().smooth) continue;
    const Vec3d n{0, 0, 1};
    SmoothRays<double> rays;
    most = std::max(most, side->smooth_rays(n, n, rays));
  }
  return most;
}

}  // namespace

void NestingBsdf::add_nested(bool straight) {
  own_textures_ = texture_count_;
  Lobes of[2];
  for (const bool front : {false, true}) {
    Lobes& lobes = of[front];
    lobes = {.above = false, .smooth = straight, .through = straight};
    for (const auto& bsdf : nested_) {
      const Bsdf* const side = bsdf->side(front);
      if (!side) continue;
      lobes.above |= side->lobes().above;
      lobes.below |= side->lobes().below;
      lobes.smooth |= side->lobes().smooth;
      lobes.through |= side->lobes().through;
    }
  }
  for (const auto& bsdf : nested_) {
    // In a twosided BSDF the textures of the back follow those of the front.
    const auto sides = bsdf->nested();
    const bool two = sides.size() == 2 && bsdf->side(false) == sides[1].get();
    first_[true].push_back(texture_count_);
    first_[false].push_back(texture_count_ + (two ? sides[0]->texture_count() : 0));
    texture_count_ += bsdf->texture_count();
  }
  lobes_ = of[true];
  if (of[false].above || of[false].below || of[false].smooth) set_back(of[false]);
}

std::vector<std::shared_ptr<Bsdf>> read_nested(Properties& properties, size_t count, int own,
                                               int rays) {
  auto nested = properties.bsdfs();
  if (nested.size() != count) {
    properties.fail(
        fmt::format("needs {} nested bsdf{}, not {}", count, count == 1 ? "" : "s", nested.size()));
  }
  int textures = own;
  for (const auto& bsdf : nested) {
    textures += bsdf->texture_count();
    rays += count_smooth(*bsdf);
  }
  if (textures > kMostTextures) {
    properties.fail(fmt::format("{} textures in all: there may be {}", textures, kMostTextures));
  }
  if (rays > kMostSmoothRays) {
    properties.fail(fmt::format("{} smooth lobes in all: there may be {}", rays, kMostSmoothRays));
  }
  return nested;
}

ConstantOrTexture read_unit_number(Properties& properties, const char* name) {
  if (auto texture = read_texture(properties, name, 1)) return texture;
  return std::clamp(properties.number_or_colour(name, 0.5), 0.0, 1.0);
}

}  // namespace limn
