#pragma once
// What the camera sees, besides light: layers of an image.
#include <string>
#include <vector>

#include "limn/core/image.h"
#include "limn/core/scene.h"
#include "limn/integrators/run.h"

namespace limn {

// normals: unit shading normal, world axes. depth: distance along the camera's ray, scene units.
// position: world space. uv: texture coordinates, of shapes that have textures (else 0). albedo:
// the share of light from the camera's direction that is scattered, by one direction per sample.
// alpha: 1. All are 0 where the camera sees no surface; emitters are none with hide_emitters.
std::vector<std::string> layer_names();

struct LayersResult {
  std::vector<ImageLayer> layers;  // crop_height by crop_width: means over the pixel's filter
  int64_t spp = 0;                 // samples per pixel that were finished
  double seconds = 0;
  NonFinite non_finite;
};
// names: of layer_names(), each once; InputError for others.
LayersResult render_layers(const Scene& scene, const std::vector<std::string>& names,
                           const RunSettings& settings);

}  // namespace limn
