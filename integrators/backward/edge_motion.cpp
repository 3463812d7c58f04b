// Points of faces hang on their corners, as do edges of textures, and edges of meshes on their
// vertices; where edges were cut, on the ends of the whole edge; curves where two faces cross, on
// the corners of both.
#include "integrators/backward/edge_motion.h"

#include <algorithm>

#include "limn/core/reverse.h"
#include "limn/core/surface_point.h"

namespace limn {

bool EdgeMotion::moves(EdgeRef id) const {
  if (const FramedLight* const light = frame(id)) return slots_.of(*light) != nullptr;
  if (!is_crossing(id)) return moves(shape_of(id));
  for (const FaceRef face : input_->object(id.object).faces_around(id.edge))
    if (moves(face.shape)) return true;
  return false;
}

bool EdgeMotion::moves(const MovingPoint& point) const {
  switch (point.of) {
    case MovingPoint::Of::kEdge:
      return moves(point.edge);
    case MovingPoint::Of::kFace:
      return moves(point.face.shape);
    case MovingPoint::Of::kLight:
      break;
  }
  return slots_.of(*point.light) != nullptr;
}

bool EdgeMotion::moves(const BoundaryForm& form) const {
  return std::ranges::any_of(form.all(), [&](const MovingPoint& point) { return moves(point); });
}

void EdgeMotion::contribute(Tape& tape, Seeds& seeds, const BoundaryForm& form,
                            double weight) const {
  for (const MovingPoint& point : form.all()) {
    if (!moves(point)) continue;
    const Vec3d g = point.g * weight;
    switch (point.of) {
      case MovingPoint::Of::kEdge:
        if (frame(point.edge)) {
          contribute_frame(seeds, point, g);
          break;
        }
        contribute_end(tape, point.edge, 0, g * (1 - point.t));
        contribute_end(tape, point.edge, 1, g * point.t);
        break;
      case MovingPoint::Of::kFace:
        contribute_face(tape, point.face, point.x, g);
        break;
      case MovingPoint::Of::kLight:
        seeds.add(light_origin(*point.light), g);
        break;
    }
  }
  if (form.lift) contribute_lift(tape, *form.lift, weight);
}

void EdgeMotion::contribute_lift(Tape& tape, const MovingLift& lift, double weight) const {
  const Mesh& mesh = slots_.scene->shape(lift.face.shape).mesh;
  const uint32_t first = slots_.mesh(lift.face.shape).normals;
  for (int k = 0; k < 3; ++k) {
    const Vec3d of_normal = lift.of_normals[k] * weight;
    contribute_vertex(tape, lift.face.shape, mesh.face(lift.face.face)[k],
                      lift.of_corners[k] * weight);
    if (first == 0) continue;
    const uint32_t id = mesh.normal_ids[lift.face.face.index()][k];
    for (int c = 0; c < 3; ++c) tape.contribute(first + 3 * id + c, of_normal[c]);
  }
}

void EdgeMotion::contribute_face(Tape& tape, FaceRef face, const Vec3d& x, const Vec3d& g) const {
  const Mesh& mesh = slots_.scene->shape(face.shape).mesh;
  const auto b = barycentric(face_corners<double>(mesh, face.face), x);
  for (int k = 0; k < 3; ++k) {
    contribute_vertex(tape, face.shape, mesh.face(face.face)[k], g * b[k]);
  }
}

void EdgeMotion::contribute_end(Tape& tape, EdgeRef id, int end, const Vec3d& g) const {
  const EdgeMesh& mesh = input_->object(id.object);
  const VertexId vertex = mesh.edge(id.edge).vertices[end];
  if (is_crossing(id)) {
    contribute_crossing(tape, id, mesh.position(vertex), g);
    return;
  }
  if (mesh.of_texture()) {
    const auto [b1, b2] = mesh.places[vertex.index()];
    const double weights[3] = {1 - b1 - b2, b1, b2};
    const FaceId face = mesh.edge(id.edge).faces[0];
    const FaceIndices& corners = slots_.scene->shape(mesh.shape).mesh.face(face);
    for (int k = 0; k < 3; ++k) contribute_vertex(tape, mesh.shape, corners[k], g * weights[k]);
    return;
  }
  const size_t own = mesh.positions.size() - mesh.cuts.size();
  if (vertex.index() < own) {
    contribute_vertex(tape, id.object, vertex.index(), g);
    return;
  }
  const CutVertex& cut = mesh.cuts[vertex.index() - own];
  contribute_vertex(tape, id.object, cut.ends[0].index(), g * (1 - cut.t));
  contribute_vertex(tape, id.object, cut.ends[1].index(), g * cut.t);
}

void EdgeMotion::contribute_frame(Seeds& seeds, const MovingPoint& point, const Vec3d& g) const {
  const FramedLight& light = *frame(point.edge);
  const auto corners = light.corners();
  const auto& ends = point.mesh->edge(point.edge.edge).vertices;
  for (int end = 0; end < 2; ++end) {
    const Vec3d weight = g * (end == 0 ? 1 - point.t : point.t);
    const size_t k = ends[end].index();
    const double distance = length(point.mesh->position(ends[end]) - value(light.origin().v)) /
                            length(value(corners[k]));
    seeds.add(light_origin(light), weight);
    seeds.add(corner_of_frame(light, k), weight * distance);
  }
}

// See intersection_velocity(): a point x of the line moves with v = (s m x l + t l x n) / |l|^2, l
// = n x m, with the speeds s and t of the planes along their unit normals n and m, and those are
// linear in the corners' velocities, each with its barycentric coordinate of x.
void EdgeMotion::contribute_crossing(Tape& tape, EdgeRef id, const Vec3d& x, const Vec3d& g) const {
  const auto faces = input_->object(id.object).faces_around(id.edge);
  std::array<std::array<Vec3d, 3>, 2> corners;
  std::array<Vec3d, 2> area, unit;
  for (int i = 0; i < 2; ++i) {
    corners[i] = face_corners<double>(slots_.scene->shape(faces[i].shape).mesh, faces[i].face);
    area[i] = cross(corners[i][1] - corners[i][0], corners[i][2] - corners[i][0]);
    unit[i] = normalize(area[i]);
  }
  const Vec3d line = cross(unit[0], unit[1]);
  const double scale = 1 / length_squared(line);
  const double of_speed[2] = {dot(g, cross(unit[1], line)) * scale,
                              dot(g, cross(line, unit[0])) * scale};
  for (int i = 0; i < 2; ++i) {
    const FaceIndices& face = slots_.scene->shape(faces[i].shape).mesh.face(faces[i].face);
    for (int k = 0; k < 3; ++k) {
      const Vec3d &a = corners[i][(k + 1) % 3], &b = corners[i][(k + 2) % 3];
      const double weight = dot(area[i], cross(a - x, b - x)) / length_squared(area[i]);
      contribute_vertex(tape, faces[i].shape, face[k], unit[i] * (of_speed[i] * weight));
    }
  }
}

void EdgeMotion::contribute_vertex(Tape& tape, ShapeId shape, uint32_t vertex,
                                   const Vec3d& g) const {
  const uint32_t first = slots_.mesh(shape).positions;
  if (first == 0) return;
  const uint32_t root = slots_.scene->shape(shape).mesh.weld[vertex];
  for (int k = 0; k < 3; ++k) tape.contribute(first + 3 * root + k, g[k]);
}

}  // namespace limn
