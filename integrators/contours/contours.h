#pragma once
// All contours that a point sees, with the change of the number of faces behind each: what is
// needed to know where the sky is open without tracing a ray there (after Nowrouzezahrai, Baran,
// Mitchell, Jarosz 2014, section 3.1).
//
// W(w) is the number of faces that the ray from p in direction w meets. Every face has one sign as
// seen from p: +1 from the front, -1 from behind, 0 where its plane passes through p to rounding
// and where p lies on it; what has no sign counts as not being there. The border of a face is a
// closed loop, so the sum of all borders, each times its face's sign, is one, too: whatever was
// rounded, and whatever the faces are, W is the same on every way around.
#include <memory>
#include <span>
#include <vector>

#include "limn/core/face_tree.h"
#include "limn/core/ray_tracer.h"
#include "limn/core/surface_point.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// A point on a face, or lifted from one with interpolated normals, that looks around.
struct ContourPoint {
  Vec3d p;
  Vec3d up;      // unit normal to the side that looks: of the face, or the shading normal if lifted
  FaceRef face;  // that it lies on, if any
};

// A side that W changes across, as seen from p: by `change` on the side s . w > 0, s = w0 x w1,
// against the other.
struct ContourArc {
  Vec3d w0, w1;  // its ends minus p
  int change;
};

// Faces of a scene that a polygon cuts: what lies before a flat emitter ends at its plane.
struct ContourScreen {
  Plane plane;        // of the polygon, positive before it
  double margin = 0;  // what is nearer to the plane does not count
  // Where faces pass through the polygon: the side that closes what is left of them.
  struct Cut {
    Vec3d x0, x1;
    FaceRef face;
  };
  std::vector<Cut> cuts;

  double height(const Vec3d& x) const { return plane.distance(x) - margin; }
};

class Contours {
 public:
  // The scene and its tracer must outlive it.
  Contours(const Scene& scene, const RayTracer& tracer, int threads);

  // The point on the plane of its own face, as near as numbers allow, or lifted from it.
  ContourPoint at(const SurfacePoint<double>& surface, const Vec3d& up) const;
  // What rounding may add to distances of the point from planes of a shape, and to those of the
  // shape's corners from the plane of the point's face.
  double rounding(const ContourPoint& at, ShapeId shape) const;
  // Appends all contours of the point that reach into the cone and above the horizon, and some
  // that do not. screen: of what lies before it alone.
  void list(const ContourPoint& at, const DirectionCone& cone, const ContourScreen* screen,
            std::vector<ContourArc>& arcs) const;
  // W in a direction of any length: exactly what the contours say, relative to another direction.
  int count(const ContourPoint& at, const Vec3d& direction, const ContourScreen* screen) const;

  // What passes through a polygon. corners: of a convex one, counter-clockwise seen from before it.
  ContourScreen make_screen(const Plane& plane, double margin,
                            std::span<const Vec3d> corners) const;

 private:
  int sign(FaceRef face, const ContourPoint& at) const;
  int change_of(EdgeRef id, const ContourPoint& at) const;

  const Scene& scene_;
  const RayTracer& tracer_;
  EdgeSamplerInput input_;
  std::unique_ptr<EdgeSampler> sampler_;
  FaceTree tree_;
  double extent_ = 0;  // largest of all objects
};

// On which side of the plane through p and an edge from x0 to x1 a direction lies: 1 or -1, and the
// opposite for the edge from x1 to x0, whatever was rounded.
int side_of_edge(const Vec3d& x0, const Vec3d& x1, const Vec3d& p, const Vec3d& direction);

}  // namespace limn
