#pragma once
// The adjoint of computed shading normals and horizons, for many gradients of one mesh.
#include <memory>
#include <vector>

#include "limn/core/mesh.h"

namespace limn {

class ShadingNormalsAdjoint {
 public:
  // What depends on the mesh alone, about as much work as update_shading_normals(). The mesh must
  // outlive this, and stay as it is.
  explicit ShadingNormalsAdjoint(const Mesh& mesh);
  ShadingNormalsAdjoint(ShadingNormalsAdjoint&&) noexcept;
  ~ShadingNormalsAdjoint();

  // As pull_back_shading_normals(). The work goes with the numbers that are not zero, but for one
  // look at each.
  void pull_back(std::vector<Vec3d>& normals, const std::vector<double>& horizons,
                 std::vector<Vec3d>& positions) const;

 private:
  struct OfMesh;
  std::unique_ptr<const OfMesh> of_mesh_;
};

}  // namespace limn
