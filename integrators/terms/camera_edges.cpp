// Listing what moves on the film, drawing points of it, the jump of radiance there.
#include "integrators/terms/camera_edges.h"

#include "integrators/estimates/splat.h"
#include "integrators/terms/edge_difference.h"

namespace limn {
namespace {

struct Window {
  double x0, y0, x1, y1;
};

// Where a film position can matter to a pixel of the crop window.
Window sampled_window(const Film& film) {
  const double border = film.sample_border ? film.filter.radius : 0;
  return {film.crop_x - border, film.crop_y - border, film.crop_x + film.crop_width + border,
          film.crop_y + film.crop_height + border};
}

// Cuts the parameter range [s0, s1] of a + s d to where it lies in [lower, upper] (Liang and
// Barsky).
bool clip(double a, double d, double lower, double upper, double& s0, double& s1) {
  if (d == 0) return a >= lower && a <= upper;
  double enter = (lower - a) / d;
  double leave = (upper - a) / d;
  if (enter > leave) std::swap(enter, leave);
  s0 = std::max(s0, enter);
  s1 = std::min(s1, leave);
  return s0 < s1;
}

// Perspective: the fraction of the segment in space that is seen at the fraction s of its
// projection.
double fraction_in_space(double s, double depth0, double depth1) {
  return s * depth0 / ((1 - s) * depth1 + s * depth0);
}

// Where positions move, edges are drawn in pieces of so many pixels at most. Not tuned.
constexpr double kPieceLength = 2;
// The share of its motion against all pixels around it in how likely a piece is drawn; the rest
// goes by those that see its middle. Not tuned.
constexpr double kAllAround = 0.1;

Lanes larger(const Lanes& a, const Lanes& b) {
  Lanes result;
  for (int k = 0; k < kLanes; ++k) result[k] = std::max(std::fabs(a[k]), std::fabs(b[k]));
  return result;
}

// The root mean square, over the pixels that see a piece of an edge, of how fast it moves against
// their positions. Positive wherever that is not zero for one of them.
class SpeedAgainstFilm {
 public:
  SpeedAgainstFilm(const Film& film, const FilmMotionAt& motion) : film_(film), motion_(motion) {}

  Lanes of(const FilmEdge& edge, double s0, double s1) const {
    const auto at = [&](double a, double b, double s) { return a + (b - a) * s; };
    const double x0 = at(edge.x0, edge.x1, s0), x1 = at(edge.x0, edge.x1, s1);
    const double y0 = at(edge.y0, edge.y1, s0), y1 = at(edge.y0, edge.y1, s1);
    const Lanes v0 = edge.speed0 * (1 - s0) + edge.speed1 * s0;
    const Lanes v1 = edge.speed0 * (1 - s1) + edge.speed1 * s1;
    Lanes around, seen;
    double count = 0, weights = 0;
    const auto square = [&](int x, int y) {
      Lanes along;
      if (const FilmMotion* m = motion_(x, y)) along = m->x * edge.nx + m->y * edge.ny;
      const Lanes moving = larger(v0 - along, v1 - along), held = larger(v0, v1);
      const bool rests = ends_at_once(film_.filter, film_.range_x(x).lower) ||
                         ends_at_once(film_.filter, film_.range_x(x).upper) ||
                         ends_at_once(film_.filter, film_.range_y(y).lower) ||
                         ends_at_once(film_.filter, film_.range_y(y).upper);
      Lanes result;
      for (int k = 0; k < kLanes; ++k) {
        result[k] = moving[k] * moving[k] + (rests ? kTaper * held[k] * held[k] : 0);
      }
      return result;
    };
    const auto [first_x, last_x] = pixels(x0, x1, film_.crop_x, film_.crop_width);
    const auto [first_y, last_y] = pixels(y0, y1, film_.crop_y, film_.crop_height);
    for (int y = first_y; y <= last_y; ++y) {
      for (int x = first_x; x <= last_x; ++x) {
        around += square(x, y);
        ++count;
      }
    }
    for_every_pixel_of(film_, 0.5 * (x0 + x1), 0.5 * (y0 + y1), [&](int x, int y, double weight) {
      seen += square(x, y) * weight;
      weights += weight;
    });
    Lanes result;
    for (int k = 0; k < kLanes; ++k) {
      double mean = count > 0 ? kAllAround * around[k] / count : 0;
      if (weights > 0) mean += (1 - kAllAround) * seen[k] / weights;
      result[k] = std::sqrt(mean);
    }
    return result;
  }

 private:
  // That may see something between two places.
  std::pair<int, int> pixels(double a, double b, int begin, int count) const {
    const double radius = film_.filter.radius;
    const double first = std::floor(std::min(a, b) - 0.5 - radius);
    const double last = std::ceil(std::max(a, b) - 0.5 + radius);
    return {static_cast<int>(std::max<double>(begin, first)),
            static_cast<int>(std::min<double>(begin + count - 1, last))};
  }

  const Film& film_;
  const FilmMotionAt& motion_;
};

// The faces whose vertices an edge hangs on: of its own mesh, or, where two faces cross, both.
std::span<const FaceRef> faces_that_move(const EdgeMesh& mesh, EdgeId edge) {
  const auto faces = mesh.faces_around(edge);
  return mesh.shape.valid() ? faces.first(1) : faces;
}

}  // namespace

CameraEdges::CameraEdges(const PathContext& context, const EdgeSamplerInput& input, int lanes,
                         const FreeMotion* free, const FilmRegions* visible)
    : context_(context),
      input_(input),
      lanes_(free ? 3 : lanes),
      free_(free),
      visible_(visible),
      viewpoint_(context.viewpoints->camera),
      clips_(find_clip_segments(context.scene)) {
  const Stopwatch watch;
  list();
  weigh({});
  moving_ = std::count_if(pieces_.begin(), pieces_.end(),
                          [](const Piece& piece) { return !is_zero(piece.weight); });
  list_seconds_ = watch.seconds();
}

void CameraEdges::list() {
  edges_.clear();
  for (uint32_t o = 0; o < input_.objects.size(); ++o) add_object(ShapeId(o));
  for (uint32_t c = 0; c < clips_.size(); ++c) add_clip(c);
  find_in_line();
  if (visible_) keep_seen(*visible_);
}

void CameraEdges::find_in_line() {
  const EdgesInLine found = find_edges_in_line(edges_, resting_, context_.scene.camera);
  for (size_t e = 0; e < edges_.size(); ++e) edges_[e].in_line = found.in_line[e];
  parting_ = found.parting;
  resting_ = {};
}

// Lines keep their speeds where they are cut, which change linearly along them. Of edges in one
// line a place aside sees other parts than the camera, where the regions are.
void CameraEdges::keep_seen(const FilmRegions& visible) {
  std::vector<FilmEdge> seen;
  for (const FilmEdge& edge : edges_) {
    if (edge.in_line) {
      seen.push_back(edge);
      continue;
    }
    const bool is_clip = edge.clip != FilmEdge::kNoClip;
    const FacesAround around = is_clip ? FacesAround{{&clips_[edge.clip].face, 1}, {}}
                                       : input_.object(edge.id.object).around(edge.id.edge);
    for (const auto& [s0, s1, beside] :
         visible.seen_parts({edge.x0, edge.y0}, {edge.x1, edge.y1}, around.all)) {
      const auto at = [](const auto& a, const auto& b, double s) { return a * (1 - s) + b * s; };
      const auto depth_at = [&](double s) { return 1 / at(1 / edge.depth0, 1 / edge.depth1, s); };
      FilmEdge part = edge;
      part.t0 = at(edge.t0, edge.t1, fraction_in_space(s0, edge.depth0, edge.depth1));
      part.t1 = at(edge.t0, edge.t1, fraction_in_space(s1, edge.depth0, edge.depth1));
      part.depth0 = depth_at(s0), part.depth1 = depth_at(s1);
      part.x0 = at(edge.x0, edge.x1, s0), part.x1 = at(edge.x0, edge.x1, s1);
      part.y0 = at(edge.y0, edge.y1, s0), part.y1 = at(edge.y0, edge.y1, s1);
      part.speed0 = at(edge.speed0, edge.speed1, s0);
      part.speed1 = at(edge.speed0, edge.speed1, s1);
      part.length = edge.length * (s1 - s0);
      if (around.near.empty() && !viewpoint_.sees_edge_on(around)) part.beside = beside;
      seen.push_back(part);
    }
  }
  edges_ = std::move(seen);
}

// Whether all faces around the edge are emitters that the camera does not see.
bool CameraEdges::is_hidden(const EdgeMesh& mesh, EdgeId edge) const {
  if (!context_.scene.hide_emitters) return false;
  const auto faces = mesh.faces_around(edge);
  return std::all_of(faces.begin(), faces.end(), [&](const FaceRef face) {
    return context_.scene.shape(face.shape).is_emitter;
  });
}

bool CameraEdges::clip_to_window(double x0, double x1, double y0, double y1, double& s0,
                                 double& s1) const {
  const Window window = sampled_window(context_.scene.film);
  return clip(x0, x1 - x0, window.x0, window.x1, s0, s1) &&
         clip(y0, y1 - y0, window.y0, window.y1, s0, s1);
}

Vec3<Dual> CameraEdges::moving(const Vec3d& x, const Vec3<Lanes>& velocity) const {
  if (free_) return {{x.x, {1, 0, 0, 0}}, {x.y, {0, 1, 0, 0}}, {x.z, {0, 0, 1, 0}}};
  return {{x.x, velocity.x}, {x.y, velocity.y}, {x.z, velocity.z}};
}

void CameraEdges::add_object(ShapeId object) {
  const EdgeMesh& mesh = input_.object(object);
  for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
    const EdgeRef id{object, EdgeId(e)};
    FilmEdge edge;
    if (!viewpoint_.is_candidate(mesh, id.edge) || is_hidden(mesh, id.edge)) continue;
    if (clip_and_project(id, edge)) add(edge, faces_that_move(mesh, id.edge));
  }
}

void CameraEdges::add_clip(uint32_t index) {
  const Vec3<Dual>&a = clips_[index].ends[0], &b = clips_[index].ends[1];
  const Camera& camera = context_.scene.camera;
  const auto film_a = camera.project(value(a));
  const auto film_b = camera.project(value(b));
  FilmEdge edge;
  edge.clip = index;
  edge.shape = clips_[index].face.shape;
  edge.t0 = 0;
  edge.t1 = 1;
  // The plane is parallel to the film: fractions are the same on both.
  if (!clip_to_window(film_a.x, film_b.x, film_a.y, film_b.y, edge.t0, edge.t1)) return;
  const auto at = [&](double t) {
    const Vec3<Dual> x = a + (b - a) * t;
    return moving(value(x), {x.x.d, x.y.d, x.z.d});
  };
  Vec3d side = cross(value(a) - value(camera.origin), value(b) - value(camera.origin));
  if (dot(side, clips_[index].into_view) < 0) side = -side;
  if (place_on_film(at(edge.t0), at(edge.t1), side, edge)) {
    add(edge, {&clips_[index].face, 1});
  }
}

bool CameraEdges::clip_and_project(EdgeRef id, FilmEdge& edge) const {
  const EdgeMesh& mesh = input_.object(id.object);
  const Camera& camera = context_.scene.camera;
  const auto& ends = mesh.edge(id.edge).vertices;
  const Vec3d a = mesh.position(ends[0]);
  const Vec3d b = mesh.position(ends[1]);
  const double depth_a = camera.depth(a);
  const double depth_b = camera.depth(b);
  double t0 = 0;
  double t1 = 1;
  // Nearer than 16 roundings of depth only an edge through the pinhole itself is seen.
  const Vec3d pinhole = value(camera.origin);
  const double rounding = 0x1p-48 * (length(a - pinhole) + length(b - pinhole));
  const double near = std::max(camera.near_clip, rounding);
  if (!clip(depth_a, depth_b - depth_a, near, camera.far_clip, t0, t1)) return false;

  const auto at = [&](double t) { return a + (b - a) * t; };
  const auto film0 = camera.project(at(t0));
  const auto film1 = camera.project(at(t1));
  const double z0 = camera.depth(at(t0));
  const double z1 = camera.depth(at(t1));
  double s0 = 0;
  double s1 = 1;
  if (!clip_to_window(film0.x, film1.x, film0.y, film1.y, s0, s1)) return false;

  edge.id = id;
  const FacesAround around = mesh.around(id.edge);
  if (!viewpoint_.sees_edge_on(around)) edge.shape = around.faces[0].shape;
  edge.t0 = t0 + (t1 - t0) * fraction_in_space(s0, z0, z1);
  edge.t1 = t0 + (t1 - t0) * fraction_in_space(s1, z0, z1);
  const auto moving_at = [&](double t) {
    Vec3<Lanes> d;
    if (!mesh.tangents.empty()) d = mesh.tangent(ends[0]) * (1 - t) + mesh.tangent(ends[1]) * t;
    return moving(at(t), d);
  };
  return place_on_film(moving_at(edge.t0), moving_at(edge.t1), cross(a - pinhole, b - pinhole),
                       edge);
}

// From the ends of what reaches the film. side: the normal of the plane through it and the pinhole,
// to the positive side.
bool CameraEdges::place_on_film(const Vec3<Dual>& x0, const Vec3<Dual>& x1, const Vec3d& side,
                                FilmEdge& edge) const {
  const Camera& camera = context_.scene.camera;
  const auto p0 = camera.project(x0);
  const auto p1 = camera.project(x1);
  const double dx = p1.x.v - p0.x.v;
  const double dy = p1.y.v - p0.y.v;
  edge.length = std::hypot(dx, dy);
  if (edge.length == 0) return false;
  // A step along the film normal turns the viewing ray by -(left n_x + up n_y), up to a positive
  // factor.
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

void CameraEdges::move_film(const FilmMotionAt& motion) {
  const Stopwatch watch;
  lanes_ = kLanes;
  if (motion && !lists_all_) {
    lists_all_ = true;
    list();
  } else if (!motion && lists_all_) {
    lists_all_ = false;
    std::erase_if(edges_, [](const FilmEdge& edge) { return !moves(edge); });
    edges_.shrink_to_fit();
  }
  weigh(motion);
  list_seconds_ += watch.seconds();
}

void CameraEdges::add_pieces(uint32_t index, const FilmMotionAt& motion) {
  const FilmEdge& edge = edges_[index];
  if (!motion) {
    pieces_.push_back({index, 0, 1, larger(edge.speed0, edge.speed1) * edge.length});
    return;
  }
  const SpeedAgainstFilm speed(context_.scene.film, motion);
  const int count = static_cast<int>(std::ceil(std::max(1.0, edge.length / kPieceLength)));
  for (int i = 0; i < count; ++i) {
    const double s0 = static_cast<double>(i) / count, s1 = static_cast<double>(i + 1) / count;
    pieces_.push_back({index, s0, s1, speed.of(edge, s0, s1) * (edge.length * (s1 - s0))});
  }
}

// Projected length times speed: exact but for the jump itself. Every parameter gets an equal
// share of the samples, whatever its unit.
void CameraEdges::weigh(const FilmMotionAt& motion) {
  pieces_ = {};
  choice_ = {};
  for (uint32_t e = 0; e < edges_.size(); ++e) add_pieces(e, motion);
  Lanes totals;
  for (const Piece& piece : pieces_) totals += piece.weight;
  for (const Piece& piece : pieces_) {
    double share = 0;
    for (int k = 0; k < lanes_; ++k) {
      if (totals[k] > 0) share += piece.weight[k] / totals[k];
    }
    choice_.add(share);
  }
}

FilmEdgePoint CameraEdges::choose(double u) const {
  const DiscreteDistribution::Draw draw = choice_.sample(u);
  const Piece& piece = pieces_[draw.index];
  const FilmEdge& edge = edges_[piece.edge];
  FilmEdgePoint point;
  point.edge = &edge;
  point.s = piece.s0 + (piece.s1 - piece.s0) * draw.fraction;
  point.x = edge.x0 + (edge.x1 - edge.x0) * point.s;
  point.y = edge.y0 + (edge.y1 - edge.y0) * point.s;
  point.density = draw.probability / (edge.length * (piece.s1 - piece.s0));
  return point;
}

double CameraEdges::t_of(const FilmEdgePoint& point) const {
  const FilmEdge& edge = *point.edge;
  return edge.t0 + (edge.t1 - edge.t0) * fraction_in_space(point.s, edge.depth0, edge.depth1);
}

bool CameraEdges::jump_at(const FilmEdgePoint& point, const Rng& key, RayCount& rays,
                          Rgb<double>& jump) const {
  const FilmEdge& edge = *point.edge;
  const double t = t_of(point);
  if (edge.clip != FilmEdge::kNoClip) {
    const ClipSegment& segment = clips_[edge.clip];
    const Vec3d a = value(segment.ends[0]), b = value(segment.ends[1]);
    return clip_difference(context_, segment, a + (b - a) * t, key, rays, jump);
  }
  const Camera& camera = context_.scene.camera;
  const EdgeMesh& mesh = input_.object(edge.id.object);
  const auto& ends = mesh.edge(edge.id.edge).vertices;
  const Vec3d y = mesh.position(ends[0]) * (1 - t) + mesh.position(ends[1]) * t;
  const LightOrigin origin =
      edge.in_line ? viewpoint_.aside(y) : viewpoint_.seeing(mesh.around(edge.id.edge), y);
  const Vec3d p = value(origin.v);
  EdgeView view;
  if (!view_edge(mesh, edge.id, t, p, view)) return false;
  const double cosine = dot(view.omega, value(camera.forward));
  return edge_difference(context_, mesh, view, {}, camera.near_clip / cosine,
                         camera.far_clip / cosine, 0, key, rays, jump, {},
                         edge.beside ? &*edge.beside : nullptr);
}

}  // namespace limn
