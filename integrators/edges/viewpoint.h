#pragma once
// A place from which edges are listed once, and the faces that are seen edge-on from there: the
// camera's pinhole, an orthographic camera (at infinity) or a delta light.
#include <unordered_map>
#include <vector>

#include "limn/core/light.h"
#include "limn/core/scene.h"
#include "limn/edgetree/edges.h"

namespace limn {

// The sine of the angle at which a face counts as seen edge-on: within it rays in floats may not
// tell its borders apart.
inline constexpr double kEdgeOn = 0x1p-18;

// Both borders of a face in whose plane the viewpoint lies are one line, and which of them is seen
// no ray can tell: a step aside shows one of them, or the face between them. So there the image has
// a kink. Edges of such faces are looked at from a little aside, the same way for all, if it can be
// on that side where the faces are seen from behind, so that their own bodies hide them. What comes
// of it is the derivative as it is on that side (so are edges that lie behind others in one line,
// film_lines.h): where the edges are and how fast they move is as
// seen from the viewpoint itself.
class Viewpoint {
 public:
  Viewpoint(const Scene& scene, const LightOrigin& origin);
  // One of many, of which almost none sees a face edge-on: the center of a lens.
  explicit Viewpoint(const Vec3d& center) : origin_{{center.x, center.y, center.z}}, aside_{} {}

  // How many flat-shaded faces are seen edge-on, and whose is the first of them. (In the plane of
  // some face of a finely tessellated smooth surface a viewpoint lies by chance, and the kink is as
  // small as the face.)
  size_t flat_faces() const { return flat_faces_; }
  ShapeId first_shape() const { return first_shape_; }
  // Whether a parameter moves the viewpoint and the plane of one of them past each other.
  bool crosses_planes() const { return crosses_planes_; }
  bool sees_edge_on(const FacesAround& around) const;
  // The viewpoint, or, if a face around the edge is seen edge-on, that aside of it: by 2^-12 of the
  // distance of y, a point of the edge; at infinity by 2^-12 rad.
  LightOrigin seeing(const FacesAround& around, const Vec3d& y) const;
  // That aside of it, for y.
  LightOrigin aside(const Vec3d& y) const;
  // Where light is looked for from y, a point beside an edge, and where shadows of y are cast from,
  // if the edge is that of no face seen edge-on: as little aside as floats can tell, by 2^-15 of
  // the distance. So wherever a shadow ends along an edge of what it falls on, all terms have it
  // end on the same side.
  LightOrigin hardly_aside(const Vec3d& y) const;
  // The unit direction in which light from there arrives at y, turned around.
  Vec3d towards(const Vec3d& y) const;
  // limn::is_candidate; faces seen edge-on are turned as they are from aside.
  bool is_candidate(const EdgeMesh& mesh, EdgeId edge) const;

 private:
  bool is_edge_on(FaceRef face) const {
    return edge_on_count_ > 0 && face.shape.valid() && !edge_on_[face.shape.index()].empty() &&
           edge_on_[face.shape.index()][face.face.index()];
  }
  Facing facing(const EdgeMesh& mesh, FaceId face) const;
  LightOrigin aside(const Vec3d& y, double by) const;

  LightOrigin origin_;
  Vec3d aside_;                             // unit
  std::vector<std::vector<bool>> edge_on_;  // by shape: of each face; empty if none of them is
  size_t edge_on_count_ = 0, flat_faces_ = 0;
  bool crosses_planes_ = false;
  ShapeId first_shape_;
};

// Of all places from which edges of a scene are listed.
struct Viewpoints {
  explicit Viewpoints(const Scene& scene);

  const Viewpoint& of(const DeltaLight& light) const { return lights[numbers.at(&light)]; }
  // Whether any of them does.
  bool cross_planes() const;

  Viewpoint camera;
  std::vector<Viewpoint> lights;  // delta lights, in the order of the scene
  std::unordered_map<const DeltaLight*, size_t> numbers;
};

// One for the camera and one for each delta light that see flat-shaded faces edge-on.
void warn_of_faces_edge_on(const Scene& scene, const Viewpoints& viewpoints,
                           std::vector<std::string>& warnings);

}  // namespace limn
