#pragma once
// What the generated meshes are put together from.
#include <functional>
#include <utility>
#include <vector>

#include "tools/generate/generate.h"

namespace limn {

void append(Triangles& mesh, const Triangles& part);
void add_quad(Triangles& mesh, uint32_t a, uint32_t b, uint32_t c, uint32_t d);

// The mesh make(h) whose number of faces is nearest to `faces`, over edge lengths h; the count must
// go roughly as 1 / h^2. first_h: where the search starts.
Triangles with_faces(int faces, double first_h, const std::function<Triangles(double h)>& make);

// Whether every side of a face is the reverse of exactly one other: the mesh is closed and
// oriented.
bool every_side_is_paired(const Triangles& mesh);

// A circle around `axis` (any length) of a surface that is swept along a path; radius 0: a point.
struct Ring {
  Vec3d center;
  Vec3d axis;
  double radius;
};

// The surface through the rings, in the direction of their axes, without twist. Open paths must
// begin and end with a point.
Triangles sweep(const std::vector<Ring>& rings, int sides);
// The path returns to its first ring: a torus.
Triangles closed_sweep(const std::vector<Ring>& rings, int sides);

// Round-ended tube along a path, position(t) for t in [0, 1], of radius(t); edges are about h long
// around it, and up to `stretch` h along it.
struct Tube {
  std::function<Vec3d(double)> position;
  std::function<double(double)> radius;
  double stretch = 1;
};
Triangles tube(const Tube& tube, double h);
// A straight tube of one radius.
Triangles rod(const Vec3d& from, const Vec3d& to, double radius, double h);

// A surface of revolution around the y axis: (r, y) from the lowest point (0, y) to the highest, a
// polyline whose corners stay; edges are about h long.
Triangles lathe(const std::vector<std::pair<double, double>>& profile, double h);
// The same with the corners rounded off, as a spline of the points, and any number of sides.
Triangles smooth_lathe(const std::vector<std::pair<double, double>>& profile, double h, int sides);
Triangles ellipsoid(const Vec3d& center, const Vec3d& radii, double h);
Triangles torus(const Vec3d& center, const Vec3d& axis, double radius, double tube_radius,
                double h);

Triangles moved(Triangles mesh, const Vec3d& offset);
// The mesh turned counter-clockwise about +y, radians.
Triangles turned(Triangles mesh, double angle);
Vec3d turned(const Vec3d& p, double angle);

// A point of the Catmull-Rom spline through the points, t in [0, 1].
Vec3d spline(const std::vector<Vec3d>& points, double t);
double arc_length(const std::function<Vec3d(double)>& position);

// Value noise: random numbers at the points of the integer lattice, smooth in between, in [-1, 1].
double noise(const Vec3d& p);

// As many steps as `h` fits into `length`, but at least `fewest`.
int steps(double length, double h, int fewest);

// An open blade or leaf: point(s, v), s in [0, 1] along it in `rows` steps and v in [-1, 1] across
// it in `columns`; its ends are points, at v = 0.
Triangles blade(int rows, int columns, const std::function<Vec3d(double s, double v)>& point);

}  // namespace limn
