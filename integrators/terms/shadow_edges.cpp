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

// The distance from a point of a face to the nearest line of its sides.
double depth_of(const std::array<Vec3d, 3>& corners, const Vec3d& x) {
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    const Vec3d side = corners[(k + 1) % 3] - corners[k];
    least = std::min(least, length(cross(side, x - corners[k])) / length(side));
  }
  return least;
}

// A face with what its points are lifted to on the side that light along w comes from.
class LiftedFace {
 public:
  // A point of the face and what it is lifted to, with derivatives of that by the barycentric
  // coordinates b1 and b2 of x, and the line's parameter there.
  struct Point {
    double b1, b2, s;
    Vec3d x, p, by_1, by_2;
    bool inside;
  };

  LiftedFace(const Mesh& mesh, FaceId face, const Vec3d& w)
      : corners_(face_corners<double>(mesh, face)),
        normals_(detail::corner_normals<double>(mesh, face)),
        e1_(corners_[1] - corners_[0]),
        e2_(corners_[2] - corners_[0]),
        size_(length(cross(e1_, e2_))),
        n_(cross(e1_, e2_) / size_),
        side_(dot(n_, w) < 0 ? 1 : -1) {}

  const std::array<Vec3d, 3>& corners() const { return corners_; }

  // By Newton's method from the middle; none if it does not end.
  std::optional<Point> meet(const ShadowLine& line) const {
    constexpr int kMostSteps = 20;
    constexpr double kStep = 1e-12, kBeyond = 1e-9;  // of barycentric coordinates
    double b1 = 1.0 / 3, b2 = 1.0 / 3;
    for (int i = 0; i < kMostSteps; ++i) {
      Point at = point(b1, b2);
      const Vec3d step = solve(at, line.w, line.y - at.p);
      if (!std::isfinite(step.x + step.y + step.z)) return {};
      at.s = -step.z;
      at.inside = b1 >= -kBeyond && b2 >= -kBeyond && b1 + b2 <= 1 + kBeyond;
      if (std::fabs(step.x) + std::fabs(step.y) <= kStep) return at;
      // Lifts mean nothing far from the face.
      b1 = std::clamp(b1 + step.x, -0.5, 1.5);
      b2 = std::clamp(b2 + step.y, -0.5, 1.5);
      if (i + 1 == kMostSteps) {
        at.inside = false;
        return at;
      }
    }
    return {};
  }

  // The m of ShadowPoint: |dx/dt| over the slope of G on the face.
  double measure(const ShadowLine& line, const Point& at) const {
    const Vec3d moves = solve(at, line.w, line.along * (line.infinite ? 1 : 1 + at.s));
    const Vec3d normal = cross(line.w0, line.along);
    return size_ * std::hypot(moves.x, moves.y) /
           std::hypot(dot(normal, at.by_1), dot(normal, at.by_2));
  }

 private:
  Point point(double b1, double b2) const {
    const std::array<double, 3> b = {1 - b1 - b2, b1, b2};
    Point at{b1, b2, 0, corners_[0] + e1_ * b1 + e2_ * b2, {}, e1_, e2_, false};
    std::array<double, 3> depth;
    for (int k = 0; k < 3; ++k) depth[k] = dot(at.x - corners_[k], normals_[k]);
    const detail::Lift lift = detail::lift_of(normals_, b, depth, n_, side_, size_, at.x);
    at.p = at.x;
    for (int k = 0; k < 3; ++k) {
      const Vec3d n = normals_[k] * lift.gain[k];
      at.p += n * (b[k] * depth[k]);
      at.by_1 += n * ((k == 0 ? -1 : k == 1) * depth[k] + b[k] * dot(normals_[k], e1_));
      at.by_2 += n * ((k == 0 ? -1 : k == 2) * depth[k] + b[k] * dot(normals_[k], e2_));
    }
    return at;
  }
  // (a, b, c) with by_1 a + by_2 b + w c = v.
  static Vec3d solve(const Point& at, const Vec3d& w, const Vec3d& v) {
    const double d = determinant(at.by_1, at.by_2, w);
    return {determinant(v, at.by_2, w) / d, determinant(at.by_1, v, w) / d,
            determinant(at.by_1, at.by_2, v) / d};
  }

  std::array<Vec3d, 3> corners_, normals_;
  Vec3d e1_, e2_;
  double size_;  // twice the area
  Vec3d n_;
  double side_;
};

}  // namespace

Vec3<Dual> moving_vertex(const EdgeMesh& mesh, VertexId vertex) {
  const Vec3d& x = mesh.position(vertex);
  if (mesh.tangents.empty()) return {x.x, x.y, x.z};
  const Vec3<Lanes>& d = mesh.tangent(vertex);
  return {{x.x, d.x}, {x.y, d.y}, {x.z, d.z}};
}

ShadowEdges::ShadowEdges(const PathContext& context, const EdgeSamplerInput& input, int lanes)
    : context_(context), input_(input) {
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
  const DeltaLight& of = *context_.scene.delta_lights[light];
  const LightOrigin origin = of.origin();
  for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
    ShadowEdge edge{&of, light, {object, EdgeId(e)}, 0, 0, {}};
    edge.sign = lit_side(context_.scene, mesh, edge.id.edge, context_.viewpoints->lights[light]);
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

std::optional<ShadowPoint> ShadowEdges::cast(const ShadowEdge& edge, double t,
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
  if (!found || hit.t <= before * (1 + 0x1p-20)) return {};
  if (is_lifted(context_.scene, hit.face.shape)) {
    const Vec3d along = mesh.position(ends[1]) - mesh.position(ends[0]);
    ray.t_min = before;
    return cast_on_lifted({y, w, along, origin.through(mesh.position(ends[0])), origin.infinite},
                          ray, hit.face, rays);
  }
  const auto c = face_corners<double>(context_.scene.shape(hit.face.shape).mesh, hit.face.face);
  const Vec3d n = normalize(cross(c[1] - c[0], c[2] - c[0]));
  const double slope = dot(n, w);
  const double s = dot(n, c[0] - y) / slope;
  const double m = (origin.infinite ? 1 : 1 + s) / std::fabs(slope);
  if (!std::isfinite(m)) return {};
  const Vec3d inside = ray.origin + ray.direction * hit.t;
  const Vec3d center = (c[0] + c[1] + c[2]) * (1.0 / 3);
  const Vec3d x = y + w * s;
  return ShadowPoint{hit.face, x, x, m, inside, depth_of(c, inside), center, depth_of(c, center)};
}

// Where the line meets the lifted points of a face or of one near it: by Newton's method on a face,
// and on the face that a ray meets from where the lift is taken back.
std::optional<ShadowPoint> ShadowEdges::cast_on_lifted(const ShadowLine& line, const Ray& ray,
                                                       FaceRef face, RayCount& rays) const {
  constexpr int kMostFaces = 4;
  for (int i = 0; i < kMostFaces; ++i) {
    const LiftedFace lifted(context_.scene.shape(face.shape).mesh, face.face, line.w);
    const auto found = lifted.meet(line);
    if (!found) return {};
    if (found->inside) {
      const double m = lifted.measure(line, *found);
      if (!std::isfinite(m)) return {};
      const auto& c = lifted.corners();
      const Vec3d x = found->x, center = (c[0] + c[1] + c[2]) * (1.0 / 3);
      return ShadowPoint{face, x, found->p, m, x, depth_of(c, x), center, depth_of(c, center)};
    }
    Ray back = ray;
    back.origin = ray.origin - (found->p - found->x);
    Hit hit;
    ++rays.closest;
    if (!context_.tracer.closest(back, hit) || hit.face == face) return {};
    if (!is_lifted(context_.scene, hit.face.shape)) return {};
    face = hit.face;
  }
  return {};
}

Rgb<double> ShadowEdges::jump(const ShadowEdge& edge, const ShadowPoint& point, const Vec3d& q,
                              const Vec3d& omega) const {
  const Scene& scene = context_.scene;
  const auto surface = surface_on_ray<double>(scene, point.face, q, omega);
  const Scattering<double> scattering(surface, -omega, scene.shading);
  const auto arrival = edge.light->arriving(point.lit);
  if (scattering.black() || !arrival) return {};
  if (std::fabs(dot(surface.n_g, arrival->wo)) <= kEdgeOn) return {};
  return scattering.eval(arrival->wo) * arrival->irradiance * edge.sign;
}

}  // namespace limn
