#pragma once
// From names of parameters to slots of a gradient, and back: which numbers of the scene have a
// slot, and how the parameters' derivatives follow from those of the slots.
#include <optional>
#include <utility>
#include <vector>

#include "integrators/terms/camera_edges.h"
#include "limn/core/matrix.h"
#include "limn/core/normals_adjoint.h"
#include "limn/core/parameter.h"
#include "limn/core/scene.h"
#include "limn/core/slots.h"
#include "limn/integrators/backward.h"

namespace limn {

// Those that the options ask for. InputError for unknown ones.
std::vector<Parameter> reverse_parameters(const Scene& scene, const BackwardOptions& options);

class ParameterSlots {
 public:
  // time: of the shutter, see at_time(); none: the reference time. InputError for parameters that
  // reverse mode cannot take.
  ParameterSlots(const Scene& scene, std::vector<Parameter> parameters,
                 const std::optional<double>& time = {});
  ParameterSlots(const ParameterSlots&) = delete;
  ParameterSlots& operator=(const ParameterSlots&) = delete;

  const std::vector<Parameter>& parameters() const { return parameters_; }
  // A copy of the scene, at the time. The vertices of shapes that move have unit tangents in the
  // first three lanes: nothing is known of their motion.
  const Scene& scene() const { return scene_; }
  const SceneSlots& slots() const { return slots_; }
  const FreeMotion& free() const { return free_; }
  // How many numbers each parameter has.
  std::vector<size_t> sizes() const;
  // By which magnitudes of different slots compare: the scene's size for a length, else 1.
  double unit(uint32_t slot) const { return units_[slot]; }

  // More slots, from the one returned on, that no parameter has.
  uint32_t take(uint32_t count, double unit = 1);

  // sums: by slot. The derivatives of each parameter's numbers.
  std::vector<std::vector<double>> gather(const std::vector<double>& sums) const;

 private:
  // How a number depends on slots of values: of BSDFs, lights, the camera.
  struct Weight {
    uint32_t slot;
    double weight;
    size_t number;  // of the parameter, that it adds to
  };
  // What a parameter moves.
  struct Dependence {
    ShapeId shape;                       // none: values alone
    std::vector<Vec3d> velocity;         // V, by a scalar at the time; empty without times
    std::vector<Vec3d> normal_velocity;  // N, of normals of the file; empty if they stay
    std::vector<Vec3d> directions;       // V, of displacements
    std::vector<Weight> weights;
    const TexelMap* texels = nullptr;                         // of scene(): the map that it moves
    std::vector<std::pair<uint32_t, double>> texel_velocity;  // of a scalar: of those it moves
  };
  // What takes the slots of a shape to its vertices.
  struct ShapeGather {
    std::vector<size_t> parameters;  // that move the shape
    std::vector<uint32_t> copies;    // of each vertex that is the first of its copies
    std::optional<ShadingNormalsAdjoint> normals;
    // Takes derivatives with respect to vertices at the time to those at the reference time; none
    // without times.
    std::optional<Matrix4> back;
  };
  class Values;

  std::vector<Vec3d> velocities_now(const Scene& scene, const Parameter& parameter,
                                    uint32_t shape) const;
  void add_shapes(const Scene& scene);
  std::vector<uint32_t> take_values(const Scene& scene);
  void add_values(const Scene& scene);
  void add_texels();
  Dependence dependence_of(const Scene& scene, const Parameter& parameter) const;
  void gather_shape(ShapeId shape, const std::vector<double>& sums,
                    std::vector<std::vector<double>>& values) const;

  std::vector<Parameter> parameters_;
  std::optional<double> time_;
  std::vector<Dependence> dependences_;  // of each
  Scene scene_;
  double size_;  // of the scene
  SceneSlots slots_;
  FreeMotion free_;
  std::vector<float> units_{1};       // of each slot
  std::vector<ShapeGather> gathers_;  // of each shape
};

}  // namespace limn
