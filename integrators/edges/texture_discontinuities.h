#pragma once
// Where the textures of a scene are discontinuous: inside of faces, and at edges of meshes.
#include <span>
#include <string>
#include <vector>

#include "limn/core/scene.h"
#include "limn/core/texture.h"
#include "limn/edgetree/texture_edges.h"

namespace limn {

class TextureDiscontinuities {
 public:
  // Looks at the faces of textured shapes; nothing is done for others.
  explicit TextureDiscontinuities(const Scene& scene);

  // Null where the shape's textures are continuous at all edges of the mesh.
  const TextureSeams* seams(ShapeId shape) const;
  // By faces; those of two textures that coincide once.
  std::span<const FaceSegment> segments(ShapeId shape) const;
  // How many there are in the whole scene, or more than kMost: then the last shapes lack theirs.
  size_t count() const { return count_; }
  static constexpr size_t kMost = 1000000;
  // The first shape that lacks segments, if any.
  ShapeId first_without() const { return first_without_; }
  // Spheres and disks whose textures are discontinuous where an angle comes back to its beginning:
  // along a meridian that is not found.
  const std::vector<ShapeId>& with_meridian() const { return with_meridian_; }

 private:
  struct OfShape {
    TextureSeams seams;
    bool has_seams = false;
    std::vector<FaceSegment> segments;
  };
  void look_at(const Scene& scene, ShapeId shape);
  // Of all textures on one face; false if there are too many.
  bool add_face(const std::vector<const Texture*>& textures, const Mesh& mesh, FaceId face,
                OfShape& result);

  std::vector<OfShape> shapes_;  // none without textures
  std::vector<ShapeId> with_meridian_;
  size_t count_ = 0;
  ShapeId first_without_ = ShapeId::none();
};

// InputError if there are more than TextureDiscontinuities::kMost segments. Adds one warning that
// names the shapes with such a meridian.
void check_texture_edges(const Scene& scene, std::vector<std::string>& warnings);

// As Texture::add_discontinuities. Where texture coordinates are not linear over the face (spheres,
// disks) lines are curves: segments lie off them by about kOffCurve at most, but around the axis.
// The meridian where an angle comes back to its beginning is not found.
bool add_face_discontinuities(const Texture& texture, const Mesh& mesh, FaceId face, size_t most,
                              Texture::Discontinuities& lines);

// In barycentric coordinates.
inline constexpr double kOffCurve = 0x1p-9;

}  // namespace limn
