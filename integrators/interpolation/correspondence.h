#pragma once
// Which corners of the sky polygons of a triangle's three vertices belong together.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "integrators/interpolation/sky_polygons.h"

namespace limn {

// A triangle between points whose sky is known.
struct SkyPatch {
  std::array<uint32_t, 3> vertices;  // indices of polygons
  Vec3d center;
};

// Loops of triples: of corners counted on through the polygons of the three vertices. The k-th is
// one of vertex k, or, of a loop that shrinks to a point, of another.
struct SkyTriples {
  std::vector<std::array<uint32_t, 3>> triples;
  std::vector<uint32_t> starts{0};
  uint32_t relaxed = 0;  // of these, what no rule chose
};

struct CorrespondenceOptions {
  uint64_t seed = 0;         // of the order of patches
  bool single_loops = true;  // a loop goes with at most one of each other polygon
  int threads = 1;
};

std::vector<SkyTriples> find_correspondence(std::span<const SkyPolygons> skies,
                                            std::span<const SkyPatch> patches,
                                            const CorrespondenceOptions& options);

}  // namespace limn
