#pragma once
// Triangles over the faces that a camera sees, at whose vertices the visible sky is known exactly,
// and which corners of it belong together.
#include <map>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "integrators/interpolation/correspondence.h"
#include "integrators/interpolation/radiance_tables.h"
#include "integrators/interpolation/sky_polygons.h"
#include "limn/core/surface_point.h"

namespace limn {

// Polygons as they are seen from p.
void view_of(const SkyPolygons& sky, const Vec3d& p, DirectionLoops& loops);

struct SkyMeshOptions {
  // Faces are halved along each side, most_halvings times at most, until at the center of each
  // triangle the mean of its vertices' views differs by at most this part of an open sky; 0: never.
  double tolerance = 0.01;
  int most_halvings = 4;
  CorrespondenceOptions triples;
};

// A side of a face.
struct SeenSide {
  FaceRef face;
  bool front;
  auto key() const { return std::array<uint32_t, 3>{face.shape.index(), face.face.index(), front}; }
};

class SkyMesh {
 public:
  struct Vertex {
    ContourPoint at;
    Vec3d n;  // shading normal, to the side that is seen
  };
  // A place in a triangle, by its barycentric coordinates.
  struct Spot {
    uint32_t patch;
    std::array<double, 3> weights;
  };

  // The scene must outlive it.
  SkyMesh(const Scene& scene, const Contours& contours, std::span<const SeenSide> sides,
          const SkyMeshOptions& options);

  // Nothing for a side that was not given. b: of the face's second and third corner.
  std::optional<Spot> find(const SeenSide& side, const std::array<double, 2>& b) const;
  // The outline that lies between those of the patch's vertices, seen from p.
  void outline(const Spot& spot, const Vec3d& p, DirectionLoops& loops) const;
  // The surface at a place of a face.
  Vertex vertex_at(const SeenSide& side, const std::array<double, 2>& b) const;

  const std::vector<Vertex>& vertices() const { return vertices_; }
  const std::vector<SkyPolygons>& skies() const { return skies_; }
  const std::vector<SkyPatch>& patches() const { return patches_; }
  const std::vector<SkyTriples>& triples() const { return triples_; }
  // Of the side of a patch, and of its corners on the face.
  struct Origin {
    SeenSide side;
    std::array<std::array<double, 2>, 3> b;
  };
  const Origin& origin(uint32_t patch) const { return origins_[patch]; }
  size_t coarse() const { return coarse_; }  // triangles that missed the tolerance

 private:
  struct Grid {  // of a side: its number of cells along each side, and its first patch
    int cells = 0;
    uint32_t first = 0;
  };
  using Key = std::array<uint32_t, 3>;
  struct HashKey {
    size_t operator()(const Key& key) const;
  };
  void refine(std::span<const SeenSide> sides, const SkyMeshOptions& options);
  void bake(int threads);
  uint32_t vertex(const SeenSide& side, int i, int j, int cells);
  bool is_close(const SkyPatch& patch, const Vertex& center, double tolerance) const;

  const Scene& scene_;
  const Contours& contours_;
  std::vector<Vertex> vertices_;
  std::vector<SkyPolygons> skies_;  // of these
  std::unordered_map<Key, Grid, HashKey> grids_;
  std::map<std::array<float, 6>, uint32_t> known_;
  std::vector<SkyPatch> patches_;
  std::vector<Origin> origins_;
  std::vector<SkyTriples> triples_;
  size_t coarse_ = 0;
};

}  // namespace limn
