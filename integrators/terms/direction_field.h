#pragma once
// Directions that move with the parameters: at the first vertex of a path a sampled direction w may
// turn, dw/dtheta = V(w) = turn x w. The substitution changes no integral over directions, so the
// change that it makes to the interior term,
//   a_V = (f L)' along V,     (div V = 0: nothing stretches)
// and the change that it makes to the boundary terms, whose edges now move with v - |w| V instead
// of v, have means that cancel. So any turn gives the same mean, and that with the least variance
// may be chosen, from other samples than those it is used for. A turn that follows an object as it
// is seen from the vertex takes its sliding hit points and its silhouettes out together.
//
// The score without radiance, f' along V over the density of w, has mean zero as well, because f
// vanishes at the horizon: any multiple of it may be added.
#include <vector>

#include "limn/core/scene.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// Of a pixel, per parameter, in the unit of MotionRates.
struct DirectionField {
  Vec3<Lanes> turn{};   // of the sampled directions
  Vec3<Lanes> score{};  // of the directions of the score that is added
};

// The direction w as it moves, see motion_of_directions.
inline Vec3<Dual> turning(const Vec3d& w, const Vec3<Lanes>& turn, const Vec3d& axis) {
  Vec3<Lanes> v = motion_of_directions(turn, axis, w);
  const Lanes out = v.x * w.x + v.y * w.y + v.z * w.z;  // 0, but for rounding, where they turn
  v = v - Vec3<Lanes>{out * w.x, out * w.y, out * w.z};
  return {{w.x, v.x}, {w.y, v.y}, {w.z, v.z}};
}

// The same at one vertex: angular velocities [1 / unit of the parameter].
struct DirectionMotion {
  Vec3<Lanes> turn{}, score{};
  bool scoring = false;  // whether the score is not zero
  double unit = 0;       // MotionRates::at the vertex
  Vec3d axis{};

  // The direction w with its derivative.
  Vec3<Dual> moving(const Vec3d& w) const { return turning(w, turn, axis); }
  Vec3<Dual> moving_score(const Vec3d& w) const { return turning(w, score, axis); }
  // Of the field with the rate `turn` or `score`, over the sphere: 0 where directions turn, else that
  // of (axis . w) (rate - w (rate . w)).
  Lanes divergence(const Vec3<Lanes>& rate, const Vec3d& w) const {
    const auto dot_lanes = [](const Vec3<Lanes>& a, const Vec3d& b) {
      return a.x * b.x + a.y * b.y + a.z * b.z;
    };
    return dot_lanes(rate, axis) - dot_lanes(rate, w) * (3 * dot(axis, w));
  }
  bool diverges() const { return !(axis == Vec3d{}); }
};

// How fast what moves does so as seen from a point: the unit of all turns. One for all parameters,
// which turn directions at multiples of it: what a turn changes in a sample is then the same for all
// of them.
class MotionRates {
 public:
  // scene: with its parameters seeded in the first `lanes` lanes. steps: what makes speeds of the
  // parameters comparable.
  MotionRates(const Scene& scene, int lanes, const Lanes& steps);

  // Angular velocity at p [1 / unit of the first parameter], summed over the parameters with their
  // steps; at least a bound's order of magnitude.
  double at(const Vec3d& p) const;
  DirectionMotion motion_at(const Vec3d& p, const DirectionField& field) const;
  // Towards the one object that moves; zero where p is near it, or something else moves.
  Vec3d axis_at(const Vec3d& p) const;
  // Nothing moves: turning would only add noise.
  bool still() const { return sources_.empty(); }

 private:
  struct Source {
    Vec3d center;
    double radius;    // at least; > 0
    double speed;     // root mean square over the object's vertices, or of the camera
    double rotation;  // of the camera [1 / unit of the parameter]
    bool is_camera;
  };
  // share: the lane's step in those of the first.
  void add_object(const Scene& scene, int lane, double share);
  void add_camera(const Scene& scene, int lane, double share);

  std::vector<Source> sources_;
};

}  // namespace limn
