#pragma once
// The edges of a tree while it is built.
#include <span>
#include <vector>

#include "edgetree/bounds/forest_fit.h"
#include "edgetree/bounds/split_tree.h"
#include "limn/core/bounds.h"

namespace limn {

// Edges of a mesh, or what stands for trees. Of the edges it keeps what their mesh does not: with
// whole wedges (152 bytes) it would hold a sixth of the memory that a set-up takes.
class WedgeList {
 public:
  explicit WedgeList(const EdgeMesh& mesh) : mesh_(&mesh) {}
  explicit WedgeList(std::vector<Wedge> stand_ins) : stand_ins_(std::move(stand_ins)) {}

  void reserve(size_t n) { edges_.reserve(n); }
  void add(EdgeId edge);
  EdgeId edge(size_t i) const { return edges_[i].edge; }
  void set_speed(size_t i, double speed) { edges_[i].speed = speed; }
  // Moves wedge order[i] to place i.
  void put_in_order(std::vector<uint32_t> order);

  size_t size() const { return mesh_ ? edges_.size() : stand_ins_.size(); }
  Wedge operator[](size_t i) const;
  std::array<Vec3d, 2> ends(size_t i) const;
  Bounds bounds(EdgeRange range) const;
  Bounds bounds() const { return bounds({0, static_cast<uint32_t>(size())}); }

 private:
  struct Kept {
    double length, angle, speed;
    EdgeId edge;
  };
  const EdgeMesh* mesh_ = nullptr;
  std::vector<Kept> edges_;
  std::vector<Wedge> stand_ins_;
};

// Whole wedges of a part of a list.
class WedgeWindow {
 public:
  explicit WedgeWindow(const WedgeList& list) : list_(list) {}
  // Valid until a range is asked for that is not inside of this one.
  std::span<const Wedge> wedges(EdgeRange range);

 private:
  const WedgeList& list_;
  EdgeRange range_;
  std::vector<Wedge> wedges_;
};

}  // namespace limn
