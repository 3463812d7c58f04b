// Checks the invariants of a forest against the edges it was built over.
#include "support/forest_fault.h"

#include <cmath>

#include "limn/core/bounds.h"

namespace limn {
namespace {

struct Fault {
  std::string text;
};

// Traverses the trees; throws the first Fault.
class Walk {
 public:
  Walk(const Forest& forest, std::span<const EdgeMesh> objects)
      : forest_(forest),
        objects_(objects),
        inner_seen_(forest.inner.size()),
        edges_seen_(forest.edges.size()) {}

  void all() {
    require(forest_.slots.size() == objects_.size(), "there are slots for other objects");
    for (size_t o = 0; o < objects_.size(); ++o)
      require(forest_.slots[o].size() == objects_[o].edges.size(),
              "there are slots for other edges");
    for (const NodeId root : forest_.roots) {
      require_node(root);
      require(forest_.head(root).parent == kNoParent, "a root has a parent");
      visit(root);
    }
    for (const bool seen : inner_seen_) require(seen, "no root leads to an inner node");
    for (const bool seen : edges_seen_) require(seen, "no root leads to a node of edges");
    for (uint32_t o = 0; o < objects_.size(); ++o)
      for (uint32_t e = 0; e < objects_[o].edges.size(); ++e) require_slot({ShapeId(o), EdgeId(e)});
  }

 private:
  static void require(bool holds, const char* fault) {
    if (!holds) throw Fault{fault};
  }

  void require_node(NodeId id) const {
    const size_t index = id < 0 ? ~id : id;
    require(index < (id < 0 ? edges_seen_ : inner_seen_).size(), "a node is out of range");
  }

  // An edge is in the child that its slot names, or in none if it is concave and culled.
  void require_slot(EdgeRef id) const {
    const uint32_t slot = forest_.slot(id);
    if (slot == kNoParent) {
      const EdgeMesh& mesh = objects_[id.object.index()];
      const Edge& edge = mesh.edge(id.edge);
      require(edge.concave && edge.edge_class == EdgeClass::kSmooth && mesh.one_sided_closed,
              "an edge that may be a silhouette is in no node");
      return;
    }
    require(slot / kWidth < forest_.edges.size(), "a slot is out of range");
    const EdgeNode& node = forest_.edges[slot / kWidth];
    require(node.edge_at(slot % kWidth) == id, "a slot does not lead to its edge");
  }

  // Returns the bounds of all edges below.
  Bounds visit(NodeId id) {
    std::vector<bool>& seen = id < 0 ? edges_seen_ : inner_seen_;
    require(!seen[id < 0 ? ~id : id], "two ways lead to a node");
    seen[id < 0 ? ~id : id] = true;
    const NodeHead& head = forest_.head(id);
    require(head.object.index() < objects_.size(), "an object is out of range");
    require(head.inverse_radius > 0 && std::isfinite(head.inverse_radius),
            "a node's radius is not positive");
    return id < 0 ? visit_edges(~id) : visit_children(id);
  }

  Bounds visit_edges(uint32_t index) const {
    const EdgeNode& node = forest_.edges[index];
    require(node.head.height == 0, "a node of edges is not at height 0");
    Bounds bounds;
    bool any = false;
    for (int lane = 0; lane < kWidth; ++lane) {
      if (node.edge[lane] == kNoChild) {
        require(node.length[lane] == 0, "a lane without an edge has a length");
        continue;
      }
      any = true;
      require_edge(node, lane, kWidth * index + lane);
      for (const auto& end : node.ends) bounds.extend({end[0][lane], end[1][lane], end[2][lane]});
    }
    require(any, "a node has no edges");
    return bounds;
  }

  void require_edge(const EdgeNode& node, int lane, uint32_t slot) const {
    const EdgeMesh& mesh = objects_[node.head.object.index()];
    const EdgeRef id = node.edge_at(lane);
    require(id.edge.index() < mesh.edges.size(), "an edge is out of range");
    require(forest_.slot(id) == slot, "an edge is in two lanes");
    require(node.length[lane] > 0, "an edge has no length");
    require(node.speed[lane] >= 0, "a speed is negative");
    require_rows(node.rows, lane);
    for (int e = 0; e < 2; ++e)
      for (int k = 0; k < 3; ++k)
        require(node.ends[e][k][lane] ==
                    static_cast<float>(mesh.position(mesh.edge(id.edge).vertices[e])[k]),
                "an end is not the mesh's");
  }

  // Row lengths sum to 1, as the rounding bound of queries requires.
  template <class Rows>
  static void require_rows(const Rows& rows, int lane) {
    double sum = 0;
    for (const auto& row : rows) {
      double squares = 0;
      for (int k = 0; k < 4; ++k) squares += double{row[k][lane]} * row[k][lane];
      sum += std::sqrt(squares);
    }
    // Each entry was rounded to float once.
    require(std::fabs(sum - 1) <= 0x1.0p-23, "the rows of a dual box are not of unit length");
  }

  Bounds visit_children(uint32_t index) {
    const InnerNode& node = forest_.inner[index];
    Bounds bounds;
    int highest = -1;
    for (int lane = 0; lane < kWidth; ++lane) {
      const NodeId child = node.child[lane];
      if (child == kNoChild) {
        require((node.ahead >> lane & 1) == 0, "a lane without a child is looked into");
        continue;
      }
      require_node(child);
      const NodeHead& head = forest_.head(child);
      require(head.parent == kWidth * index + lane, "a child has another parent");
      // Nodes above several trees have no group that rejects, and no motion.
      const bool is_above = node.head.group == ForestGroup::kAlways && node.head.motion == 0;
      require(is_above || (head.object == node.head.object && head.group == node.head.group),
              "a child is of another tree");
      highest = std::max<int>(highest, head.height);
      require(node.speed[lane] >= 0, "a speed is negative");
      for (const Floats& cover : node.cover) require(cover[lane] >= 0, "a cover is negative");
      require_rows(node.rows, lane);
      const Bounds below = visit(child);
      require_box(node, lane, below);
      bounds.extend(below.lower);
      bounds.extend(below.upper);
    }
    require(highest >= 0, "an inner node has no children");
    require(node.head.height == std::min(highest + 1, 255), "a height is not its children's");
    return bounds;
  }

  // A child's box holds all edges below and is at least a step wide, as queries divide by its size.
  static void require_box(const InnerNode& node, int lane, const Bounds& below) {
    for (int k = 0; k < 3; ++k) {
      const int low = node.low[lane] >> (k * kBoxBits) & kBoxSteps;
      const int high = node.high[lane] >> (k * kBoxBits) & kBoxSteps;
      require(low < high, "a child's box is empty");
      const auto in_frame = [&](double x) {
        return ((x - node.head.center[k]) * node.head.inverse_radius + 1) * 0.5 * kBoxSteps;
      };
      constexpr double rounding = kBoxSteps * 0x1.0p-50;  // of in_frame
      require(
          in_frame(below.lower[k]) >= low - rounding && in_frame(below.upper[k]) <= high + rounding,
          "a child's box does not hold its edges");
      // Sides are rounded outward to whole steps.
      constexpr double step = 1 + 0x1.0p-10;
      require(in_frame(below.lower[k]) - low <= step && high - in_frame(below.upper[k]) <= step,
              "a child's box is wider than its edges");
    }
  }

  const Forest& forest_;
  std::span<const EdgeMesh> objects_;
  std::vector<bool> inner_seen_, edges_seen_;
};

}  // namespace

std::string fault_of(const Forest& forest, std::span<const EdgeMesh> objects) {
  try {
    Walk(forest, objects).all();
  } catch (const Fault& fault) {
    return fault.text;
  }
  return {};
}

}  // namespace limn
