#pragma once
// How shapes and cameras move while a shutter is open. Samples of an image have times, uniform
// between the shutter's opening and its closing.
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "limn/core/dual.h"
#include "limn/core/matrix.h"
#include "limn/core/scene.h"

namespace limn {

struct CoincidentFaces;  // face_overlaps.h
struct KeptShapes;       // embree_tracer.cpp
struct Parameter;        // parameter.h

struct Keyframe {
  double time = 0;
  Vec3d place;       // of the object's origin, world space
  Matrix4 rotation;  // of the object since the first keyframe
  double scale = 1;  // the same
  Vec3d turn = {};   // a rotation vector: from here to the next keyframe, the short way
};

// The motion of a shape or a camera: by keyframes (place and scale are linear in time between two,
// rotations turn at a constant rate, and all is constant before the first and after the last), and
// by a velocity and a spin about the center, which displace nothing at the exposure's reference
// time.
struct Course {
  std::vector<Keyframe> keyframes;  // in order; none: still
  Vec3d center;                     // at the reference time, world space
  Vec3<Dual> velocity;              // scene units per unit of time
  Vec3<Dual> spin;                  // radians per unit of time, world axes
  Vec3<Lanes> shift;                // derivatives of the place of the whole course

  bool moves() const;
  void translate(const Vec3d& by);
  // From the first keyframe to a time.
  Matrix4 since_first(double time) const;
};

struct Shutter {
  Dual open = 0, close = 0;
};

struct Exposure {
  double reference = 0;           // the middle of the first sensor's shutter, as in the file
  std::vector<Shutter> shutters;  // of each sensor
  std::vector<Course> cameras;    // of each sensor
  std::vector<Course> shapes;     // of each shape
  // Empty if the scene is known to have no coincident faces; else null.
  std::shared_ptr<const CoincidentFaces> no_overlaps;
  // The geometry of still shapes, which ray tracers of several times share; null: each has its own.
  std::shared_ptr<KeptShapes> kept_shapes;
};

// Whether images of the scene are means over times: something moves while the sensor's shutter is
// open.
bool is_moving(const Scene& scene);
// Whether derivatives with respect to the parameters are means over times: the scene is moving, or
// a parameter makes it move, as the velocity of a shape at rest does.
bool needs_times(const Scene& scene, std::span<const Parameter> parameters);
// InputError if they are: `what` cannot take it.
void check_still(const Scene& scene, const std::string& what,
                 std::span<const Parameter> parameters = {});

// The scene as it is at a time, the fraction u of the way from opening to closing, with the
// derivatives that its exposure, vertices and camera have been seeded with. It shares BSDFs,
// textures and lights with the scene.
Scene at_time(const Scene& scene, double u);
// As at_time(), in place. The scene must be at the reference time.
void set_time(Scene& scene, double u);
// Whether no face of a moving shape touches or crosses one of another shape, or is so near to one
// that a ray from the camera, in floats, might not tell them apart. moving: a flag for each shape.
bool is_apart(const Scene& scene, const std::vector<bool>& moving);
// For a scene at several times: at_time() and tracers share from now on what they find of shapes
// that stand still. Tests whether faces coincide: if none do, the test is skipped at times at which
// moving shapes are clear of all others. The scene must outlive this knowledge, at its address.
void share_between_times(Scene& scene, int threads);
std::shared_ptr<KeptShapes> make_kept_shapes();
// The matrix from the derivative with respect to a shape's vertex at the time u to that with
// respect to the vertex at the reference time.
Matrix4 pulls_back(const Scene& scene, ShapeId shape, double u);

// To be changed: no other scene shares it afterwards. The scene must have an exposure.
Exposure& own_exposure(Scene& scene);

}  // namespace limn
