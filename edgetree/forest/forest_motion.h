#pragma once
// How edges move as seen from p. Points of an object that is moved, turned, scaled or sheared have
// velocities linear in their position, and so has what directions that turn at p take off: one map
// per query and object then holds how all its edges move, and nodes store nothing of it. What is
// not linear in an object's motion nodes keep as a speed, which counts in every direction.
#include "edgetree/simd.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// Velocities times EdgeSamplerInput::lane_scale, per lane.
Vec3<Lanes> scaled_velocity(const Vec3<Lanes>& v, const Lanes& lane_scale);
// Sum of the lanes' speeds.
double sum_of_speeds(const Vec3<Lanes>& v);

// v(x) = at_center + linear (x - center), scaled.
struct ObjectMotion {
  Vec3d center{};
  Vec3<Lanes> at_center{};
  Vec3<Lanes> linear[3]{};  // [column]

  Vec3<Lanes> velocity(const Vec3d& x) const {
    const Vec3d d = x - center;
    return at_center + linear[0] * d.x + linear[1] * d.y + linear[2] * d.z;
  }
};

// The map of least squares over the vertices; at rest where there are no tangents, and where the
// map leaves much of the motion.
ObjectMotion motion_of(const EdgeMesh& mesh, const Lanes& lane_scale);

// How p moves, and the directions there: what all objects of a query share.
struct ViewerMotion {
  // unit: ForestQuery::unit.
  ViewerMotion(const EdgeQuery& query, const Lanes& lane_scale, double unit);
  Vec3d p;
  double inverse_unit;
  Vec3<Lanes> velocity;   // of p, scaled
  Vec3<Lanes> linear[3];  // of directions: as of ObjectMotion, per 1 / unit
};

// An object's velocity relative to p and to directions that turn there, in the lanes where there is
// any.
struct SeenMotion {
  // u(w) = size (at_p + linear w unit), w = x - p.
  struct Lane {
    float size;  // a power of two: the rest is less than 2
    float at_p[3];
    float linear[3][3];  // [row][column]
    float column2[3];    // squared lengths of its columns
  };
  int count = 0;
  Lane lanes[kLanes];

  SeenMotion() = default;
  SeenMotion(const ObjectMotion& object, const ViewerMotion& viewer);
};

}  // namespace limn
