#pragma once
// What the motion of a boundary sample's points makes of what they hang on.
#include <vector>

#include "integrators/terms/boundary_sample.h"
#include "integrators/terms/light_frames.h"
#include "limn/core/slots.h"

namespace limn {

// Weights on nodes of the tape, and the sweep.
class Seeds {
 public:
  void add(uint32_t node, double weight) {
    if (node != 0) nodes_.push_back({node, weight});
  }
  void add(const Vec3<Var>& v, const Vec3d& weight) {
    for (int k = 0; k < 3; ++k) add(v[k].node, weight[k]);
  }
  bool empty() const { return nodes_.empty(); }
  void sweep(Tape& tape) const {
    tape.start();
    for (const Node& seed : nodes_) tape.adjoint(seed.node) += seed.weight;
    tape.sweep();
  }

 private:
  struct Node {
    uint32_t node;
    double weight;
  };
  std::vector<Node> nodes_;
};

class EdgeMotion {
 public:
  // input: which edges boundary samples are of; null where there are none.
  EdgeMotion(const SceneSlots& slots, const EdgeSamplerInput* input)
      : slots_(slots), input_(input) {}

  const SceneSlots& slots() const { return slots_; }
  const Scene& scene() const { return *slots_.scene; }
  // Whether anything that the points of the form hang on has slots.
  bool moves(const BoundaryForm& form) const;
  // Adds weight * g_i to each: vertices to the tape's contributions, lights to the seeds.
  void contribute(Tape& tape, Seeds& seeds, const BoundaryForm& form, double weight) const;

 private:
  bool is_crossing(EdgeRef id) const { return !input_->object(id.object).shape.valid(); }
  ShapeId shape_of(EdgeRef id) const { return input_->object(id.object).shape; }
  const FramedLight* frame(EdgeRef id) const { return light_of_frame(scene(), *input_, id.object); }
  bool moves(ShapeId shape) const { return slots_.mesh(shape).positions != 0; }
  bool moves(EdgeRef id) const;
  bool moves(const MovingPoint& point) const;
  // g: the derivative with respect to the position of an end of the edge.
  void contribute_end(Tape& tape, EdgeRef id, int end, const Vec3d& g) const;
  // As contribute_end, for both ends of a side of a light's frame (framed_light.h).
  void contribute_frame(Seeds& seeds, const MovingPoint& point, const Vec3d& g) const;
  void contribute_crossing(Tape& tape, EdgeRef id, const Vec3d& x, const Vec3d& g) const;
  void contribute_face(Tape& tape, FaceRef face, const Vec3d& x, const Vec3d& g) const;
  void contribute_lift(Tape& tape, const MovingLift& lift, double weight) const;
  void contribute_vertex(Tape& tape, ShapeId shape, uint32_t vertex, const Vec3d& g) const;

  const SceneSlots& slots_;
  const EdgeSamplerInput* input_;
};

}  // namespace limn
