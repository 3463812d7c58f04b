#pragma once
// Strongly typed indices of shapes, faces, edges and vertices. They convert neither into one
// another nor to or from integers implicitly.
#include <compare>
#include <cstdint>

namespace limn {

// An index from 0, or none.
template <class Tag>
class Id {
 public:
  constexpr Id() = default;  // none
  constexpr explicit Id(uint32_t index) : index_(index) {}
  static constexpr Id none() { return {}; }

  constexpr bool valid() const { return index_ != UINT32_MAX; }
  constexpr uint32_t index() const { return index_; }
  friend constexpr auto operator<=>(Id, Id) = default;  // none comes last

 private:
  uint32_t index_ = UINT32_MAX;
};

using ShapeId = Id<struct ShapeTag>;    // in Scene::shapes
using FaceId = Id<struct FaceTag>;      // in Mesh::faces
using VertexId = Id<struct VertexTag>;  // in Mesh::positions
using EdgeId = Id<struct EdgeTag>;      // in EdgeMesh::edges

}  // namespace limn
