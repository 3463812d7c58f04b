#pragma once
// A bounding volume hierarchy over all faces that lists those intersecting a convex set.
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
  // Degenerate faces are skipped. The tree keeps no reference to the scene.
  explicit FaceTree(const Scene& scene);

  struct Item {
    FaceRef face;
    std::array<Vec3f, 3> corners;
    // Indices of the items across its sides (side k goes from corner k to the next). kNone unless
    // exactly one other item shares the side, with consistent winding, and find_neighbours() was
    // called.
    std::array<uint32_t, 3> neighbours;
  };
  static constexpr uint32_t kNone = UINT32_MAX;
  size_t size() const { return items_.size(); }
  size_t index_of(const Item& item) const { return static_cast<size_t>(&item - items_.data()); }
  // Appends all faces that intersect the set, conservatively: every face that is not entirely
  // outside of one half-space. The order depends on the scene alone.
  void list(std::span<const HalfSpace> set, std::vector<const Item*>& faces) const;
  void find_neighbours();

 private:
  struct Node {
    Vec3d center, half;     // bounding box
    uint32_t first, count;  // range of items; count 0: the children are the next node and `first`
  };
  uint32_t build(uint32_t first, uint32_t last);

  std::vector<Item> items_;
  std::vector<Node> nodes_;
};

}  // namespace limn
