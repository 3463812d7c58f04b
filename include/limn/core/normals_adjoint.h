#pragma once
// The adjoint of computed shading normals, precomputed for many gradients of one mesh.
#include <memory>
#include <vector>

#include "limn/core/mesh.h"

namespace limn {

class ShadingNormalsAdjoint {
 public:
  // Precomputes what depends on the mesh alone; costs about one update_shading_normals(). The mesh
  // must outlive this object and must not change.
  explicit ShadingNormalsAdjoint(const Mesh& mesh);
  ShadingNormalsAdjoint(ShadingNormalsAdjoint&&) noexcept;
  ~ShadingNormalsAdjoint();

  // Adds to `positions` (V) the derivatives of a scalar with respect to positions, at the first
  // copy of each welded vertex, from those with respect to normals (N). Normals of a file or of
  // faces add nothing. Skips zero derivatives, so the cost is linear in the nonzero ones.
  void pull_back(const std::vector<Vec3d>& normals, std::vector<Vec3d>& positions) const;

 private:
  struct OfMesh;
  std::unique_ptr<const OfMesh> of_mesh_;
};

}  // namespace limn
