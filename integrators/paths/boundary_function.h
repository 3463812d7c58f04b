#pragma once
// The boundary function B of warped-area sampling: zero where a point p sees an edge of E(p), on
// the faces that the edge belongs to, and positive elsewhere. By it the field of warped directions
// knows edges that it does not sample.
#include <array>
#include <cstdint>
#include <vector>

#include "limn/core/scene.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// Whether an edge moves as all faces do that it belongs to, and is on the border of these. Lines
// where surfaces cross do not, nor do edges of several surfaces that touch, in general: no field
// that is made of what surfaces do goes over into their velocity. (Edges of textures are inside.)
inline bool is_followed(const Edge& edge) {
  return edge.edge_class != EdgeClass::kIntersection && edge.edge_class != EdgeClass::kIrregular &&
         edge.edge_class != EdgeClass::kTexture;
}
// Takes them out of the mesh's edges; what is left is numbered anew.
void leave_out_followed(EdgeMesh& mesh);

// On a face B is linear between its vertices: 0 at a vertex that touches an edge of E(p), elsewhere
// the least |sine| between the view of the vertex and the planes of the faces around it. Where this
// is 0 at all three (an emitter of two triangles, needles) it would vanish on the whole face, and
// no number of rays would make the field right: there it is the least barycentric height over the
// face's own edges in E(p), or 1 without any. So B vanishes on curves only.
//
// Edges that run through the inside of a face are none of the face's, nor are those that fields do
// not follow.
class BoundaryFunction {
 public:
  // scene: whose faces B is of. edges: of the scene's shapes in their order, then others. Both must
  // outlive this.
  BoundaryFunction(const Scene& scene, const EdgeSamplerInput& edges);

  // B at a point of a face, by its barycentric coordinates there, as seen from p; in [0, 1].
  double at(const Vec3d& p, FaceRef face, const std::array<double, 3>& place) const;

 private:
  // What a vertex touches, whatever p is.
  enum Touch : uint8_t {
    kNothing,  // but smooth edges: in E(p) where p is on different sides of its faces
    kSharp,    // a sharp edge of a closed mesh: in E(p) where p sees a face of it
    kAlways,   // an edge that is in E(p) for every p
  };
  // An edge along the side of a face that is opposite to a corner.
  struct Side {
    EdgeRef edge;
    int corner;
  };
  struct ShapeSides {
    std::vector<Touch> touches;                 // V, of welded vertices
    std::vector<uint32_t> face_offsets, faces;  // around welded vertices: V + 1, and faces
    std::vector<uint32_t> side_offsets;         // F + 1
    std::vector<Side> sides;                    // of faces
  };

  void list_faces(ShapeId shape);
  void list_sides();
  // Notes that an edge lies along the side of a face that is opposite to a corner.
  void touch(const EdgeMesh& object, const Edge& edge, FaceRef face, int corner);
  double at_vertex(const Vec3d& p, ShapeId shape, uint32_t vertex) const;

  const Scene& scene_;
  const EdgeSamplerInput& edges_;
  std::vector<ShapeSides> shapes_;
};

}  // namespace limn
