#pragma once
// Motion of edges as seen from p. Rigid motion, scaling and shear of an object have velocities
// linear in position, and so has the motion of directions at p. So one linear map per query and
// object describes all its edges, and nodes store none of it. The residual of an object's motion is
// stored in nodes as a speed in any direction.
#include "edgetree/simd.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// Velocities times EdgeSamplerInput::lane_scale, per lane.
Vec3<Lanes> scaled_velocity(const Vec3<Lanes>& v, const Lanes& lane_scale);
// Sum of the lanes' speeds.
double sum_of_speeds(const Vec3<Lanes>& v);

// v(x) = at_center + linear (x - center), scaled by lane_scale.
struct ObjectMotion {
  Vec3d center{};
  Vec3<Lanes> at_center{};
  Vec3<Lanes> linear[3]{};  // [column]

  Vec3<Lanes> velocity(const Vec3d& x) const {
    const Vec3d d = x - center;
    return at_center + linear[0] * d.x + linear[1] * d.y + linear[2] * d.z;
  }
};

// Least-squares map over the vertices; static without tangents, or if the residual is
// large.
ObjectMotion motion_of(const EdgeMesh& mesh, const Lanes& lane_scale);

// Motion of p and of the directions there, shared by all objects of a query.
struct ViewerMotion {
  // unit: ForestQuery::unit.
  ViewerMotion(const EdgeQuery& query, const Lanes& lane_scale, double unit);
  Vec3d p;
  double inverse_unit;
  Vec3<Lanes> velocity;   // of p, scaled
  Vec3<Lanes> linear[3];  // of directions: as in ObjectMotion, per 1 / unit
};

// Velocity of an object relative to p and the directions there, in the lanes where it is not
// zero.
struct SeenMotion {
  // u(w) = size (at_p + linear w unit), w = x - p.
  struct Lane {
    float size;  // a power of two that normalises the rest to below 2
    float at_p[3];
    float linear[3][3];  // [row][column]
    float column2[3];    // squared lengths of the columns
  };
  int count = 0;
  Lane lanes[kLanes];

  SeenMotion() = default;
  SeenMotion(const ObjectMotion& object, const ViewerMotion& viewer);
};

}  // namespace limn
