// The boundary function of warped-area sampling.
#include "integrators/paths/boundary_function.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "limn/core/scene.h"
#include "limn/core/shading.h"

namespace limn {
namespace {

// The corner of a face that is opposite to the side along which the segment from a to b lies: the
// one whose barycentric coordinate is least there.
int opposite_corner(const std::array<Vec3d, 3>& corners, const Vec3d& a, const Vec3d& b) {
  const Vec3d n = cross(corners[1] - corners[0], corners[2] - corners[0]);
  int least = 0;
  double height = 0;
  for (int k = 0; k < 3; ++k) {
    const Vec3d &from = corners[(k + 1) % 3], &to = corners[(k + 2) % 3];
    const auto over = [&](const Vec3d& x) { return std::fabs(dot(cross(to - from, x - from), n)); };
    const double both = std::max(over(a), over(b));
    if (k == 0 || both < height) {
      least = k;
      height = both;
    }
  }
  return least;
}

// Counts before each place, from counts.
void accumulate(std::vector<uint32_t>& offsets) {
  uint32_t sum = 0;
  for (uint32_t& offset : offsets) {
    const uint32_t count = offset;
    offset = sum;
    sum += count;
  }
}

// `values` holds a run [offsets[e], offsets[e + 1]) for each edge e, or nothing. Keeps the runs of
// the edges in `kept`.
template <class T>
void keep_runs(const std::vector<size_t>& kept, const std::vector<uint32_t>& offsets,
               std::vector<T>& values) {
  if (values.empty()) return;
  std::vector<T> all;
  for (const size_t e : kept) {
    all.insert(all.end(), values.begin() + offsets[e], values.begin() + offsets[e + 1]);
  }
  values = std::move(all);
}
void keep_offsets(const std::vector<size_t>& kept, std::vector<uint32_t>& offsets) {
  if (offsets.empty()) return;
  std::vector<uint32_t> all{0};
  for (const size_t e : kept) all.push_back(all.back() + offsets[e + 1] - offsets[e]);
  offsets = std::move(all);
}

}  // namespace

void leave_out_followed(EdgeMesh& mesh) {
  std::vector<size_t> kept;
  std::vector<Edge> edges;
  for (size_t e = 0; e < mesh.edges.size(); ++e) {
    if (is_followed(mesh.edges[e])) continue;
    kept.push_back(e);
    edges.push_back(mesh.edges[e]);
  }
  mesh.edges = std::move(edges);
  keep_runs(kept, mesh.face_offsets, mesh.incident_faces);
  keep_runs(kept, mesh.face_offsets, mesh.incidences);
  keep_offsets(kept, mesh.face_offsets);
  keep_runs(kept, mesh.near_offsets, mesh.faces_and_near);
  keep_offsets(kept, mesh.near_offsets);
}

BoundaryFunction::BoundaryFunction(const Scene& scene, const EdgeSamplerInput& edges)
    : scene_(scene), edges_(edges), shapes_(scene.shapes.size()) {
  for (uint32_t s = 0; s < shapes_.size(); ++s) list_faces(ShapeId(s));
  list_sides();
}

void BoundaryFunction::list_faces(ShapeId shape) {
  const Mesh& mesh = scene_.shape(shape).mesh;
  ShapeSides& lists = shapes_[shape.index()];
  lists.touches.assign(mesh.positions.size(), kNothing);
  lists.face_offsets.assign(mesh.positions.size() + 1, 0);
  for (const FaceIndices& face : mesh.faces) {
    for (const uint32_t v : face) ++lists.face_offsets[mesh.weld[v]];
  }
  accumulate(lists.face_offsets);
  lists.faces.resize(lists.face_offsets.back());
  std::vector<uint32_t> next = lists.face_offsets;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    for (const uint32_t v : mesh.faces[f]) lists.faces[next[mesh.weld[v]]++] = f;
  }
}

void BoundaryFunction::touch(const EdgeMesh& object, const Edge& edge, FaceRef face, int corner) {
  if (edge.edge_class == EdgeClass::kSmooth) return;
  const bool sharp = edge.edge_class == EdgeClass::kSharp && object.one_sided_closed;
  const Mesh& mesh = scene_.shape(face.shape).mesh;
  for (const int k : {(corner + 1) % 3, (corner + 2) % 3}) {
    Touch& of_vertex = shapes_[face.shape.index()].touches[mesh.weld[mesh.face(face.face)[k]]];
    of_vertex = std::max(of_vertex, sharp ? kSharp : kAlways);
  }
}

void BoundaryFunction::list_sides() {
  struct Placed {
    FaceRef face;
    Side side;
  };
  std::vector<Placed> all;
  for (uint32_t s = 0; s < shapes_.size(); ++s) {
    shapes_[s].side_offsets.assign(scene_.shapes[s].mesh.faces.size() + 1, 0);
  }
  for (uint32_t o = 0; o < edges_.objects.size(); ++o) {
    const EdgeMesh& object = edges_.objects[o];
    for (uint32_t e = 0; e < object.edges.size(); ++e) {
      const Edge& edge = object.edges[e];
      if (edge.edge_class == EdgeClass::kFlat || !is_followed(edge)) continue;
      const FacesAround around = object.around(EdgeId(e));
      for (size_t i = 0; i < around.faces.size(); ++i) {
        if (around.incidence(i).through) continue;
        const FaceRef face = around.faces[i];
        const int corner =
            opposite_corner(face_corners<double>(scene_.shape(face.shape).mesh, face.face),
                            object.position(edge.vertices[0]), object.position(edge.vertices[1]));
        ++shapes_[face.shape.index()].side_offsets[face.face.index()];
        all.push_back({face, {{ShapeId(o), EdgeId(e)}, corner}});
        touch(object, edge, face, corner);
      }
    }
  }
  std::vector<std::vector<uint32_t>> next;
  for (ShapeSides& lists : shapes_) {
    accumulate(lists.side_offsets);
    lists.sides.resize(lists.side_offsets.back());
    next.push_back(lists.side_offsets);
  }
  for (const Placed& placed : all) {
    const size_t s = placed.face.shape.index();
    shapes_[s].sides[next[s][placed.face.face.index()]++] = placed.side;
  }
}

double BoundaryFunction::at_vertex(const Vec3d& p, ShapeId shape, uint32_t vertex) const {
  const ShapeSides& lists = shapes_[shape.index()];
  const Mesh& mesh = scene_.shape(shape).mesh;
  const uint32_t welded = mesh.weld[vertex];
  const Touch touch = lists.touches[welded];
  if (touch == kAlways) return 0;
  const EdgeMesh& object = edges_.object(shape);
  bool front = false, back = false;
  double least = std::numeric_limits<double>::infinity();
  for (uint32_t i = lists.face_offsets[welded]; i < lists.face_offsets[welded + 1]; ++i) {
    const Plane& plane = object.planes[lists.faces[i]];
    if (plane.n == Vec3d{}) continue;  // a face without area
    const double distance = plane.distance(p);
    (distance > 0 ? front : back) = true;
    if ((touch == kSharp && front) || (front && back)) return 0;
    least = std::min(least, std::fabs(distance));
  }
  const double away = length(cast<double>(mesh.positions[welded]) - p);
  return away > 0 ? std::min(1.0, least / away) : 0;
}

double BoundaryFunction::at(const Vec3d& p, FaceRef face,
                            const std::array<double, 3>& place) const {
  const FaceIndices& corners = scene_.shape(face.shape).mesh.face(face.face);
  double value = 0;
  bool zero = true;
  for (int k = 0; k < 3; ++k) {
    const double b = at_vertex(p, face.shape, corners[k]);
    zero = zero && b == 0;
    value += std::max(0.0, place[k]) * b;
  }
  if (!zero) return std::min(1.0, value);
  const ShapeSides& lists = shapes_[face.shape.index()];
  const size_t f = face.face.index();
  double least = 1;
  for (uint32_t i = lists.side_offsets[f]; i < lists.side_offsets[f + 1]; ++i) {
    const Side& side = lists.sides[i];
    if (!is_candidate(edges_.object(side.edge.object), side.edge.edge, p)) continue;
    least = std::min(least, std::max(0.0, place[side.corner]));
  }
  return least;
}

}  // namespace limn
