// Contours listed by the forest of edges, their signs, and the number of faces on a ray.
#include "integrators/contours/contours.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "limn/core/prefetch.h"
#include "limn/edgetree/edge_sampler_types.h"

namespace limn {
namespace {

// Faces nearer to a point than this part of the scene's size may be one with the face it lies on:
// beyond what overlapping faces are apart (limn/core/face_overlaps.h). Not tuned.
constexpr double kNear = 0x1p-16;

// Edges of one shape for which nothing but sides counts: what may be a contour is what a point sees
// one face of, or what has other than two faces.
EdgeMesh contour_mesh(const Mesh& mesh, ShapeId shape) {
  EdgeMesh edges = build_edge_mesh(mesh, false, shape);
  for (Edge& edge : edges.edges) {
    if (edge.edge_class == EdgeClass::kSharp) edge.edge_class = EdgeClass::kSmooth;
  }
  edges.tangents.clear();
  return edges;
}

bool comes_first(const Vec3d& a, const Vec3d& b) {
  return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
}

}  // namespace

int side_of_edge(const Vec3d& x0, const Vec3d& x1, const Vec3d& p, const Vec3d& direction) {
  const bool turned = comes_first(x1, x0);
  const Vec3d w0 = (turned ? x1 : x0) - p, w1 = (turned ? x0 : x1) - p;
  const bool positive = determinant(w0, w1, direction) >= 0;
  return positive != turned ? 1 : -1;
}

Contours::Contours(const Scene& scene, const RayTracer& tracer, int threads)
    : scene_(scene), tracer_(tracer), tree_(scene) {
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    input_.objects.push_back(contour_mesh(scene.shapes[s].mesh, ShapeId(s)));
    extent_ = std::max(extent_, input_.objects.back().extent);
  }
  sampler_ = make_edge_sampler("forest", input_, threads);
}

ContourPoint Contours::at(const SurfacePoint<double>& surface, const Vec3d& up) const {
  if (surface.lifted) return {surface.p, up, {}};
  const Plane& plane = input_.object(surface.face.shape).plane(surface.face.face);
  return {surface.p - plane.n * plane.distance(surface.p), up, surface.face};
}

double Contours::rounding(const ContourPoint& at, ShapeId shape) const {
  const double of_shape = distance_error(input_.object(shape), at.p);
  if (!at.face.shape.valid()) return of_shape;
  return distance_error(input_.object(at.face.shape), at.p) + of_shape;
}

int Contours::sign(FaceRef face, const ContourPoint& at) const {
  if (face == at.face) return 0;
  const EdgeMesh& mesh = input_.object(face.shape);
  const double d = mesh.plane(face.face).distance(at.p);
  if (std::fabs(d) <= kNear * extent_) {
    if (std::fabs(d) <= distance_error(mesh, at.p)) return 0;
    if (at.face.shape.valid() && tracer_.overlap(face, at.face)) return 0;
  }
  return d > 0 ? 1 : -1;
}

// A face to the left of its side, seen from the front, covers the side s . w < 0.
int Contours::change_of(EdgeRef id, const ContourPoint& at) const {
  const EdgeMesh& mesh = input_.object(id.object);
  const Edge& edge = mesh.edge(id.edge);
  switch (edge.edge_class) {
    case EdgeClass::kSmooth:
    case EdgeClass::kFlat:
      return sign({id.object, edge.faces[1]}, at) - sign({id.object, edge.faces[0]}, at);
    case EdgeClass::kBoundary:
      return -sign({id.object, edge.faces[0]}, at);
    default:
      break;
  }
  const Vec3d x0 = mesh.position(edge.vertices[0]);
  const Vec3d along = mesh.position(edge.vertices[1]) - x0;
  int change = 0;
  for (const FaceRef face : mesh.faces_around(id.edge)) {
    const auto c = face_corners<double>(scene_.shape(face.shape).mesh, face.face);
    const Vec3d middle = (c[0] + c[1] + c[2]) * (1.0 / 3) - x0;
    const bool left = determinant(mesh.plane(face.face).n, along, middle) > 0;
    change += left ? -sign(face, at) : sign(face, at);
  }
  return change;
}

void Contours::list(const ContourPoint& at, const DirectionCone& cone, const ContourScreen* screen,
                    std::vector<ContourArc>& arcs) const {
  static thread_local std::vector<ListedEdge> listed;
  listed.clear();
  EdgeQuery query;
  query.p = at.p;
  query.n = query.wi = at.up;
  query.velocity.x[0] = 1;  // nothing is at rest: all edges count
  sampler_->list_outlines(query, cone, listed);
  // What is read of an edge is fetched while others are worked on. Not tuned.
  constexpr size_t kAhead = 8;
  const auto fetch = [&](const ListedEdge& edge) {
    const EdgeMesh& mesh = input_.object(edge.id.object);
    for (const FaceId face : mesh.edge(edge.id.edge).faces) {
      if (face.valid()) prefetch(&mesh.planes[face.index()]);
    }
  };
  for (size_t i = 0; i < listed.size(); ++i) {
    if (i + kAhead < listed.size()) fetch(listed[i + kAhead]);
    const ListedEdge& edge = listed[i];
    double t0 = 0, t1 = 1;
    if (screen && !DirectionCone::clip_by(screen->height(edge.x0), screen->height(edge.x1), t0, t1))
      continue;
    const int change = change_of(edge.id, at);
    if (change == 0) continue;
    const Vec3d w0 = edge.x0 - at.p, w1 = edge.x1 - at.p;
    arcs.push_back({t0 > 0 ? w0 + (w1 - w0) * t0 : w0, t1 < 1 ? w0 + (w1 - w0) * t1 : w1, change});
  }
  if (!screen) return;
  for (const ContourScreen::Cut& cut : screen->cuts) {
    const int change = -sign(cut.face, at);
    if (change != 0) arcs.push_back({cut.x0 - at.p, cut.x1 - at.p, change});
  }
}

int Contours::count(const ContourPoint& at, const Vec3d& direction,
                    const ContourScreen* screen) const {
  static thread_local std::vector<const FaceTree::Item*> items;
  items.clear();
  const Vec3d unit = normalize(direction);
  const Frame frame(unit);
  // Wider than rounding. Not tuned.
  const double slack = 0x1p-40 * (extent_ + length(at.p));
  std::array<HalfSpace, 5> around;
  int k = 0;
  for (const Vec3d& n : {frame.s, -frame.s, frame.t, -frame.t, unit}) {
    around[k++] = {n, slack - dot(n, at.p)};
  }
  tree_.list(around, items);
  int count = 0;
  for (const FaceTree::Item* item : items) {
    const int seen = sign(item->face, at);
    if (seen == 0) continue;
    Vec3d x[3];
    for (int c = 0; c < 3; ++c) x[c] = cast<double>(item->corners[c]);
    const auto inside = [&](int c) {
      return side_of_edge(x[c], x[(c + 1) % 3], at.p, direction) == -seen;
    };
    if (!inside(0) || !inside(1) || !inside(2)) continue;
    if (screen) {
      const Plane& plane = input_.object(item->face.shape).plane(item->face.face);
      const double t = -plane.distance(at.p) / dot(plane.n, direction);
      if (!(screen->height(at.p + direction * t) > 0)) continue;
    }
    ++count;
  }
  return count;
}

ContourScreen Contours::make_screen(const Plane& plane, double margin,
                                    std::span<const Vec3d> corners) const {
  ContourScreen screen{plane, margin, {}};
  std::vector<HalfSpace> around;
  for (size_t i = 0; i < corners.size(); ++i) {
    const Vec3d side = corners[(i + 1) % corners.size()] - corners[i];
    const Vec3d in = normalize(cross(plane.n, side));
    around.push_back({in, 2 * margin - dot(in, corners[i])});
  }
  around.push_back({plane.n, plane.offset});
  std::vector<const FaceTree::Item*> items;
  tree_.list(around, items);
  for (const FaceTree::Item* item : items) {
    Vec3d x[3], leaves, enters;
    double h[3];
    for (int c = 0; c < 3; ++c) {
      x[c] = cast<double>(item->corners[c]);
      h[c] = screen.height(x[c]);
    }
    int sides = 0;
    for (int c = 0; c < 3; ++c) {
      const int next = (c + 1) % 3;
      if ((h[c] > 0) == (h[next] > 0)) continue;
      (h[c] > 0 ? leaves : enters) = x[c] + (x[next] - x[c]) * (h[c] / (h[c] - h[next]));
      ++sides;
    }
    if (sides == 2) screen.cuts.push_back({leaves, enters, item->face});
  }
  return screen;
}

}  // namespace limn
