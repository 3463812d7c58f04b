// The boundary term of thin penumbras, see penumbra.h. With p(omega) what a viewer q sees in the
// direction omega and T the throughput to there, `direct` is
//   integral of T(omega) times the integral over edges of C(p(omega), t) dt domega,
// with C its integrand. Here a point e(t) of an edge is drawn first, then a line through it from a
// direction where region k lies; behind e it meets p, in whose direction omega its density is
//   pdf(line) (|n . line| / |p - e|^2) / (|n . omega| / |p - q|^2) :
// the estimate C over all densities stays bounded where lamp and distance vanish. The turn of
// directions at p is left to `direct`, also where the penumbra is thin.
#include <fmt/format.h>

#include <algorithm>

#include "integrators/terms/film_point.h"
#include "integrators/terms/penumbra.h"
#include "integrators/terms/term_table.h"
#include "integrators/terms/vertex_edges.h"

namespace limn {

double density_seen(const LightRegions& regions, const LampLine& line, const Vec3d& q) {
  const Vec3d through = line.e - line.p;
  const double behind = length(through);
  if (!(behind > 0)) return 0;
  const Vec3d omega = through / behind;
  const double pdf = regions.direction_pdf(line.region, line.e, omega);
  if (!(pdf > 0)) return 0;
  const Vec3d sight = line.p - q;
  const double distance = length(sight);
  const double seen = std::fabs(dot(line.n, sight)) / (distance * distance * distance);
  return pdf * std::fabs(dot(line.n, omega)) / (behind * behind * seen);
}

bool is_thin(const Camera& camera, const LightRegions& regions, const LampLine& line,
             const PathStep& step, int bounces) {
  if (bounces == 0) {
    const Vec3d pinhole = value(camera.origin);
    const double pixel = 1 / film_per_solid_angle(camera, normalize(line.p - pinhole));
    return density_seen(regions, line, pinhole) * pixel * kThinPenumbra > 1;
  }
  return step.pdf > 0 && density_seen(regions, line, step.from) * kThinPenumbra > step.pdf;
}

bool may_be_thin(const LightRegions& regions, size_t k, std::span<const FaceRef> faces_around) {
  if (!regions.lists_thin(k)) return false;
  return std::none_of(faces_around.begin(), faces_around.end(),
                      [&](FaceRef face) { return face.shape == regions.shape(k); });
}

namespace {

struct LampEdge {
  EdgeRef id;
  uint32_t region;
};

// What is seen of a region from around the scene: to weigh its edges by.
struct RegionSight {
  bool infinite;
  Vec3d v;        // center, or the direction towards it
  double radius;  // around the center; at infinity the sine of the angle
  double light;   // luminance times area; at infinity luminance times solid angle
};

class PenumbraTerm final : public Term {
 public:
  explicit PenumbraTerm(TermInput& input)
      : context_(input.context), edges_(input.edges()), regions_(*input.regions()) {
    const Stopwatch watch;
    Bounds bounds;
    for (const Shape& shape : context_.scene.shapes) {
      const Bounds b = bounds_of(shape.mesh);
      bounds.extend(b.lower);
      bounds.extend(b.upper);
    }
    reach_ = bounds.diagonal();
    std::vector<double> lengths;
    std::vector<Lanes> speeds;
    for (uint32_t k = 0; k < regions_.size(); ++k) list(k, lengths, speeds);
    weigh(lengths, speeds, input.lanes);
    list_seconds_ = watch.seconds();
  }

  bool uses_film() const override {
    const int max_depth = context_.scene.max_depth;
    return !listed_.empty() && (max_depth < 0 || max_depth > 1);
  }
  bool sample_film(double u, const Rng& key, RayCount& rays, FilmSample& sample) const override;
  bool uses_vertices() const override { return !listed_.empty(); }
  void add_at_vertex(const PathVertex& vertex, int samples, TermCost& cost,
                     Rgb<Lanes>& sum) const override {
    const int max_depth = context_.scene.max_depth;
    if (max_depth >= 0 && vertex.bounces + 2 >= max_depth) return;
    for (int i = 0; i < samples; ++i) {
      const Rng key = vertex.key.copy(Purpose::kShadowCopy, i);
      add_sample(vertex, key, cost, sum);
    }
  }
  void describe(GradientStats& stats) const override {
    stats.setup.emplace_back("edges before lamps", list_seconds_);
    stats.edges.emplace_back("before lamps", listed_.size());
  }

 private:
  RegionSight sight_of(uint32_t k) const;
  void list(uint32_t k, std::vector<double>& lengths, std::vector<Lanes>& speeds);
  void weigh(const std::vector<double>& lengths, const std::vector<Lanes>& speeds, int lanes);
  struct Drawn {
    EdgeRef edge;
    double t;
    double probability;  // of the edge
    FaceRef face;        // that the line meets
    LampLine line;
  };
  std::optional<Drawn> draw(double u, Rng rng, RayCount& rays) const;
  // The vertices before, at viewers that are not the camera.
  void add_sample(const PathVertex& viewer, const Rng& key, TermCost& cost, Rgb<Lanes>& sum) const;
  // What the drawn line adds for a path that comes along the ray with the throughput.
  void add(const Drawn& drawn, const Vec3<Dual>& origin, const Vec3<Dual>& direction,
           const Rgb<double>& throughput, double density, int bounces, const Rng& key,
           SampleLog* log, TermCost& cost, Rgb<Lanes>& sum) const;

  const PathContext& context_;
  const EdgeSamplerInput& edges_;
  const LightRegions& regions_;
  double reach_ = 0;  // the scene's diagonal
  std::vector<LampEdge> listed_;
  std::vector<double> cumulative_;  // of probabilities
  double list_seconds_ = 0;
};

RegionSight PenumbraTerm::sight_of(uint32_t k) const {
  if (!regions_.shape(k).valid()) {
    const DirectionCap& cap = regions_.cap(k);
    return {true, cap.axis, cap.sine, regions_.luminance(k) * cap.sine * cap.sine * kPi};
  }
  const LampHull& hull = regions_.hull(k);
  return {false, hull.center, hull.radius, regions_.luminance(k) * hull.area};
}

// Whether all of the region is on one side of the plane, and on which.
int side_of(const RegionSight& sight, const Plane& plane) {
  const double d = sight.infinite ? dot(plane.n, sight.v) : plane.distance(sight.v);
  const double slack = sight.radius * (1 + 1e-6) + (sight.infinite ? 1e-12 : 0);
  return d > slack ? 1 : d < -slack ? -1 : 0;
}

// Edges of two faces are left out where all of the region sees both from the same side: there, they
// are never silhouettes on a line from the region.
void PenumbraTerm::list(uint32_t k, std::vector<double>& lengths, std::vector<Lanes>& speeds) {
  if (!regions_.lists_thin(k)) return;
  const RegionSight sight = sight_of(k);
  for (uint32_t o = 0; o < edges_.objects.size(); ++o) {
    const EdgeMesh& mesh = edges_.objects[o];
    for (uint32_t i = 0; i < mesh.edges.size(); ++i) {
      const Edge& edge = mesh.edges[i];
      if (edge.edge_class <= EdgeClass::kSharp || edge.edge_class == EdgeClass::kFlat) {
        const int side = side_of(sight, mesh.plane(edge.faces[0]));
        if (side != 0 && side == side_of(sight, mesh.plane(edge.faces[1]))) continue;
      }
      if (!may_be_thin(regions_, k, mesh.faces_around(EdgeId(i)))) continue;
      const Vec3d x0 = mesh.position(edge.vertices[0]), x1 = mesh.position(edge.vertices[1]);
      const double edge_length = length(x1 - x0);
      const Vec3d w = sight.infinite ? sight.v * reach_ : 0.5 * (x0 + x1) - sight.v;
      const double distance = std::max(length(w), sight.infinite ? 0.0 : sight.radius);
      const double light = sight.infinite ? sight.light : sight.light / (distance * distance);
      const Vec3d normal = cross(w, x1 - x0);
      const double size = length(normal);
      Lanes speed;
      if (!mesh.tangents.empty() && size > 0) {
        for (const VertexId end : edge.vertices) {
          const Vec3<Lanes>& v = mesh.tangent(end);
          const Lanes across = v.x * normal.x + v.y * normal.y + v.z * normal.z;
          for (int lane = 0; lane < kLanes; ++lane) {
            speed[lane] = std::max(speed[lane], std::fabs(across[lane]) / (size * distance));
          }
        }
      }
      listed_.push_back({{ShapeId(o), EdgeId(i)}, k});
      lengths.push_back(light * edge_length / (distance + edge_length));
      speeds.push_back(speed);
    }
  }
}

// As for the edges of sharp shadows: half of the samples follow length times speed, half length
// alone, since a surface or a camera that moves makes all edges count. Not tuned.
void PenumbraTerm::weigh(const std::vector<double>& lengths, const std::vector<Lanes>& speeds,
                         int lanes) {
  double total = 0;
  Lanes swept;
  for (size_t i = 0; i < lengths.size(); ++i) {
    total += lengths[i];
    swept += speeds[i] * lengths[i];
  }
  double sum = 0;
  for (size_t i = 0; i < lengths.size(); ++i) {
    for (int k = 0; k < lanes; ++k) {
      const double own = lengths[i] / total;
      sum += own + (swept[k] > 0 ? speeds[i][k] * lengths[i] / swept[k] : own);
    }
    cumulative_.push_back(sum);
  }
}

std::optional<PenumbraTerm::Drawn> PenumbraTerm::draw(double u, Rng rng, RayCount& rays) const {
  const double target = u * cumulative_.back();
  const auto found = std::upper_bound(cumulative_.begin(), cumulative_.end(), target);
  const size_t index = std::min<size_t>(found - cumulative_.begin(), listed_.size() - 1);
  const double below = index == 0 ? 0 : cumulative_[index - 1];
  const auto [id, region] = listed_[index];

  const double t = rng.uniform(), u1 = rng.uniform(), u2 = rng.uniform();
  const EdgeMesh& mesh = edges_.object(id.object);
  const auto& ends = mesh.edge(id.edge).vertices;
  const Vec3d e = mesh.position(ends[0]) * (1 - t) + mesh.position(ends[1]) * t;
  const auto omega = regions_.draw_direction(region, e, u1, u2);
  if (!omega) return {};
  Ray ray{e, -*omega};
  ray.skip_faces = mesh.faces_around(id.edge);
  Hit hit;
  ++rays.closest;
  if (!context_.tracer.closest(ray, hit)) return {};
  const auto corners =
      face_corners<double>(context_.scene.shape(hit.face.shape).mesh, hit.face.face);
  const Vec3d n = normalize(cross(corners[1] - corners[0], corners[2] - corners[0]));
  // More exactly than the ray's floats.
  const Vec3d p = e - *omega * (dot(n, e - corners[0]) / dot(n, *omega));
  return Drawn{
      id, t, (cumulative_[index] - below) / cumulative_.back(), hit.face, {region, e, p, n}};
}

bool PenumbraTerm::sample_film(double u, const Rng& key, RayCount& rays, FilmSample& sample) const {
  const auto drawn = draw(u, key.at(Purpose::kShadow, 0), rays);
  if (!drawn) return false;
  const auto seen = film_point(context_.scene, drawn->face, drawn->line.p);
  if (!seen || !is_thin(context_.scene.camera, regions_, drawn->line, {}, 0)) return false;
  if (is_hidden(context_, *seen, drawn->face, rays)) return false;
  const Vec3d q = value(seen->ray.origin);
  const double density = density_seen(regions_, drawn->line, q) /
                         film_per_solid_angle(context_.scene.camera, seen->omega);
  TermCost cost;
  Rgb<Lanes> sum;
  add(*drawn, seen->ray.origin, seen->ray.direction, grey(1.0), density, 0, key, nullptr, cost,
      sum);
  rays.closest += cost.rays - cost.shadow_rays;
  rays.shadow += cost.shadow_rays;
  sample = {seen->x, seen->y, sum};
  return cost.counted > 0;
}

void PenumbraTerm::add_sample(const PathVertex& viewer, const Rng& key, TermCost& cost,
                              Rgb<Lanes>& sum) const {
  ++cost.samples;
  RayCount rays;
  Rng rng = key.at(Purpose::kShadow, viewer.bounces);
  const double u = rng.uniform();
  const auto drawn = draw(u, rng, rays);
  cost.add(rays);
  if (!drawn) {
    ++cost.no_edge;
    return;
  }
  const Vec3d q = value(viewer.surface.p);
  const Vec3d to = drawn->line.p - q;
  const double distance = length(to);
  const bool apart = distance > 0 && drawn->face != viewer.surface.face;
  const Vec3d omega = apart ? to / distance : Vec3d{};
  const double pdf = apart ? viewer.scattering.pdf_solid_angle(omega) : 0;
  const Rgb<double> f = pdf > 0 ? value(viewer.scattering.eval(omega)) : Rgb<double>{};
  const int bounces = viewer.bounces + 1;
  if (is_black(f) || !is_thin(context_.scene.camera, regions_, drawn->line, {q, pdf}, bounces)) {
    ++cost.zero_weight;
    return;
  }
  Ray ray{q, omega};
  ray.start = viewer.surface.face;
  ray.skip_faces = {&drawn->face, 1};
  ray.t_max = distance * (1 - 0x1p-20);  // as shadow rays end
  cost.add(RayCount{0, 1});
  if (context_.tracer.occluded(ray)) {
    ++cost.occluded;
    return;
  }
  if (viewer.log) {
    viewer.log->push_back(fmt::format(
        "  penumbra on face {} of shape {}:", drawn->face.face.index(), drawn->face.shape.index()));
  }
  add(*drawn, viewer.surface.p, DirectionMotion{viewer.turn}.moving(omega), viewer.throughput * f,
      density_seen(regions_, drawn->line, q), bounces, key, viewer.log, cost, sum);
}

void PenumbraTerm::add(const Drawn& drawn, const Vec3<Dual>& origin, const Vec3<Dual>& direction,
                       const Rgb<double>& throughput, double density, int bounces, const Rng& key,
                       SampleLog* log, TermCost& cost, Rgb<Lanes>& sum) const {
  const Scene& scene = context_.scene;
  const auto surface = surface_on_ray<Dual>(scene, drawn.face, origin, direction);
  const Scattering<Dual> scattering(surface, -direction, scene.shading);
  if (scattering.black()) return;
  const PathVertex vertex{surface, scattering, throughput, {}, bounces, {}, key, log};
  add_edge_point(context_, edges_.object(drawn.edge.object), vertex, query_at(vertex),
                 {drawn.edge, drawn.t, drawn.probability * density, 1},
                 {&regions_, drawn.line.region}, key, cost, sum);
}

}  // namespace

std::unique_ptr<Term> make_penumbra_term(TermInput& input) {
  return std::make_unique<PenumbraTerm>(input);
}

}  // namespace limn
