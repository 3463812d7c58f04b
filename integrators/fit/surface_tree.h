#pragma once
// A tree of boxes over the faces of one mesh, for distances and winding numbers. (Embree's tree
// answers in single precision, and stops at the first hit.)
#include <vector>

#include "limn/core/bounds.h"
#include "limn/core/mesh.h"

namespace limn {

class SurfaceTree {
 public:
  // The mesh must outlive this. InputError if it has no face with an area.
  explicit SurfaceTree(const Mesh& mesh);

  struct Nearest {
    double distance = 0;  // scene units
    FaceId face;
    Vec3d point;
  };
  Nearest nearest(const Vec3d& p) const;

  // Faces that the ray leaves through (from behind) less those that it enters; faces that hold
  // `origin` must be named by `skip`.
  int crossings(const Vec3d& origin, const Vec3d& direction, FaceId skip) const;

  // Faces with an area, in an order of its own.
  const std::vector<uint32_t>& faces() const { return faces_; }

 private:
  struct Node {
    Bounds bounds;
    uint32_t first = 0, count = 0;  // faces of a leaf; count 0: children first and first + 1
  };
  void build(uint32_t node, uint32_t first, uint32_t count);

  const Mesh& mesh_;
  std::vector<uint32_t> faces_;
  std::vector<Node> nodes_;
};

// Corners of a face in double precision.
std::array<Vec3d, 3> corners_of(const Mesh& mesh, uint32_t face);

}  // namespace limn
