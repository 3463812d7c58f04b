// The boundary term of delta lights: the edges of their sharp shadows, listed as seen from the light
// and seen in turn by the camera and by the vertices of paths.
//
// A point, or parallel light, lights all or nothing of a surface: radiance jumps where a plane
// through the light and an edge of the mesh meets what lies behind the edge. With y(t) =
// (1 - t) y0 + t y1 a point of the edge, w(t) the direction in which light passes through it (y - l
// for a light at l, the direction d of parallel light) and N = w(0) x (y1 - y0), the function
//   G(x) = N . (x - y0)
// changes sign on that plane. From a viewer q in the fixed direction omega a surface is met at
// x(omega), and the derivative of the integral of f L H(G) over directions holds
//   integral of  f dL dG/dtheta delta(G) domega,
// where dL is the light's share of the radiance that leaves x towards q, positive if the side G > 0
// is lit, and dG/dtheta carries the motion of light, edge, viewer and of the surface at x. With n
// the normal at x, r = |x - q| and cos_x = n . omega,
//   delta(G) domega = m(t) |cos_x| / r^2 dt,   m(t) = |x - l| / (|w| |n . w|),   1 / |n . d| at
// infinity, which follows from dx/dt = m n x (dw/dt x w) (and |n x N| is G's slope on the surface).
#include <fmt/format.h>

#include <algorithm>

#include "integrators/terms/film_point.h"
#include "integrators/terms/term_table.h"
#include "integrators/terms/vertex_edges.h"

namespace limn {
namespace {

// An edge that parts light from shadow, as seen from one light.
struct ShadowEdge {
  const DeltaLight* light;
  EdgeRef id;
  double sign;   // 1: the side G > 0 is lit; -1: the other
  double angle;  // how long it is as seen from the light [rad]; at infinity [scene units]
  Lanes speed;   // how fast its shadow moves, as seen from the light; only edge and light count
};

// Where the shadow of a point of an edge falls.
struct ShadowPoint {
  FaceRef face;
  Vec3d x;
  double m;  // see above
};

// A ray from a viewer that meets the shadow's edge.
struct Viewer {
  Vec3<Dual> origin;
  Vec3<Dual> direction;  // unit; held fixed, or turning with the camera or the directions of a path
  double distance;       // to the shadow's edge
};

// Which sides of the plane through light and edge the faces around the edge lie on. A face that is
// seen edge-on, to the rounding of the determinant, casts no shadow of its own.
double lit_side(const Scene& scene, const EdgeMesh& edges, EdgeId edge, const LightOrigin& light) {
  const auto& ends = edges.edge(edge).vertices;
  const Vec3d x0 = edges.position(ends[0]);
  const Vec3d along = edges.position(ends[1]) - x0;
  const Vec3d w = light.through(x0);
  const Vec3d n = cross(w, along);
  const double scale = 8 * 0x1p-53 * length(w) * length(along);
  const FacesAround around = edges.around(edge);
  const uint8_t own = edges.edge(edge).rim;
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
      const Vec3d into =
          direction_into_face(scene.shape(face.shape).mesh, face.face, x0, normalize(along));
      order.add(incidence.rim, positive, dot(into, w) / std::fabs(dot(into, n)));
    });
  }
  for_every_face([&](FaceRef, Incidence incidence, bool positive) {
    for (const bool place : {false, true}) {
      if (incidence.through || order.is_seen(incidence.rim, positive, own, place))
        blocked[place] = true;
    }
  });
  return blocked[0] == blocked[1] ? 0 : blocked[0] ? 1 : -1;
}

Vec3<Dual> moving_vertex(const EdgeMesh& mesh, VertexId vertex) {
  const Vec3d& x = mesh.position(vertex);
  if (mesh.tangents.empty()) return {x.x, x.y, x.z};
  const Vec3<Lanes>& d = mesh.tangent(vertex);
  return {{x.x, d.x}, {x.y, d.y}, {x.z, d.z}};
}

class ShadowTerm final : public Term {
 public:
  explicit ShadowTerm(TermInput& input) : context_(input.context), input_(input.edges()) {
    const Stopwatch watch;
    Bounds bounds;
    for (const Shape& shape : context_.scene.shapes) {
      const Bounds b = bounds_of(shape.mesh);
      bounds.extend(b.lower);
      bounds.extend(b.upper);
    }
    reach_ = 2 * bounds.diagonal();
    for (const auto& light : context_.scene.delta_lights) {
      const size_t first = edges_.size();
      for (uint32_t o = 0; o < input_.objects.size(); ++o) list(*light, ShapeId(o));
      weigh(first, input.lanes);
    }
    list_seconds_ = watch.seconds();
  }

  bool uses_vertices() const override { return !edges_.empty(); }
  void add_at_vertex(const PathVertex& vertex, int samples, TermCost& cost,
                     Rgb<Lanes>& sum) const override {
    const int max_depth = context_.scene.max_depth;
    if (max_depth >= 0 && vertex.bounces + 2 >= max_depth) return;
    for (int i = 0; i < samples; ++i) {
      const Rng key = vertex.key.copy(Purpose::kShadowCopy, i);
      add_sample(vertex, key.at(Purpose::kShadow, vertex.bounces), cost, sum);
    }
  }

  bool uses_film() const override {
    const int max_depth = context_.scene.max_depth;
    return !edges_.empty() && (max_depth < 0 || max_depth > 1);
  }
  bool sample_film(double u, const Rng& key, RayCount& rays, FilmSample& sample) const override;

  void describe(GradientStats& stats) const override {
    stats.setup.emplace_back("edges of sharp shadows", list_seconds_);
    stats.edges.emplace_back("of sharp shadows", edges_.size());
  }

 private:
  void list(const DeltaLight& light, ShapeId object);
  void weigh(size_t first, int lanes);
  // The edge at u in [0, 1), and its probability.
  const ShadowEdge& choose(double u, double& probability) const;
  std::optional<ShadowPoint> cast(const ShadowEdge& edge, double t, RayCount& rays) const;
  // dL of the point as it is seen along the unit direction omega.
  Rgb<double> jump(const ShadowEdge& edge, const ShadowPoint& point, const Vec3d& q,
                   const Vec3d& omega) const;
  // dG/dtheta times delta(G) domega / dt.
  Lanes sweep(const ShadowEdge& edge, const ShadowPoint& point, const Viewer& viewer) const;
  void add_sample(const PathVertex& vertex, Rng rng, TermCost& cost, Rgb<Lanes>& sum) const;

  const PathContext& context_;
  const EdgeSamplerInput& input_;
  double reach_ = 0;  // longer than any line through the scene
  std::vector<ShadowEdge> edges_;
  std::vector<double> cumulative_;  // probabilities of the edges, summed
  double list_seconds_ = 0;
};

void ShadowTerm::list(const DeltaLight& light, ShapeId object) {
  const EdgeMesh& mesh = input_.object(object);
  const LightOrigin origin = light.origin();
  for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
    ShadowEdge edge{&light, {object, EdgeId(e)}, 0, 0, {}};
    edge.sign = lit_side(context_.scene, mesh, edge.id.edge, origin);
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

// Half of the samples follow length times speed, half length alone: a surface or a viewer that moves
// makes all shadows count. Every light and every parameter gets an equal share. Not tuned.
void ShadowTerm::weigh(size_t first, int lanes) {
  double length = 0;
  Lanes swept;
  for (size_t i = first; i < edges_.size(); ++i) {
    length += edges_[i].angle;
    swept += edges_[i].speed * edges_[i].angle;
  }
  double sum = cumulative_.empty() ? 0 : cumulative_.back();
  for (size_t i = first; i < edges_.size(); ++i) {
    const ShadowEdge& edge = edges_[i];
    for (int k = 0; k < lanes; ++k) {
      sum += edge.angle / length;
      sum += swept[k] > 0 ? edge.speed[k] * edge.angle / swept[k] : edge.angle / length;
    }
    cumulative_.push_back(sum);
  }
}

const ShadowEdge& ShadowTerm::choose(double u, double& probability) const {
  const double target = u * cumulative_.back();
  const auto found = std::upper_bound(cumulative_.begin(), cumulative_.end(), target);
  const size_t index = std::min<size_t>(found - cumulative_.begin(), edges_.size() - 1);
  const double below = index == 0 ? 0 : cumulative_[index - 1];
  probability = (cumulative_[index] - below) / cumulative_.back();
  return edges_[index];
}

std::optional<ShadowPoint> ShadowTerm::cast(const ShadowEdge& edge, double t,
                                            RayCount& rays) const {
  const EdgeMesh& mesh = input_.object(edge.id.object);
  const auto& ends = mesh.edge(edge.id.edge).vertices;
  const Vec3d y = mesh.position(ends[0]) * (1 - t) + mesh.position(ends[1]) * t;
  const LightOrigin origin = edge.light->origin();
  const Vec3d w = origin.through(y);
  const double w_length = length(w);
  const double before = origin.infinite ? reach_ : w_length;  // of the ray, up to y
  Ray ray{y - w * (before / w_length), w / w_length};
  ray.skip_faces = mesh.faces_around(edge.id.edge);
  Hit hit;
  ++rays.closest;
  // Where the edge touches what it shades, to a float's rounding, the shadow starts behind the edge
  // for every viewer, who sees the edge itself.
  if (!context_.tracer.closest(ray, hit) || hit.t <= before * (1 + 0x1p-20)) return {};
  const auto c = face_corners<double>(context_.scene.shape(hit.face.shape).mesh, hit.face.face);
  const Vec3d n = normalize(cross(c[1] - c[0], c[2] - c[0]));
  const double slope = dot(n, w);
  const double s = dot(n, c[0] - y) / slope;
  const double m = (origin.infinite ? 1 : 1 + s) / std::fabs(slope);
  if (!std::isfinite(m)) return {};
  return ShadowPoint{hit.face, y + w * s, m};
}

Rgb<double> ShadowTerm::jump(const ShadowEdge& edge, const ShadowPoint& point, const Vec3d& q,
                             const Vec3d& omega) const {
  const Scene& scene = context_.scene;
  const auto surface = surface_on_ray<double>(scene, point.face, q, omega);
  const Scattering<double> scattering(surface, -omega, scene.shading);
  const auto arrival = edge.light->arriving(point.x);
  if (scattering.black() || !arrival) return {};
  return scattering.eval(arrival->wo) * arrival->irradiance * edge.sign;
}

Lanes ShadowTerm::sweep(const ShadowEdge& edge, const ShadowPoint& point,
                        const Viewer& viewer) const {
  const EdgeMesh& mesh = input_.object(edge.id.object);
  const auto& ends = mesh.edge(edge.id.edge).vertices;
  const Vec3<Dual> y0 = moving_vertex(mesh, ends[0]);
  const Vec3<Dual> normal =
      cross(edge.light->origin().through(y0), moving_vertex(mesh, ends[1]) - y0);
  const auto x = surface_on_ray<Dual>(context_.scene, point.face, viewer.origin, viewer.direction);
  const double cosine = std::fabs(dot(x.n_g, value(viewer.direction)));
  return dot(normal, x.p - y0).d * (point.m * cosine / (viewer.distance * viewer.distance));
}

void ShadowTerm::add_sample(const PathVertex& vertex, Rng rng, TermCost& cost,
                            Rgb<Lanes>& sum) const {
  ++cost.samples;
  double probability;
  const ShadowEdge& edge = choose(rng.uniform(), probability);
  RayCount rays;
  const auto point = cast(edge, rng.uniform(), rays);
  cost.add(rays);
  if (!point) {
    ++cost.occluded;
    return;
  }
  const Vec3d q = value(vertex.surface.p);
  const double distance = length(point->x - q);
  const Vec3d omega = (point->x - q) / distance;
  const bool apart = distance > 0 && point->face != vertex.surface.face;
  const Rgb<double> f = apart ? value(vertex.scattering.eval(omega)) : Rgb<double>{};
  if (is_black(f)) {
    ++cost.zero_weight;
    return;
  }
  const Lanes swept =
      sweep(edge, *point, {vertex.surface.p, turning(omega, vertex.turn), distance});
  const Rgb<double> amount = vertex.throughput * f * jump(edge, *point, q, omega);
  if (is_zero(swept) || is_black(amount)) {
    ++cost.zero_weight;
    return;
  }
  if (is_hidden_from(context_, vertex, point->face, omega, distance, cost)) {
    ++cost.occluded;
    return;
  }
  ++cost.counted;
  const Lanes weight = swept * (1 / probability);
  const Rgb<Lanes> added{weight * amount.r, weight * amount.g, weight * amount.b};
  if (TurnedVertex* turned = vertex.turned) {
    // What does not turn is in both.
    const Vec3<Lanes>& v = turned->velocity;
    const Viewer turns{
        {{q.x, v.x}, {q.y, v.y}, {q.z, v.z}}, turning(omega, turned->turn), distance};
    const Viewer rests{{q.x, q.y, q.z}, turning(omega, {}), distance};
    const Lanes of_turns = sweep(edge, *point, turns) - sweep(edge, *point, rests);
    for (int c = 0; c < 3; ++c) turned->sum[c] += of_turns * (amount[c] / probability);
  }
  if (vertex.log) {
    vertex.log->push_back(fmt::format(
        "  shadow of edge {} of shape {} on face {} of shape {}: probability {:.4g}, adds "
        "({:.6g}, {:.6g}, {:.6g}) to the first parameter",
        edge.id.edge.index(), edge.id.object.index(), point->face.face.index(),
        point->face.shape.index(), probability, added.r[0], added.g[0], added.b[0]));
  }
  sum = sum + added;
}

bool ShadowTerm::sample_film(double u, const Rng& key, RayCount& rays, FilmSample& sample) const {
  double probability;
  const ShadowEdge& edge = choose(u, probability);
  const auto point = cast(edge, key.at(Purpose::kShadow, 0).uniform(), rays);
  if (!point) return false;
  const auto seen = film_point(context_.scene, point->face, point->x);
  if (!seen) return false;
  const Lanes swept = sweep(edge, *point, {seen->ray.origin, seen->ray.direction, seen->distance});
  const Rgb<double> amount = jump(edge, *point, value(seen->ray.origin), seen->omega);
  if (is_zero(swept) || is_black(amount)) return false;
  if (is_hidden(context_, *seen, point->face, rays)) return false;
  sample.x = seen->x;
  sample.y = seen->y;
  const Lanes weight =
      swept * (film_per_solid_angle(context_.scene.camera, seen->omega) / probability);
  sample.value = {weight * amount.r, weight * amount.g, weight * amount.b};
  return true;
}

}  // namespace

std::unique_ptr<Term> make_shadow_term(TermInput& input) {
  return std::make_unique<ShadowTerm>(input);
}

}  // namespace limn
