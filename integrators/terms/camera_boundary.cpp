// The boundary term of the camera: edges seen from the pinhole, and curves where its clip planes cut
// faces, listed once, sampled on the film.
//   dI_j/dtheta  +=  integral along the projected edges of h_j(s) dL v_n dl,
// with s the film position [pixels], dl its length element, v_n = ds/dtheta . n the normal speed of
// the projected edge, and dL the radiance behind the normal n minus that before it.

#include <algorithm>
#include <vector>

#include "integrators/terms/clip_curves.h"
#include "integrators/terms/edge_jump.h"
#include "integrators/terms/term_table.h"

namespace limn {
namespace {

constexpr uint32_t kNoClip = UINT32_MAX;

struct FilmEdge {
  EdgeRef id;
  uint32_t clip = kNoClip;  // the clip segment that it is, in the place of an edge
  double t0, t1;            // the part of the edge that may reach the film
  double depth0, depth1;    // depths of its two ends
  double x0, y0, x1, y1;    // their film positions
  Lanes speed0, speed1;     // v_n there [pixels]; n points to the positive side of EdgeView::side
  double length;            // [pixels]
};

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

double weighted_speed(const FilmEdge& edge, int lane) {
  return edge.length * std::max(std::fabs(edge.speed0[lane]), std::fabs(edge.speed1[lane]));
}

class CameraTerm final : public Term {
 public:
  explicit CameraTerm(TermInput& input)
      : context_(input.context),
        input_(input.edges()),
        clips_(find_clip_segments(input.context.scene)) {
    const Stopwatch watch;
    for (uint32_t o = 0; o < input_.objects.size(); ++o) add_object(ShapeId(o));
    for (uint32_t c = 0; c < clips_.size(); ++c) add_clip(c);
    weigh(input.lanes);
    list_seconds_ = watch.seconds();
  }

  bool uses_film() const override { return !edges_.empty(); }
  bool sample_film(double u, const Rng& key, RayCount& rays, FilmSample& sample) const override;
  void describe(GradientStats& stats) const override {
    stats.setup.emplace_back("edges on the film", list_seconds_);
    stats.edges.emplace_back("moving on the film", edges_.size());
  }

 private:
  void add_object(ShapeId object);
  void add_clip(uint32_t index);
  void add_if_moving(const FilmEdge& edge) {
    if (!is_zero(edge.speed0) || !is_zero(edge.speed1)) edges_.push_back(edge);
  }
  // Whether all faces around the edge are emitters that the camera does not see.
  bool is_hidden(const EdgeMesh& mesh, EdgeId edge) const {
    if (!context_.scene.hide_emitters) return false;
    const auto faces = mesh.faces_around(edge);
    return std::all_of(faces.begin(), faces.end(), [&](const FaceRef face) {
      return context_.scene.shape(face.shape).is_emitter;
    });
  }
  bool clip_and_project(EdgeRef id, FilmEdge& edge) const;
  bool clip_to_window(double x0, double x1, double y0, double y1, double& s0, double& s1) const {
    const Window window = sampled_window(context_.scene.film);
    return clip(x0, x1 - x0, window.x0, window.x1, s0, s1) &&
           clip(y0, y1 - y0, window.y0, window.y1, s0, s1);
  }
  bool place_on_film(const Vec3<Dual>& x0, const Vec3<Dual>& x1, const Vec3d& side,
                     FilmEdge& edge) const;
  bool jump_at(const FilmEdge& edge, double s, const Rng& key, RayCount& rays,
               Rgb<double>& jump) const;
  void weigh(int lanes);

  const PathContext& context_;
  const EdgeSamplerInput& input_;
  std::vector<ClipSegment> clips_;
  std::vector<FilmEdge> edges_;
  std::vector<double> cumulative_;  // probabilities of the edges, summed
  double list_seconds_ = 0;
};

void CameraTerm::add_object(ShapeId object) {
  const EdgeMesh& mesh = input_.object(object);
  const Vec3d pinhole = value(context_.scene.camera.origin);
  for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
    const EdgeRef id{object, EdgeId(e)};
    FilmEdge edge;
    if (!is_candidate(mesh, id.edge, pinhole) || is_hidden(mesh, id.edge)) continue;
    if (clip_and_project(id, edge)) add_if_moving(edge);
  }
}

void CameraTerm::add_clip(uint32_t index) {
  const auto& [a, b] = clips_[index].ends;
  const Camera& camera = context_.scene.camera;
  const auto film_a = camera.project(value(a));
  const auto film_b = camera.project(value(b));
  FilmEdge edge;
  edge.clip = index;
  edge.t0 = 0;
  edge.t1 = 1;
  // The plane is parallel to the film: fractions are the same on both.
  if (!clip_to_window(film_a.x, film_b.x, film_a.y, film_b.y, edge.t0, edge.t1)) return;
  const auto at = [&](double t) { return a + (b - a) * t; };
  Vec3d side = cross(value(a) - value(camera.origin), value(b) - value(camera.origin));
  if (dot(side, clips_[index].into_view) < 0) side = -side;
  if (place_on_film(at(edge.t0), at(edge.t1), side, edge)) add_if_moving(edge);
}

bool CameraTerm::clip_and_project(EdgeRef id, FilmEdge& edge) const {
  const EdgeMesh& mesh = input_.object(id.object);
  const Camera& camera = context_.scene.camera;
  const auto& ends = mesh.edge(id.edge).vertices;
  const Vec3d a = mesh.position(ends[0]);
  const Vec3d b = mesh.position(ends[1]);
  const double depth_a = camera.depth(a);
  const double depth_b = camera.depth(b);
  double t0 = 0;
  double t1 = 1;
  if (!clip(depth_a, depth_b - depth_a, camera.near_clip, camera.far_clip, t0, t1)) return false;

  const auto at = [&](double t) { return a + (b - a) * t; };
  const auto film0 = camera.project(at(t0));
  const auto film1 = camera.project(at(t1));
  const double z0 = camera.depth(at(t0));
  const double z1 = camera.depth(at(t1));
  double s0 = 0;
  double s1 = 1;
  if (!clip_to_window(film0.x, film1.x, film0.y, film1.y, s0, s1)) return false;

  edge.id = id;
  edge.t0 = t0 + (t1 - t0) * fraction_in_space(s0, z0, z1);
  edge.t1 = t0 + (t1 - t0) * fraction_in_space(s1, z0, z1);
  const auto moving = [&](double t) {
    const Vec3d x = at(t);
    Vec3<Dual> result{x.x, x.y, x.z};
    if (!mesh.tangents.empty()) {
      const Vec3<Lanes> d = mesh.tangent(ends[0]) * (1 - t) + mesh.tangent(ends[1]) * t;
      result = {{x.x, d.x}, {x.y, d.y}, {x.z, d.z}};
    }
    return result;
  };
  const Vec3d pinhole = value(camera.origin);
  return place_on_film(moving(edge.t0), moving(edge.t1), cross(a - pinhole, b - pinhole), edge);
}

// From the ends of what reaches the film. side: the normal of the plane through it and the pinhole, to
// the positive side.
bool CameraTerm::place_on_film(const Vec3<Dual>& x0, const Vec3<Dual>& x1, const Vec3d& side,
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

// Projected length times speed: exact but for the jump itself. Every parameter gets an equal
// share of the samples, whatever its unit.
void CameraTerm::weigh(int lanes) {
  Lanes totals;
  for (const FilmEdge& edge : edges_) {
    for (int k = 0; k < lanes; ++k) totals[k] += weighted_speed(edge, k);
  }
  double sum = 0;
  for (const FilmEdge& edge : edges_) {
    for (int k = 0; k < lanes; ++k) {
      if (totals[k] > 0) sum += weighted_speed(edge, k) / totals[k];
    }
    cumulative_.push_back(sum);
  }
}

bool CameraTerm::sample_film(double u, const Rng& key, RayCount& rays, FilmSample& sample) const {
  const double target = u * cumulative_.back();
  const auto found = std::upper_bound(cumulative_.begin(), cumulative_.end(), target);
  const size_t index = std::min<size_t>(found - cumulative_.begin(), edges_.size() - 1);
  const double below = index == 0 ? 0 : cumulative_[index - 1];
  const double weight = cumulative_[index] - below;
  const double s = std::clamp((target - below) / weight, 0.0, 1.0);

  const FilmEdge& edge = edges_[index];
  Rgb<double> jump;
  if (!jump_at(edge, s, key, rays, jump)) return false;
  sample.x = edge.x0 + (edge.x1 - edge.x0) * s;
  sample.y = edge.y0 + (edge.y1 - edge.y0) * s;
  const double density = weight / (cumulative_.back() * edge.length);
  const Lanes speed = (edge.speed0 * (1 - s) + edge.speed1 * s) / density;
  sample.value = {speed * jump.r, speed * jump.g, speed * jump.b};
  return true;
}

bool CameraTerm::jump_at(const FilmEdge& edge, double s, const Rng& key, RayCount& rays,
                         Rgb<double>& jump) const {
  const double t = edge.t0 + (edge.t1 - edge.t0) * fraction_in_space(s, edge.depth0, edge.depth1);
  if (edge.clip != kNoClip) {
    const ClipSegment& segment = clips_[edge.clip];
    const Vec3d a = value(segment.ends[0]), b = value(segment.ends[1]);
    return clip_jump(context_, segment, a + (b - a) * t, key, rays, jump);
  }
  const Camera& camera = context_.scene.camera;
  const EdgeMesh& mesh = input_.object(edge.id.object);
  EdgeView view;
  if (!view_edge(mesh, edge.id, t, value(camera.origin), view)) return false;
  const double cosine = dot(view.omega, value(camera.forward));
  return edge_jump(context_, mesh, view, {}, camera.near_clip / cosine, camera.far_clip / cosine, 0,
                   key, rays, jump);
}

}  // namespace

std::unique_ptr<Term> make_camera_term(TermInput& input) {
  return std::make_unique<CameraTerm>(input);
}

}  // namespace limn
