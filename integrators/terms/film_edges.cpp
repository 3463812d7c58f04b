// Where edges lie on the film, and the radiance difference there.
#include "integrators/terms/film_edges.h"

#include <limits>

#include "integrators/terms/edge_difference.h"
#include "integrators/terms/mirror_sight.h"

namespace limn {
namespace {

Camera::FilmPoint<double> film_of(const CameraView<Dual>& view, const Vec3d& x) {
  const auto at = view.project(Vec3<Dual>{x.x, x.y, x.z});
  return {at.x.v, at.y.v};
}

}  // namespace

bool FilmEdges::is_hidden(const EdgeMesh& mesh, EdgeId edge) const {
  if (!scene().hide_emitters || context_.straight_ways) return false;
  const auto faces = mesh.faces_around(edge);
  return std::all_of(faces.begin(), faces.end(),
                     [&](const FaceRef face) { return scene().shape(face.shape).is_emitter; });
}

Vec3<Dual> FilmEdges::moving(const Vec3d& x, const Vec3<Lanes>& velocity) const {
  if (free_) return {{x.x, {1, 0, 0, 0}}, {x.y, {0, 1, 0, 0}}, {x.z, {0, 0, 1, 0}}};
  return {{x.x, velocity.x}, {x.y, velocity.y}, {x.z, velocity.z}};
}

bool FilmEdges::place(uint32_t index, const CameraView<Dual>& view, FilmEdge& edge) const {
  const Vec3<Dual>&a = clips_[index].ends[0], &b = clips_[index].ends[1];
  const auto film_a = film_of(view, value(a));
  const auto film_b = film_of(view, value(b));
  edge.clip = index;
  edge.shape = clips_[index].face.shape;
  edge.t0 = 0;
  edge.t1 = 1;
  // The plane is parallel to the film: fractions are the same on both.
  const FilmWindow window = sampled_window(scene().film);
  if (!window.clip(film_a.x, film_b.x, film_a.y, film_b.y, edge.t0, edge.t1)) return false;
  const auto at = [&](double t) {
    const Vec3<Dual> x = a + (b - a) * t;
    return moving(value(x), {x.x.d, x.y.d, x.z.d});
  };
  const Vec3d from = value(view.start_of(a));
  Vec3d side = cross(value(a) - from, value(b) - from);
  if (dot(side, clips_[index].into_view) < 0) side = -side;
  return place_ends(at(edge.t0), at(edge.t1), side, view, edge);
}

bool FilmEdges::place(EdgeRef id, const CameraView<Dual>& view, FilmEdge& edge,
                      const FilmView* image) const {
  const EdgeMesh& mesh = input_.object(id.object);
  const Camera& camera = view.camera();
  const auto& ends = mesh.edge(id.edge).vertices;
  const Vec3d a = mesh.position(ends[0]);
  const Vec3d b = mesh.position(ends[1]);
  const double depth_a = camera.depth(a);
  const double depth_b = camera.depth(b);
  double t0 = 0;
  double t1 = 1;
  // Nearer than 16 roundings of depth only an edge through the pinhole itself is seen.
  const Vec3d pinhole = value(view.origin());
  const double rounding = 0x1p-48 * (length(a - pinhole) + length(b - pinhole));
  const double near = std::max(camera.near_clip, rounding);
  // Clip planes cut what the camera sees directly.
  const double far =
      context_.straight_ways ? std::numeric_limits<double>::infinity() : camera.far_clip;
  if (!clip_range(depth_a, depth_b - depth_a, near, far, t0, t1)) return false;
  if (image && !image->clip_to_mirror(pinhole, a, b, t0, t1)) return false;

  const auto at = [&](double t) { return a + (b - a) * t; };
  const auto film0 = film_of(view, at(t0));
  const auto film1 = film_of(view, at(t1));
  const double z0 = camera.depth(at(t0));
  const double z1 = camera.depth(at(t1));
  double s0 = 0;
  double s1 = 1;
  const FilmWindow window = image ? image->window : sampled_window(scene().film);
  if (!window.clip(film0.x, film1.x, film0.y, film1.y, s0, s1)) return false;

  edge.id = id;
  edge.t0 = t0 + (t1 - t0) * fraction_in_space(s0, z0, z1);
  edge.t1 = t0 + (t1 - t0) * fraction_in_space(s1, z0, z1);
  const auto moving_at = [&](double t) {
    Vec3<Lanes> d;
    if (!mesh.tangents.empty()) d = mesh.tangent(ends[0]) * (1 - t) + mesh.tangent(ends[1]) * t;
    return moving(at(t), d);
  };
  const Vec3d from = value(view.start_of(Vec3<Dual>{a.x, a.y, a.z}));
  return place_ends(moving_at(edge.t0), moving_at(edge.t1), cross(a - from, b - from), view, edge);
}

// From the ends of what reaches the film. side: the normal of the plane through it and the viewer,
// to the positive side.
bool FilmEdges::place_ends(const Vec3<Dual>& x0, const Vec3<Dual>& x1, const Vec3d& side,
                           const CameraView<Dual>& view, FilmEdge& edge) const {
  const Camera& camera = view.camera();
  const auto p0 = view.project(x0);
  const auto p1 = view.project(x1);
  const double dx = p1.x.v - p0.x.v;
  const double dy = p1.y.v - p0.y.v;
  edge.length = std::hypot(dx, dy);
  if (edge.length == 0) return false;
  // A step along the film normal turns the viewing ray, or moves it, by -(left n_x + up n_y), up to
  // a positive factor.
  double nx = dy / edge.length;
  double ny = -dx / edge.length;
  const Vec3d turn = value(camera.left) * -nx - value(camera.up) * ny;
  if (dot(turn, side) < 0) {
    nx = -nx;
    ny = -ny;
  }
  edge.nx = nx;
  edge.ny = ny;
  edge.speed0 = p0.x.d * nx + p0.y.d * ny;
  edge.speed1 = p1.x.d * nx + p1.y.d * ny;
  edge.x0 = p0.x.v;
  edge.y0 = p0.y.v;
  edge.x1 = p1.x.v;
  edge.y1 = p1.y.v;
  edge.depth0 = camera.depth(value(x0));
  edge.depth1 = camera.depth(value(x1));
  return true;
}

bool FilmEdges::place_refracted(EdgeRef id, uint32_t index, FilmEdge& edge) const {
  const FilmView& view = views_[index];
  const EdgeMesh& mesh = input_.object(id.object);
  const auto [v0, v1] = mesh.edge(id.edge).vertices;
  edge.id = id;
  edge.view = index;
  edge.refracted = true;
  edge.x0 = edge.x1 = edge.y0 = edge.y1 = 0;
  edge.t0 = 0, edge.t1 = 1, edge.depth0 = edge.depth1 = 1;
  edge.length = 1;
  return !view.touches_mirror(mesh.faces_around(id.edge)) &&
         view.refracted->clip(mesh.position(v0), mesh.position(v1), edge.t0, edge.t1);
}

void FilmEdges::add_speed(FilmEdge& edge, const LensPoint& lens, int lanes) const {
  constexpr int kPlaces = 4;  // not tuned
  const FilmView& view = views_[edge.view];
  const EdgeMesh& mesh = input_.object(edge.id.object);
  for (int i = 0; i < kPlaces; ++i) {
    const double t = edge.t0 + (edge.t1 - edge.t0) * (i + 0.5) / kPlaces;
    const auto seen = view.refracted->see(mesh, edge.id.edge, t, lens);
    if (!seen || !view.window.holds(seen->at)) continue;
    for (int k = 0; k < lanes; ++k) {
      edge.speed0[k] += std::fabs(seen->speed[k]) * seen->stretch * (edge.t1 - edge.t0) / kPlaces;
    }
  }
}

bool FilmEdges::bend(FilmEdgePoint& point, const LensPoint& lens) const {
  FilmEdge& edge = point.edge;
  const EdgeMesh& mesh = input_.object(edge.id.object);
  const auto seen = views_[edge.view].refracted->see(mesh, edge.id.edge, t_of(point), lens);
  if (!seen) return false;
  point.refracted = *seen;
  point.at = {seen->at, lens};
  edge.nx = seen->nx, edge.ny = seen->ny;
  edge.speed0 = edge.speed1 = seen->speed;
  edge.length = seen->stretch * (edge.t1 - edge.t0);
  return true;
}

bool FilmEdges::may_move(const FilmView& view, std::span<const FaceRef> faces) const {
  if (free_->moves(faces)) return true;
  return std::ranges::any_of(
      std::span(view.chain.mirrors).first(view.chain.count), [&](uint32_t m) {
        return free_->moves(std::span(view.mirrors->mirrors()[m].faces).first(1));
      });
}

double FilmEdges::t_of(const FilmEdgePoint& point) const {
  const FilmEdge& edge = point.edge;
  return edge.t0 + (edge.t1 - edge.t0) * fraction_in_space(point.s, edge.depth0, edge.depth1);
}

Vec3d FilmEdges::viewer_of(const FilmEdgePoint& point, const FacesAround& around,
                           const Vec3d& y) const {
  const Camera& camera = views_[point.edge.view].camera;
  if (camera.has_lens()) return CameraView<double>(camera).at(point.at.lens).origin();
  const Viewpoint& viewpoint = *views_[point.edge.view].viewpoint;
  const LightOrigin origin = point.edge.in_line ? viewpoint.aside(y) : viewpoint.seeing(around, y);
  if (!origin.infinite) return value(origin.v);
  const Vec3d along = value(origin.v);
  return y - along * (camera.depth(y) / dot(along, value(camera.forward)));
}

bool FilmEdges::difference_at(const FilmEdgePoint& point, const Rng& key, RayCount& rays,
                              Rgb<double>& difference, MirrorFaces& by) const {
  const FilmEdge& edge = point.edge;
  if (edge.view != 0) return difference_beyond(point, key, rays, difference, by);
  const double t = t_of(point);
  const Camera& camera = scene().camera;
  if (edge.clip != FilmEdge::kNoClip) {
    const ClipSegment& segment = clips_[edge.clip];
    const Vec3d a = value(segment.ends[0]), b = value(segment.ends[1]), y = a + (b - a) * t;
    const Vec3d from = CameraView<double>(camera).at(point.at.lens).start_of(y);
    return clip_difference(context_, segment, from, y, key, rays, difference);
  }
  const EdgeMesh& mesh = input_.object(edge.id.object);
  const auto& ends = mesh.edge(edge.id.edge).vertices;
  const Vec3d y = mesh.position(ends[0]) * (1 - t) + mesh.position(ends[1]) * t;
  const Vec3d p = viewer_of(point, mesh.around(edge.id.edge), y);
  EdgeView view;
  if (!view_edge(mesh, edge.id, t, p, view)) return false;
  const double cosine = dot(view.omega, value(camera.forward));
  return edge_difference(context_, mesh, view,
                         {{}, 0, key, {}, camera.near_clip / cosine, camera.far_clip / cosine},
                         rays, difference);
}

// By way of mirrors the edge is where the camera's image sees it; rays tell what hides it.
bool FilmEdges::difference_beyond(const FilmEdgePoint& point, const Rng& key, RayCount& rays,
                                  Rgb<double>& difference, MirrorFaces& by) const {
  const FilmEdge& edge = point.edge;
  const FilmView& view = views_[edge.view];
  const EdgeMesh& mesh = input_.object(edge.id.object);
  const auto& ends = mesh.edge(edge.id.edge).vertices;
  const double t = t_of(point);
  const Vec3d y = mesh.position(ends[0]) * (1 - t) + mesh.position(ends[1]) * t;
  const Camera& camera = scene().camera;
  Ray ray;
  if (edge.refracted) {
    const auto to_film = ray_at(CameraView<double>(camera), point.at);
    ray = {to_film.origin, to_film.direction};
  } else {
    const Vec3d image = viewer_of(point, mesh.around(edge.id.edge), y);
    ray = unfolded(*view.mirrors, view.chain, image, y);
  }
  const double cosine = dot(ray.direction, value(camera.forward));
  ray.t_min = camera.near_clip / cosine;
  ray.t_max = camera.far_clip / cosine;
  ray.skip_emitters = scene().hide_emitters;
  MirrorSight sight;
  if (!follow_mirrors(context_, view.chain, ray, 0, rays, sight)) return false;
  EdgeView beyond;
  if (!view_edge(mesh, edge.id, t, sight.from, beyond)) return false;
  const EdgeViewer viewer{sight.last(), sight.bounces, key};
  if (!edge_difference(context_, mesh, beyond, viewer, rays, difference)) return false;
  difference = difference * sight.share;
  by = sight.by;
  return true;
}

}  // namespace limn
