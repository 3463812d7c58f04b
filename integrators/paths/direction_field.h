#pragma once
// Directions that move with the parameters: at the first vertex of a path a sampled direction w may
// move, dw/dtheta = V(w). The substitution changes no integral over directions, so the change that
// it makes to the interior term,
//   a_V = (f L)' along V + f L div V,
// and the change that it makes to the boundary terms, whose edges now move with v - |w| V instead
// of v, have means that cancel. So any V gives the same mean, and that with the least variance may
// be chosen, from other samples than those it is used for. A V that follows an object as it is seen
// from the vertex takes its sliding hit points and its silhouettes out together.
//
// V has three numbers, `turn`:
//   - directions turn, V = turn x w, div V = 0; or,
//   - where p sees one moving object from outside, they follow points of a plane that lies across
//     the unit vector a towards it: with e the velocity of these over their distance along a,
//     V = (a . w) (e - w (e . w)),   div V = a . e - 3 (a . w) (e . w).
//     A plane through the circle where p sees a sphere's silhouette follows all of that, however
//     wide it is; a turn follows its middle alone.
// What emitters emit, seen from the vertex, is left out: those directions are held. They are the
// regions of light (light_regions.h), whose edges have terms of their own; so nothing that follows
// an object moves the outlines of emitters.
//
// The score without radiance, f' along V + f div V over the density of w, has mean zero as well,
// because f vanishes at the horizon: any multiple of it may be added.
#include <algorithm>
#include <vector>

#include "limn/core/scene.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// Of a pixel, per parameter, in the unit of MotionRates.
struct DirectionField {
  Vec3<Lanes> turn{};   // how sampled directions move
  Vec3<Lanes> score{};  // the same of the score that is added
};

// The unit direction w as it moves.
inline Vec3<Dual> turning(const Vec3d& w, const DirectionTurn& turn) {
  Vec3<Lanes> v = turn.velocity(w);
  if (turn.follows()) {
    const Lanes along = v.x * w.x + v.y * w.y + v.z * w.z;
    v = v - Vec3<Lanes>{along * w.x, along * w.y, along * w.z};
  }
  return {{w.x, v.x}, {w.y, v.y}, {w.z, v.z}};
}
// div V at the unit direction w.
inline Lanes divergence(const Vec3d& w, const DirectionTurn& turn) {
  const auto along = [&](const Vec3d& v) {
    return turn.rate.x * v.x + turn.rate.y * v.y + turn.rate.z * v.z;
  };
  return along(turn.axis) - along(w) * (3 * dot(turn.axis, w));
}

struct DirectionWarp;

// The same at one vertex [1 / unit of the parameter].
struct DirectionMotion {
  DirectionTurn turn, score;
  bool scoring = false;  // whether the score is not zero
  double unit = 0;       // MotionRates::at the vertex
  // Of one direction, in place of the turn: see warp_field.h.
  const DirectionWarp* warp = nullptr;
};

// How fast what moves does so as seen from a point: the unit of all turns. One for all parameters,
// which turn directions at multiples of it: what a turn changes in a sample is then the same for
// all of them.
class MotionRates {
 public:
  // scene: with its parameters seeded in the first `lanes` lanes. steps: what makes speeds of the
  // parameters comparable.
  MotionRates(const Scene& scene, int lanes, const Lanes& steps);

  // Angular velocity at p [1 / unit of the first parameter], summed over the parameters with their
  // steps; at least a bound's order of magnitude.
  double at(const Vec3d& p) const;
  // The same as the camera sees it at p, if what it sees is so far away.
  double in_view(const Vec3d& p, double distance) const;
  DirectionMotion motion_at(const Vec3d& p, const DirectionField& field) const;
  // g . dx/dt of a point x as directions at p carry it, over each number of a field's turn. to: the
  // way from p to x.
  Vec3d per_turn(const Vec3d& p, const Vec3d& to, const Vec3d& g) const;
  // How fast a vertex moves in units of what moves by itself: where a path meets a surface at a
  // grazing angle, it slides faster than any object.
  double sliding(const Vec3<Lanes>& velocity) const;
  // How much an edge seen from p, which moves so, may add against one seen from a point p0 at rest.
  double splitting(const Vec3d& p, const Vec3<Lanes>& velocity, const Vec3d& p0) const;
  // Nothing moves: turning would only add noise.
  bool still() const { return sources_.empty(); }
  bool moves_camera() const {
    return std::any_of(sources_.begin(), sources_.end(),
                       [](const Source& source) { return source.is_camera; });
  }

 private:
  struct Source {
    Vec3d center;
    double radius;    // at least; > 0
    double speed;     // root mean square over the object's vertices, or of the camera
    double rotation;  // of the camera [1 / unit of the parameter]
    bool is_camera;
    double rate_from(double distance) const;
  };
  // share: the lane's step in those of the first.
  void add_object(const Scene& scene, int lane, double share);
  void add_camera(const Scene& scene, int lane, double share);
  // Towards the one object that moves; zero where p is near it, or something else moves.
  Vec3d axis_at(const Vec3d& p) const;

  std::vector<Source> sources_;
  Lanes shares_;      // steps of the parameters in those of the first; 0 of those that are not
  double speed_ = 0;  // sum over sources
};

}  // namespace limn
