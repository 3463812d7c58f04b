#pragma once
// A boundary sample. An edge moves against the rays of a viewer (a vertex of a path, or the
// camera), and the radiance changes across it. The sample adds
//   amount * rate,   rate = scale * sum_i g_i . (v(X_i) - v_ray)
// to the derivative: amount (rgb) is the radiance difference times what carries it to the sensor,
// v(X_i) are velocities of points of the scene, and v_ray is that of the point x as the viewer's
// ray carries it along. The rate is linear in velocities. So one record serves all modes: forward
// mode puts velocities in, reverse mode hands amount * scale * g_i on to what moves the points, and
// a pilot evaluates what other motions of the viewer would add. A term draws, tests visibility and
// hands the record to a sink; it does not know the mode.
#include <array>
#include <optional>

#include "integrators/edges/flat_mirrors.h"
#include "integrators/estimates/sample_estimator.h"
#include "integrators/paths/camera_path.h"
#include "limn/core/light.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

struct MovingPoint {
  enum class Of { kEdge, kFace, kLight };
  Of of;
  const EdgeMesh* mesh;  // kEdge: the point at t of an edge of this mesh
  EdgeRef edge;
  double t;
  FaceRef face;             // kFace: where a ray meets this face, at `x`
  const DeltaLight* light;  // kLight: its position, or at infinity its direction
  Vec3d g;
  Vec3d x = {};
};

// What the point that x is lifted to (surface_point.h) hangs on besides x.
struct MovingLift {
  FaceRef face;
  std::array<Vec3d, 3> of_corners, of_normals;
};

// How a camera's path turns: directions at its first vertex, here, may (direction_field.h).
struct FirstTurn {
  Vec3d vertex, to;  // and the way to the point x that the vertex sees
  Vec3d g;           // the rate has g . velocity of x as they carry it
};

struct BoundaryForm {
  Vec3d x;              // on the viewer's ray
  double distance = 0;  // of x from the viewer
  double scale = 1;
  bool held = false;  // the ray's direction does not turn with those of the path
  std::array<MovingPoint, 5> points;
  int count = 0;
  std::optional<MovingLift> lift;
  // The viewer sees x by way of these: `distance` is that of x from its image in them. leaves: in
  // this unit direction, from a vertex.
  MirrorFaces by;
  Vec3d leaves = {};
  std::optional<FirstTurn> turned;  // of samples of the film

  void add_edge(const EdgeMesh& mesh, EdgeRef edge, double t, const Vec3d& g) {
    points[count++] = {MovingPoint::Of::kEdge, &mesh, edge, t, {}, nullptr, g};
  }
  void add_light(const DeltaLight& light, const Vec3d& g) {
    points[count++] = {MovingPoint::Of::kLight, nullptr, {}, 0, {}, &light, g};
  }
  // Adds g . v of the point x where the ray of unit direction omega meets a face, or of what x is
  // lifted to: the face moves x across its plane, the ray carries it along. Returns |cos| between
  // omega and the face's normal.
  double add_seen_point(const Scene& scene, FaceRef face, const Vec3d& omega, const Vec3d& g);
  std::span<const MovingPoint> all() const { return {points.data(), static_cast<size_t>(count)}; }
  // The vertex, the first of a path, sees x in directions that turn. Before the camera's view of it
  // is added.
  void turn_at(const Vec3d& vertex, const Vec3d& to) { turned = {vertex, to - vertex, of_ray()}; }
  // What v_ray has: minus the sum of g. Normals, and the direction of a light at infinity, are no
  // points.
  Vec3d of_ray() const;
};

// The barycentric coordinates of a point of a face.
std::array<double, 3> barycentric(const std::array<Vec3d, 3>& corners, const Vec3d& x);

class BoundarySink {
 public:
  explicit BoundarySink(SampleLog* log = nullptr) : log_(log) {}
  virtual ~BoundarySink() = default;

  // Where samples book what they cost and what becomes of them.
  TermCost& cost() const { return *cost_; }
  void book_on(TermCost& cost) { cost_ = &cost; }
  SampleLog* log() const { return log_; }  // null unless somebody reads it

  // Takes up a sample, before its rays are traced; the form must outlive it. False if nothing that
  // counts moves it. key: of the sample.
  virtual bool takes(const BoundaryForm& form, const Rng& key) = 0;
  // Russian roulette for the sample. scattered: throughput times scattering.
  virtual bool survives(const Rgb<double>& /*scattered*/, const Rng& /*key*/) { return true; }
  // Reports what its rays found; amount: zero if it is occluded.
  virtual void traced(const Rgb<double>& /*scattered*/, const RayCount& /*rays*/,
                      const Rgb<double>& /*amount*/) {}
  // Adds amount times the rate of the sample taken up.
  virtual void add(const Rgb<double>& amount) = 0;

 private:
  TermCost* cost_ = nullptr;
  SampleLog* log_;
};

struct ClipSegment;

// A point of a line on the film across which radiance changes.
struct FilmLineSample {
  double nx, ny;                      // unit normal of the line
  Lanes speed;                        // of the line along it [pixels]
  double density;                     // [1 / pixel of length]
  const ClipSegment* clip = nullptr;  // the line is the cut of a clip plane; null: an edge
  const EdgeMesh* mesh = nullptr;
  EdgeRef edge = {};
  double t = 0;  // on the edge, or the segment
  MirrorFaces by = {};
  Vec3d g = {};  // where panes refract it: its speed per velocity of the edge's point
};

// A sink of samples of the film: v_ray is that of the camera's ray through a fixed film position.
class FilmSink : public BoundarySink {
 public:
  // The film position of the sample, before all else. False if no pixel needs it.
  virtual bool at(const FilmPlace& place) = 0;
  virtual void add_line(const FilmLineSample& line, const Rgb<double>& difference) = 0;
};

}  // namespace limn
