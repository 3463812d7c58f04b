#pragma once
// A tree over all faces of a scene, to list those that reach into a convex set.
#include <span>
#include <vector>

#include "limn/core/scene.h"

namespace limn {

// The half-space n . x + offset >= 0.
struct HalfSpace {
  Vec3d n;
  double offset = 0;
};

class FaceTree {
 public:
  // Faces without area are left out. It keeps nothing of the scene.
  explicit FaceTree(const Scene& scene);

  struct Item {
    FaceRef face;
    std::array<Vec3f, 3> corners;
    // Indices of the items beyond its sides, from corner k to the next: none unless just one other
    // item has the side, the other way round.
    std::array<uint32_t, 3> neighbours;
  };
  static constexpr uint32_t kNone = UINT32_MAX;
  size_t size() const { return items_.size(); }
  size_t index_of(const Item& item) const { return static_cast<size_t>(&item - items_.data()); }
  // Appends every face with a point in all of the half-spaces, and some without: those that no
  // single half-space leaves out. The order depends on the scene alone.
  void list(std::span<const HalfSpace> set, std::vector<const Item*>& faces) const;

 private:
  struct Node {
    Vec3d center, half;     // of its box
    uint32_t first, count;  // of its items; 0: it has two children, the next node and `first`
  };
  uint32_t build(uint32_t first, uint32_t last);
  void find_neighbours();

  std::vector<Item> items_;
  std::vector<Node> nodes_;
};

}  // namespace limn
