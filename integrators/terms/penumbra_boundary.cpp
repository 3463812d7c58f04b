// The boundary term of penumbras that are thin on the film, see penumbra.h. At the first vertices p(s)
// of paths, s a position on the film with filter h, `direct` is
//   integral over the film of h(s) times the integral over edges of C(p(s), t) dt ds,
// with C its integrand. Here a point e(t) of an edge is drawn first, then a line through it from a
// direction where region k lies; behind e it meets p, whose film position has the density
//   pdf(omega) |n_p . omega| / |p - e|^2 / (ds / dA_p) :
// the estimate C over all densities stays bounded where lamp and distance vanish. It holds the turn
// of directions at p at rest, which is left to `direct` where the penumbra is thin.
#include <fmt/format.h>

#include <algorithm>

#include "integrators/terms/film_point.h"
#include "integrators/terms/penumbra.h"
#include "integrators/terms/term_table.h"
#include "integrators/terms/vertex_edges.h"

namespace limn {

double film_density_through(const Camera& camera, const LightRegions& regions, size_t k,
                            const Vec3d& e, const Vec3d& p, const Vec3d& n_g) {
  const Vec3d through = e - p;
  const double behind = length(through);
  if (!(behind > 0)) return 0;
  const Vec3d omega = through / behind;
  const double pdf = regions.direction_pdf(k, e, omega);
  if (!(pdf > 0)) return 0;
  const Vec3d sight = p - value(camera.origin);
  const double distance = length(sight);
  const double film = film_per_solid_angle(camera, sight / distance) * std::fabs(dot(n_g, sight)) /
                      (distance * distance * distance);
  return pdf * std::fabs(dot(n_g, omega)) / (behind * behind * film);
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
  void describe(GradientStats& stats) const override {
    stats.setup.emplace_back("edges before lamps", list_seconds_);
    stats.edges.emplace_back("before lamps", listed_.size());
  }

 private:
  RegionSight sight_of(uint32_t k) const;
  void list(uint32_t k, std::vector<double>& lengths, std::vector<Lanes>& speeds);
  void weigh(const std::vector<double>& lengths, const std::vector<Lanes>& speeds, int lanes);
  // The vertex of a path that starts at the film point on the face, and what it gets through the
  // point of the edge.
  Rgb<Lanes> at_vertex(const FilmPoint& seen, FaceRef face, const EdgeRef& edge, double t,
                       uint32_t region, double probability, const Rng& key, RayCount& rays) const;

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

bool PenumbraTerm::sample_film(double u, const Rng& key, RayCount& rays, FilmSample& sample) const {
  const double target = u * cumulative_.back();
  const auto found = std::upper_bound(cumulative_.begin(), cumulative_.end(), target);
  const size_t index = std::min<size_t>(found - cumulative_.begin(), listed_.size() - 1);
  const double below = index == 0 ? 0 : cumulative_[index - 1];
  const double probability = (cumulative_[index] - below) / cumulative_.back();
  const auto [id, region] = listed_[index];

  Rng rng = key.at(Purpose::kShadow, 0);
  const double t = rng.uniform(), u1 = rng.uniform(), u2 = rng.uniform();
  const EdgeMesh& mesh = edges_.object(id.object);
  const auto& ends = mesh.edge(id.edge).vertices;
  const Vec3d e = mesh.position(ends[0]) * (1 - t) + mesh.position(ends[1]) * t;
  const auto omega = regions_.draw_direction(region, e, u1, u2);
  if (!omega) return false;
  Ray ray{e, -*omega};
  ray.skip_faces = mesh.faces_around(id.edge);
  Hit hit;
  ++rays.closest;
  if (!context_.tracer.closest(ray, hit)) return false;
  for (const FaceRef face : ray.skip_faces) {
    if (face == hit.face) return false;
  }
  const auto corners =
      face_corners<double>(context_.scene.shape(hit.face.shape).mesh, hit.face.face);
  const Vec3d n = cross(corners[1] - corners[0], corners[2] - corners[0]);
  const Vec3d x = e - *omega * (dot(n, e - corners[0]) / dot(n, *omega));
  const auto seen = film_point(context_.scene, hit.face, x);
  if (!seen) return false;
  const double density =
      film_density_through(context_.scene.camera, regions_, region, e, x, normalize(n));
  if (!is_thin(density) || is_hidden(context_, *seen, hit.face, rays)) return false;
  sample.x = seen->x;
  sample.y = seen->y;
  sample.value = at_vertex(*seen, hit.face, id, t, region, probability * density, key, rays);
  return !is_zero(sample.value.r) || !is_zero(sample.value.g) || !is_zero(sample.value.b);
}

Rgb<Lanes> PenumbraTerm::at_vertex(const FilmPoint& seen, FaceRef face, const EdgeRef& edge,
                                   double t, uint32_t region, double probability, const Rng& key,
                                   RayCount& rays) const {
  const Scene& scene = context_.scene;
  const auto surface = surface_on_ray<Dual>(scene, face, seen.ray.origin, seen.ray.direction);
  const Scattering<Dual> scattering(surface, -seen.ray.direction, scene.shading);
  if (scattering.black()) return {};
  const Rgb<double> all = grey(1.0);
  const PathVertex vertex{surface, scattering, all, {}, 0, key};
  TermCost cost;
  Rgb<Lanes> sum;
  add_edge_point(context_, edges_.object(edge.object), vertex, query_at(vertex),
                 {edge, t, probability, 1}, {&regions_, region}, key, cost, sum);
  rays.closest += cost.rays - cost.shadow_rays;
  rays.shadow += cost.shadow_rays;
  return sum;
}

}  // namespace

std::unique_ptr<Term> make_penumbra_term(TermInput& input) {
  return std::make_unique<PenumbraTerm>(input);
}

}  // namespace limn
