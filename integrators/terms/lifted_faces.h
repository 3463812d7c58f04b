#pragma once
// Where lines of light meet the points that faces with interpolated normals are lifted to
// (limn/core/surface_point.h).
#include <cstdint>
#include <span>
#include <vector>

#include "limn/core/box_tree.h"
#include "limn/core/scene.h"

namespace limn {

// The line from a light through a point y of an edge, on behind it: y + s w.
struct ShadowLine {
  Vec3d y, w;
  Vec3d along;    // the edge
  Vec3d w0;       // w at its first end
  bool infinite;  // w is the same all along the edge
};

struct LiftedCrossing {
  FaceRef face;
  double side;    // 1: of what x is lifted to as it is seen from outside; -1: from inside
  Vec3d x;        // on the face
  Vec3d p;        // on the line: what x is lifted to
  double s;       // of p on the line
  double m;       // |dx/dt| over the slope of G at x (shadow_boundary.cpp)
  double cosine;  // between the shading normal on that side and the way to the light
};

class LiftedFaces {
 public:
  explicit LiftedFaces(const Scene& scene);
  LiftedFaces(const LiftedFaces&) = delete;
  LiftedFaces& operator=(const LiftedFaces&) = delete;

  bool empty() const { return faces_.empty(); }
  // Whether points of the face are lifted by more than rounding: crossings are of such faces.
  bool has(FaceRef face) const {
    const auto& raised = raised_[face.shape.index()];
    return !raised.empty() && raised[face.face.index()];
  }
  // Sets `found` to all crossings with 0 < s <= s_max.
  void cross(const ShadowLine& line, double s_max, std::vector<LiftedCrossing>& found) const;

 private:
  struct Face {
    FaceRef face;
    double side;
  };

  const Scene& scene_;
  std::vector<std::vector<bool>> raised_;  // of shapes, of their faces
  std::vector<Face> faces_;
  std::vector<FloatBox> boxes_;  // of what each holds
  BoxTree tree_;
};

// The segment from (t0, k0) to (t1, k1), t0 < t1.
struct Stretch {
  double t0, t1, k0, k1;
  uint32_t label;

  double at(double t) const { return k0 + (k1 - k0) * ((t - t0) / (t1 - t0)); }
};

// The parts of segments that lie above all others, ascending and disjoint; where two coincide, the
// lower label wins. Takes time n log n for n segments.
std::vector<Stretch> upper_envelope(std::span<const Stretch> segments);

}  // namespace limn
