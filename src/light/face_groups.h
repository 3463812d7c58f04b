#pragma once
// Draws faces of an emitter for a point, mostly by what they send there.
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "limn/core/discrete_distribution.h"
#include "limn/core/light.h"
#include "limn/core/mesh.h"
#include "src/base/wide.h"

namespace limn {

// Faces form up to eight groups by place and normal, these likewise, and so on: a wide tree. A draw
// descends by the irradiance that groups are estimated to send, unoccluded, to a surface that faces
// them; the last group's faces are drawn by area. Faces of one plane are one group: a flat emitter
// is drawn by area.
class FaceGroups {
 public:
  FaceGroups(const Mesh& mesh, DrawFaces draw);

  struct Drawn {
    FaceId face;
    double density;  // of its points [1 / area]
  };
  // For p, by u in [0, 1): of neighbouring u mostly neighbouring faces.
  Drawn draw(const Vec3d& p, double u) const;
  // The density of points of this face in `draw` [1 / area]; positive.
  double density(const Vec3d& p, FaceId face) const;

 private:
  // Where a group is: the part of a node.
  struct Place {
    uint32_t node = UINT32_MAX;
    uint32_t part = 0;
  };
  // Groups that are parts of one. Unused parts have no share.
  struct Node {
    wide::Vec center;      // of area
    wide::Vec normal;      // mean over area
    wide::Doubles share;   // of area
    wide::Doubles spread;  // area / pi; keeps the estimate finite close to the group
    wide::Doubles bend;    // a third of the variance of normals; 0 if it is flat
    wide::Doubles extent;  // the same of places
    Place place;
    int32_t parts[wide::kWidth];  // nodes; of leaves the complement
  };
  // Faces order_[first] to order_[last - 1].
  struct Leaf {
    uint32_t first, last;
    double below, share;  // of the area: that of faces before `first`, its own
    double density;       // 1 / its area
    Place place;
  };
  struct Face;   // of the mesh, while groups are made
  struct Group;  // of those
  static Group group_of(std::span<const Face> faces);
  static std::vector<std::span<Face>> parts_of(std::span<Face> faces, const Group& whole);
  int32_t add(std::span<Face> faces, const Group& group, Place place, int depth);
  wide::Doubles probabilities(const Node& node, const Vec3d& p) const;

  DiscreteDistribution areas_;  // of the faces in order
  double inverse_area_ = 0;     // of the emitter
  std::vector<Node> nodes_;     // empty: one group
  // The next are empty with one group.
  std::vector<Leaf> leaves_;
  std::vector<uint32_t> order_;    // faces with an area, leaf by leaf
  std::vector<uint32_t> leaf_of_;  // of a face; unspecified without an area
};

}  // namespace limn
