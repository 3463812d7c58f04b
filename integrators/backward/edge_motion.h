#pragma once
// What the motion of a point of an edge makes of the vertices that the edge hangs on.
#include "limn/core/slots.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

class EdgeMotion {
 public:
  EdgeMotion(const SceneSlots& slots, const EdgeSamplerInput& input)
      : slots_(slots), input_(input) {}

  // Whether vertices that the edge hangs on have slots.
  bool moves(EdgeRef id) const;
  // g: the derivative of something with respect to the position of an end of the edge, or of its
  // point at t, which adds to the tape's contributions.
  void contribute_end(Tape& tape, EdgeRef id, int end, const Vec3d& g) const;
  void contribute_point(Tape& tape, EdgeRef id, double t, const Vec3d& g) const {
    contribute_end(tape, id, 0, g * (1 - t));
    contribute_end(tape, id, 1, g * t);
  }

 private:
  bool is_crossing(EdgeRef id) const { return !input_.object(id.object).shape.valid(); }
  void contribute_crossing(Tape& tape, EdgeRef id, const Vec3d& x, const Vec3d& g) const;
  void contribute_vertex(Tape& tape, ShapeId shape, uint32_t vertex, const Vec3d& g) const;

  const SceneSlots& slots_;
  const EdgeSamplerInput& input_;
};

}  // namespace limn
