#pragma once
// Poses of shapes, lights and cameras as matrices, and those that a scene was read with.
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "limn/core/matrix.h"
#include "limn/core/scene.h"

namespace limn::python {

struct FirstPlaces {
  struct ShapePlace {
    SharedVector<Vec3f> positions;
    SharedVector<Vec3d> normals;
  };
  std::vector<ShapePlace> shapes;
  std::vector<Vec3d> lights;  // positions of delta lights; zero of those at infinity
  Matrix4 environment;        // of a map: its axes, world space
};

// What is known of a scene since it was read.
struct History {
  // How far translations have moved [scene units], by name.
  std::map<std::string, double> moved;
  std::shared_ptr<const FirstPlaces> first;
  // Of shapes, by their numbers: what to_world was set to, and where that put the vertices.
  struct Placed {
    Matrix4 to_world;
    SharedVector<Vec3f> positions;
  };
  std::map<size_t, Placed> placed;
  bool sensor_chosen = false;  // by view()

  explicit History(const Scene& scene);
  // Of a shape that has another mesh, which is where it was read.
  void forget(const Scene& scene, size_t shape);
};

// Whether the name is ID.to_world of something that can be placed: a shape (also by its emitter's
// id), a delta light, an environment map or "sensor".
bool names_place(const Scene& scene, const std::string& name);

// Of a name that names_place takes: the camera's pose; of all others the transform that a file
// would have for where they are, as Mitsuba's parameter of this name (spheres: with center and
// radius). Of shapes deformed by no affine map, the file's.
Matrix4 to_world(const Scene& scene, const History& history, const std::string& name);

// Places what the name says, in place of the file's transform. Shapes deformed by no affine map
// keep their deformation. Normals are those that the file gives.
// InputError, with the scene unchanged, for matrices that are not affine and invertible or
// mirror; for spots and projectors that are scaled unevenly or sheared; for environment maps
// that turn about another axis than y; and for shapes that move while a shutter is open.
void place(Scene& scene, History& history, const std::string& name, const Matrix4& to_world,
           std::vector<std::string>* warnings);

}  // namespace limn::python
