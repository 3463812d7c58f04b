// Which edges part light from shadow, which of them is drawn, and where its shadow falls.
#include "integrators/terms/shadow_edges.h"

#include <algorithm>
#include <array>
#include <limits>

#include "integrators/edges/near_faces.h"

namespace limn {
namespace {

// Which sides of the plane through light and edge the faces around the edge lie on. A face that is
// seen edge-on, to the rounding of the determinant, casts no shadow of its own.
double lit_side(const Scene& scene, const EdgeMesh& edges, EdgeId edge,
                const Viewpoint& viewpoint) {
  const auto& ends = edges.edge(edge).vertices;
  const Vec3d x0 = edges.position(ends[0]);
  const Vec3d along = edges.position(ends[1]) - x0;
  const FacesAround around = edges.around(edge);
  const Vec3d w = viewpoint.seeing(around, x0).through(x0);
  const Vec3d n = cross(w, along);
  const double scale = 8 * 0x1p-53 * length(w) * length(along);
  const uint8_t own = edges.edge(edge).motion_group;
  bool blocked[2] = {false, false};
  const auto for_every_face = [&](const auto& visit) {
    for (size_t i = 0; i < around.faces.size(); ++i) {
      const FaceRef face = around.faces[i];
      double side = 0;
      for (const Vec3d& corner : face_corners<double>(scene.shape(face.shape).mesh, face.face)) {
        const Vec3d a = corner - x0;
        const double d = dot(a, n);
        if (std::fabs(d) > scale * length(a) && std::fabs(d) > std::fabs(side)) side = d;
      }
      if (side == 0) continue;
      visit(face, around.incidence(i), side > 0);
    }
  };
  RimOrder order;
  if (!around.incidences.empty()) {
    for_every_face([&](FaceRef face, Incidence incidence, bool positive) {
      const Vec3d into = side_of_face(scene, face, x0, normalize(along)).into;
      order.add(incidence.motion_group, positive, dot(into, w) / std::fabs(dot(into, n)));
    });
  }
  for_every_face([&](FaceRef, Incidence incidence, bool positive) {
    for (const bool place : {false, true}) {
      if (incidence.through || order.is_seen(incidence.motion_group, positive, own, place))
        blocked[place] = true;
    }
  });
  return blocked[0] == blocked[1] ? 0 : blocked[0] ? 1 : -1;
}

// The same of a frame, whose corners are the mesh's positions: the side of the corner opposite.
double inner_side(const EdgeMesh& frame, EdgeId edge, const Vec3d& light) {
  const auto& [a, b] = frame.edge(edge).vertices;
  const Vec3d x0 = frame.position(a), normal = cross(x0 - light, frame.position(b) - x0);
  return dot(normal, frame.positions[(b.index() + 1) % 4] - x0) > 0 ? 1 : -1;
}

// The distance from a point of a face to the nearest line of its sides.
double depth_of(const std::array<Vec3d, 3>& corners, const Vec3d& x) {
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    const Vec3d side = corners[(k + 1) % 3] - corners[k];
    least = std::min(least, length(cross(side, x - corners[k])) / length(side));
  }
  return least;
}

}  // namespace

Vec3<Dual> moving_vertex(const EdgeMesh& mesh, VertexId vertex) {
  const Vec3d& x = mesh.position(vertex);
  if (mesh.tangents.empty()) return {x.x, x.y, x.z};
  const Vec3<Lanes>& d = mesh.tangent(vertex);
  return {{x.x, d.x}, {x.y, d.y}, {x.z, d.z}};
}

ShadowEdges::ShadowEdges(const PathContext& context, const LightFrames& frames, int lanes)
    : context_(context), frames_(frames), input_(frames.edges()), lifted_(context.scene) {
  const Stopwatch watch;
  reach_ = 2 * bounds_of(context_.scene).diagonal();
  for (uint32_t i = 0; i < context_.scene.delta_lights.size(); ++i) {
    const size_t first = edges_.size();
    for (uint32_t o = 0; o < input_.objects.size(); ++o) list(i, ShapeId(o));
    weigh(first, lanes);
  }
  list_seconds_ = watch.seconds();
}

void ShadowEdges::list(uint32_t light, ShapeId object) {
  const EdgeMesh& mesh = input_.object(object);
  if (mesh.of_texture()) return;  // they hide nothing
  const DeltaLight& of = *context_.scene.delta_lights[light];
  const auto frame = frames_.light_of(object);
  if (frame && *frame != light) return;
  const LightOrigin origin = of.origin();
  for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
    ShadowEdge edge{&of, light, {object, EdgeId(e)}, 0, 0, {}};
    edge.sign =
        frame ? inner_side(mesh, edge.id.edge, value(of.origin().v))
              : lit_side(context_.scene, mesh, edge.id.edge, context_.viewpoints->lights[light]);
    if (edge.sign == 0) continue;
    const auto& ends = mesh.edge(edge.id.edge).vertices;
    const Vec3<Dual> y[2] = {moving_vertex(mesh, ends[0]), moving_vertex(mesh, ends[1])};
    const Vec3d along = value(y[1]) - value(y[0]);
    const Vec3d w[2] = {origin.through(value(y[0])), origin.through(value(y[1]))};
    const Vec3d normal = cross(w[0], along);
    const double size = length(normal);
    if (size == 0) continue;
    edge.angle = origin.infinite ? size : std::atan2(size, dot(w[0], w[1]));
    for (int i = 0; i < 2; ++i) {
      const Vec3<Dual> moving = origin.through(y[i]);
      const Lanes d = Lanes(moving.x.d * normal.x + moving.y.d * normal.y + moving.z.d * normal.z);
      const Vec3<Dual> at = y[i];
      const Lanes own = at.x.d * normal.x + at.y.d * normal.y + at.z.d * normal.z;
      for (int k = 0; k < kLanes; ++k) {
        // Parallel light that turns moves a shadow by as much as it is far: by the scene's size.
        const double v = origin.infinite ? std::fabs(own[k]) + std::fabs(d[k]) * reach_
                                         : std::fabs(d[k]) / length(w[i]);
        edge.speed[k] = std::max(edge.speed[k], v / size);
      }
    }
    edges_.push_back(edge);
  }
}

// Half of the samples follow length times speed, half length alone: a surface or a viewer that
// moves makes all shadows count. Every light and every parameter gets an equal share. Not tuned.
void ShadowEdges::weigh(size_t first, int lanes) {
  double length = 0;
  Lanes swept;
  for (size_t i = first; i < edges_.size(); ++i) {
    length += edges_[i].angle;
    swept += edges_[i].speed * edges_[i].angle;
  }
  for (size_t i = first; i < edges_.size(); ++i) {
    const ShadowEdge& edge = edges_[i];
    double share = 0;
    for (int k = 0; k < lanes; ++k) {
      share += edge.angle / length;
      share += swept[k] > 0 ? edge.speed[k] * edge.angle / swept[k] : edge.angle / length;
    }
    choice_.add(share);
  }
}

std::optional<ShadowPoint> ShadowEdges::cast(const ShadowEdge& edge, double t, const Rng& key,
                                             RayCount& rays) const {
  const EdgeMesh& mesh = input_.object(edge.id.object);
  const auto& ends = mesh.edge(edge.id.edge).vertices;
  const Vec3d y = mesh.position(ends[0]) * (1 - t) + mesh.position(ends[1]) * t;
  const LightOrigin origin = edge.light->origin();
  const Vec3d w = origin.through(y);
  const FacesAround around = mesh.around(edge.id.edge);
  const Viewpoint& viewpoint = context_.viewpoints->lights[edge.viewpoint];
  const bool edge_on = viewpoint.sees_edge_on(around);
  const Vec3d seen = (edge_on ? viewpoint.seeing(around, y) : viewpoint.hardly_aside(y)).through(y);
  const double length_seen = length(seen);
  const double before = origin.infinite ? reach_ : length_seen;  // of the ray, up to y
  Ray ray{y - seen * (before / length_seen), seen / length_seen};
  ray.skip_faces = around.all;
  Hit hit;
  ++rays.closest;
  // Where the edge touches what it shades, to a float's rounding, the shadow starts behind the edge
  // for every viewer, who sees the edge itself.
  const bool found = closest_at_edge(context_.tracer, context_.scene, around, y, before, ray, hit);
  if (found && hit.t <= before * (1 + 0x1p-20)) return {};
  if (!found && lifted_.empty()) return {};
  std::optional<ShadowPoint> on_face;
  const Vec3d y0 = mesh.position(ends[0]);
  const ShadowLine line{y, w, mesh.position(ends[1]) - y0, origin.through(y0), origin.infinite};
  if (found && !lifted_.has(hit.face)) {
    on_face = cast_on_face(line, hit.face, ray.origin + ray.direction * hit.t);
  }
  if (lifted_.empty()) return on_face;
  const double end = found ? hit.t * (1 + 0x1p-20) : before + reach_;
  return choose_crossing(line, (end - before) / length(w), on_face,
                         key.at(Purpose::kShadow, 1).uniform());
}

std::optional<ShadowPoint> ShadowEdges::cast_on_face(const ShadowLine& line, FaceRef face,
                                                     const Vec3d& inside) const {
  const auto c = face_corners<double>(context_.scene.shape(face.shape).mesh, face.face);
  const Vec3d n = normalize(cross(c[1] - c[0], c[2] - c[0]));
  const double slope = dot(n, line.w);
  const double s = dot(n, c[0] - line.y) / slope;
  const double m = (line.infinite ? 1 : 1 + s) / std::fabs(slope);
  if (!std::isfinite(m)) return {};
  const Vec3d center = (c[0] + c[1] + c[2]) * (1.0 / 3);
  const Vec3d x = line.y + line.w * s;
  return ShadowPoint{face, x, x, m, inside, depth_of(c, inside), center, depth_of(c, center), 0};
}

// Light grazes lifted points without meeting a face, and leaves those behind the edge itself: the
// shadow falls on all that the line meets before a face blocks it. One of them is taken by what it
// receives of the light, a tenth by chance alone. Not tuned.
std::optional<ShadowPoint> ShadowEdges::choose_crossing(const ShadowLine& line, double s_max,
                                                        std::optional<ShadowPoint> on_face,
                                                        double u) const {
  static thread_local std::vector<LiftedCrossing> found;
  lifted_.cross(line, s_max, found);
  if (found.empty()) return on_face;
  double sum = 0;
  // m times the cosine of light on a flat face.
  const double plain = on_face
                           ? (line.infinite ? 1 : length(on_face->x - line.y) + length(line.w)) /
                                 length_squared(line.w)
                           : 0;
  const auto received = [](const LiftedCrossing& c) { return c.m * std::max(c.cosine, 0.0); };
  for (const LiftedCrossing& crossing : found) sum += received(crossing);
  sum += plain;
  const double each = 1.0 / static_cast<double>(found.size() + (on_face ? 1 : 0));
  const auto share = [&](double amount) {
    return sum > 0 ? 0.9 * amount / sum + 0.1 * each : each;
  };
  u -= (on_face ? share(plain) : 0);
  if (on_face && u < 0) {
    on_face->probability = share(plain);
    return on_face;
  }
  size_t i = 0;
  while (i + 1 < found.size() && (u -= share(received(found[i]))) >= 0) ++i;
  const LiftedCrossing& at = found[i];
  const auto c = face_corners<double>(context_.scene.shape(at.face.shape).mesh, at.face.face);
  const Vec3d center = (c[0] + c[1] + c[2]) * (1.0 / 3);
  return ShadowPoint{at.face, at.x,
                     at.p,    at.m,
                     at.x,    depth_of(c, at.x),
                     center,  depth_of(c, center),
                     at.side, share(received(at))};
}

// Where the light arrives: on a frame, where it ends, by rounding alone, so hardly inside of it.
Vec3d ShadowEdges::lit_beside(const ShadowEdge& edge, const ShadowPoint& point) const {
  if (!frames_.light_of(edge.id.object)) return point.lit;
  const EdgeMesh& frame = input_.object(edge.id.object);
  const auto& [a, b] = frame.edge(edge.id.edge).vertices;
  const Vec3d light = value(edge.light->origin().v);
  const Vec3d inwards = normalize(cross(frame.position(a) - light, frame.position(b) - light));
  return point.lit + inwards * (edge.sign * 0x1p-36 * length(point.lit - light));
}

Rgb<double> ShadowEdges::difference(const ShadowEdge& edge, const ShadowPoint& point,
                                    const Vec3d& q, const Vec3d& omega) const {
  const Scene& scene = context_.scene;
  const auto surface = surface_on_ray<double>(scene, point.face, q, omega);
  const Scattering<double> scattering(surface, -omega, scene.shading);
  const auto arrival = edge.light->arriving(lit_beside(edge, point));
  if (scattering.black() || !arrival) return {};
  const double along = dot(surface.n_g, omega);
  if (point.side * along > 0) return {};  // the other side is lifted otherwise
  if (std::fabs(dot(surface.n_g, arrival->wo)) <= kEdgeOn) return {};
  return scattering.eval(arrival->wo) * arrival->irradiance * edge.sign;
}

}  // namespace limn
