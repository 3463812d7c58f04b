#pragma once
// The adjoint of computed shading normals and horizons, precomputed for many gradients of one mesh.
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

  // Equals pull_back_shading_normals(). Skips zero derivatives, so the cost is linear in the
  // nonzero ones.
  void pull_back(std::vector<Vec3d>& normals, const std::vector<double>& horizons,
                 std::vector<Vec3d>& positions) const;

 private:
  struct OfMesh;
  std::unique_ptr<const OfMesh> of_mesh_;
};

}  // namespace limn
