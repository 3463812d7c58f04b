// Coverage as an image: all that is not covered shows a sky of radiance -1.
#include "limn/core/coverage.h"

#include <fmt/format.h>

#include <algorithm>

#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/image.h"
#include "limn/core/make_bsdf.h"

namespace limn {
namespace {

// How far values may lie outside of 0 to 1: rounding to half floats takes them there.
constexpr float kRounding = 0x1p-10f;

void remove_emitters(Scene& scene) {
  for (size_t s = scene.shapes.size(); s-- > 0;) {
    if (!scene.shapes[s].is_emitter) continue;
    const auto at = static_cast<std::ptrdiff_t>(s);
    scene.shapes.erase(scene.shapes.begin() + at);
    if (!scene.exposure) continue;
    std::vector<Course>& courses = own_exposure(scene).shapes;
    courses.erase(courses.begin() + at);
  }
}

}  // namespace

Scene coverage_of(const Scene& scene) {
  Scene copy = deep_copy(scene);
  if (scene.hide_emitters) remove_emitters(copy);
  const std::shared_ptr<Bsdf> black = make_diffuse(0.0);
  for (Shape& shape : copy.shapes) {
    shape.bsdf = black;
    shape.is_emitter = false;
    shape.radiance = {};
    shape.radiance_texture = nullptr;
    shape.emitter_id.clear();
  }
  copy.bsdfs_by_id.clear();
  copy.delta_lights.clear();
  copy.environment = make_constant_environment(grey(-1.0));
  copy.environment_id.clear();
  copy.hide_emitters = false;
  copy.max_depth = 1;
  return copy;
}

Image read_coverage(const std::string& file) {
  Image mask = read_alpha(file);
  // Programs add a channel without holes to any PNG: then the mask is in its colours.
  const bool opaque = std::ranges::all_of(mask.data, [](float alpha) { return alpha >= 1; });
  if (mask.data.empty() || (opaque && !file.ends_with(".exr"))) {
    const StoredImage stored = read_stored_image(file);
    mask = Image(stored.width, stored.height, 1);
    for (size_t i = 0; i < mask.data.size() * stored.channels; ++i) {
      const float value =
          stored.floats.empty() ? static_cast<float>(stored.bytes[i]) / 255 : stored.floats[i];
      mask.data[i / stored.channels] += value / static_cast<float>(stored.channels);
    }
  }
  for (float& value : mask.data) {
    if (!(value >= -kRounding && value <= 1 + kRounding)) {
      throw InputError(
          {file}, fmt::format("a mask of coverage has values from 0 to 1, this one {:g}", value));
    }
    value -= 1;
  }
  return mask;
}

}  // namespace limn
