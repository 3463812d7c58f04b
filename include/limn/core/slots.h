#pragma once
// Slots: indices into the gradient for the scene's differentiable numbers, and how Var values
// depend on them. Tape::slots() refers to those of the current scene.
#include <array>
#include <memory>
#include <vector>

#include "limn/core/scene.h"
#include "limn/core/var.h"

namespace limn {

// The first slots of a mesh's numbers; 0 if they are constant. Welded vertices share the slots of
// the first copy, `weld`.
struct MeshSlots {
  uint32_t positions = 0;   // of 3 V
  uint32_t normals = 0;     // of 3 N
  uint32_t directions = 0;  // of 3 u_directions
};

// A slot for each channel, since channels never mix. A number that affects all channels has the
// same slot three times. 0: constant.
using ChannelSlots = std::array<uint32_t, 3>;

// Copies of an object for differentiation: lane k of a copy carries the derivative with respect to
// the parameter with the k-th slots, all channels of a colour at once. Objects with more parameters
// than lanes need several copies.
template <class T>
struct SeededCopy {
  std::shared_ptr<T> object;
  std::array<ChannelSlots, kLanes> slots{};
};
template <class T>
using SeededCopies = std::vector<SeededCopy<T>>;

// The camera's origin, left, up, forward (three each), fov, aperture_radius, focus_distance.
inline constexpr uint32_t kCameraSlots = 15;

struct SceneSlots {
  const Scene* scene = nullptr;        // must outlive this object
  uint32_t count = 1;                  // number of slots, including the unused slot 0
  std::vector<MeshSlots> meshes;       // of each shape
  std::vector<ChannelSlots> radiance;  // of each shape's emitter
  // BSDF copies of each shape's back and front; null if constant.
  std::vector<std::array<const SeededCopies<Bsdf>*, 2>> bsdfs;
  std::vector<std::unique_ptr<SeededCopies<Bsdf>>> bsdf_copies;  // owns the copies of `bsdfs`
  SeededCopies<Environment> environment;
  std::vector<std::pair<const DeltaLight*, SeededCopies<DeltaLight>>> lights;
  uint32_t camera = 0;  // the first of kCameraSlots
  // Maps of which texels have slots, and the first of those (row-major order).
  std::vector<std::pair<const TexelMap*, uint32_t>> texels;

  const MeshSlots& mesh(ShapeId shape) const { return meshes[shape.index()]; }
  // The first slot of the map's texels; 0 if they are constants.
  uint32_t of(const TexelMap* map) const {
    for (const auto& [other, first] : texels)
      if (other == map) return first;
    return 0;
  }
  const SeededCopies<DeltaLight>* of(const DeltaLight& light) const {
    for (const auto& [other, copies] : lights)
      if (other == &light) return &copies;
    return nullptr;
  }
};

namespace detail {

inline Vec3<Dual> held(const Vec3<Var>& v) { return {v.x.v, v.y.v, v.z.v}; }
// `v` with derivatives along the three axes in the first three lanes.
inline Vec3<Dual> along_axes(const Vec3<Var>& v) {
  return {{v.x.v, {1, 0, 0, 0}}, {v.y.v, {0, 1, 0, 0}}, {v.z.v, {0, 0, 1, 0}}};
}
inline Vec3<Var> leaves(const Vec3d& v, uint32_t slot) {
  Tape& tape = *Tape::current();
  return {Var{v.x, tape.leaf(slot)}, Var{v.y, tape.leaf(slot + 1)}, Var{v.z, tape.leaf(slot + 2)}};
}

// Records a three-component function (colour or vector) as one statement per component, with
// partial derivatives from Duals.
class Jacobian {
 public:
  static constexpr int kMost = 128;  // limit on inputs

  void add(uint32_t node, double a, double b, double c) {
    if (node != 0) inputs_[count_++] = {node, {a, b, c}};
  }
  // f: evaluated with x moving along the axes.
  void add(const Vec3<Var>& x, const Rgb<Dual>& f) {
    for (int k = 0; k < 3; ++k) add(x[k].node, f.r.d[k], f.g.d[k], f.b.d[k]);
  }
  // f: evaluated on the seeded copy, with all else constant. leaves: tape nodes of its slots.
  void add(const std::array<ChannelSlots, kLanes>& leaves, const Rgb<Dual>& f) {
    for (int k = 0; k < kLanes; ++k) {
      const ChannelSlots& node = leaves[k];
      if (node[0] == node[1] && node[1] == node[2]) {
        add(node[0], f.r.d[k], f.g.d[k], f.b.d[k]);
        continue;
      }
      for (int c = 0; c < 3; ++c) {
        add(node[c], c == 0 ? f.r.d[k] : 0, c == 1 ? f.g.d[k] : 0, c == 2 ? f.b.d[k] : 0);
      }
    }
  }
  Rgb<Var> result(const Rgb<double>& value) const {
    Rgb<Var> r{value.r, value.g, value.b};
    if (count_ == 0) return r;
    Tape& tape = *Tape::current();
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < count_; ++i) tape.entry(inputs_[i].node, inputs_[i].d[c]);
      r[c].node = tape.end();
    }
    return r;
  }

 private:
  struct Input {
    uint32_t node;
    std::array<double, 3> d;
  };
  std::array<Input, kMost> inputs_;
  int count_ = 0;
};

inline ChannelSlots leaves_of(const ChannelSlots& slots) {
  Tape& tape = *Tape::current();
  const uint32_t first = tape.leaf(slots[0]);
  if (slots[1] == slots[0] && slots[2] == slots[0]) return {first, first, first};
  return {first, tape.leaf(slots[1]), tape.leaf(slots[2])};
}
inline std::array<ChannelSlots, kLanes> leaves_of(const std::array<ChannelSlots, kLanes>& slots) {
  std::array<ChannelSlots, kLanes> nodes;
  for (int k = 0; k < kLanes; ++k) nodes[k] = leaves_of(slots[k]);
  return nodes;
}

// Emitted radiance of a shape.
template <class S>
Rgb<S> emitter_radiance(const Shape& shape, ShapeId /*id*/) {
  return as<S>(shape.radiance);
}
template <>
inline Rgb<Var> emitter_radiance<Var>(const Shape& shape, ShapeId id) {
  const ChannelSlots nodes = leaves_of(Tape::current()->slots()->radiance[id.index()]);
  const Rgb<double> c = value(shape.radiance);
  return {Var{c.r, nodes[0]}, Var{c.g, nodes[1]}, Var{c.b, nodes[2]}};
}

// Emitted radiance of a textured shape at the barycentric coordinates b, see SurfacePoint.
template <class S>
Rgb<S> textured_radiance(const Shape& shape, FaceId face, const std::array<S, 2>& b) {
  return shape.radiance_texture->eval(texture_point<S>(shape.mesh, face, b));
}
template <>
Rgb<Var> textured_radiance<Var>(const Shape& shape, FaceId face, const std::array<Var, 2>& b);

}  // namespace detail

}  // namespace limn
