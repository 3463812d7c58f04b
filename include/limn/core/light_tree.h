#pragma once
// Chooses one of many emitters at a point, in about the logarithm of their number: a binary tree of
// neighbouring emitters, descended by what the two halves may send to the point (Conty Estevez and
// Kulla 2018; a node is estimated as if it were one emitter).
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "limn/core/vec.h"

namespace limn {

class LightTree {
 public:
  // One emitter or several, as the estimate needs them.
  struct Emitter {
    Vec3d center;       // of the light that it sends out
    Vec3d facing;       // sum of face normals times areas times luminance
    double rest = 0;    // a quarter of areas times luminance that cancel in `facing`
    double spread = 0;  // area / pi, and squares of distances from the center: means by light
    double light = 0;   // area times luminance
    double radius = 0;  // within which the centers of several lie
  };

  LightTree() = default;
  explicit LightTree(std::span<const Emitter> emitters);

  size_t size() const { return places_.size(); }
  bool empty() const { return places_.empty(); }

  // About the irradiance at p on a surface that faces all of them, unoccluded [W / m^2, luminance].
  double irradiance(const Vec3d& p) const { return empty() ? 0 : sent_to(nodes_[0], p); }
  // The emitter at u in [0, 1): of neighbouring u neighbouring ones.
  size_t choose(const Vec3d& p, double u) const;
  // How likely it is chosen. Zero where it shines away from p, also by mistake: who needs all that
  // may shine must choose otherwise now and then.
  double probability(const Vec3d& p, size_t emitter) const;

 private:
  // Nodes stand in preorder: the first child of node i is i + 1. `count` emitters below halve into
  // count / 2 and the others.
  struct Node : Emitter {
    double most = 0;  // length of `facing`
  };
  uint32_t build(std::span<const Emitter> emitters, size_t first, size_t count);
  size_t second_child(size_t node, size_t count) const { return node + 2 * (count / 2); }
  double share_of_first(size_t node, size_t count, const Vec3d& p) const;
  static Node united(const Node& a, const Node& b);
  static double sent_to(const Node& node, const Vec3d& p);

  std::vector<Node> nodes_;
  std::vector<uint32_t> order_;   // emitters from left to right
  std::vector<uint32_t> places_;  // of each emitter in the order
};

}  // namespace limn
