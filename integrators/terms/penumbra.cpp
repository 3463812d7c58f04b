// Which edges lines from emitters pass, and who finds what they add.
#include "integrators/terms/penumbra.h"

#include <algorithm>
#include <bit>

#include "integrators/lights/light_regions.h"
#include "integrators/terms/seen_vertex.h"

namespace limn {

EmitterEdges::EmitterEdges(const Scene& scene, const EdgeSamplerInput& edges,
                           const LightRegions& regions, int lanes)
    : edges_(edges), lanes_(lanes) {
  reach_ = bounds_of(scene).diagonal();
  list(regions);
}

void EmitterEdges::list(const LightRegions& regions) {
  size_t blocks = 0;
  for (const EdgeMesh& object : edges_.objects) {
    first_block_.push_back(blocks);
    blocks += object.edges.size() / 64 + 1;
  }
  std::vector<Weight> weights;
  for (size_t k = 0; k < regions.size(); ++k) {
    sights_.push_back(sight_of(regions, k));
    emitters_.push_back(regions.shape(k));
    if (!sights_.back().listed) continue;
    sights_.back().first_block = blocks_.size();
    blocks_.resize(blocks_.size() + blocks);
    for (uint32_t o = 0; o < edges_.objects.size(); ++o) list_object(k, ShapeId(o), weights);
  }
  double sum = 0;
  for (size_t i = 0; i < listed_.size(); ++i) {
    listed_[i].probability = share_of(weights[i]);
    cumulative_.push_back(sum += listed_[i].probability);
  }
  uint32_t found = 0;
  for (size_t i = 0; i < listed_.size(); ++i) {
    const double target = static_cast<double>(i) / static_cast<double>(listed_.size()) * sum;
    while (found + 1 < listed_.size() && cumulative_[found] <= target) ++found;
    guide_.push_back(found);
  }
}

void EmitterEdges::list_object(size_t k, ShapeId object, std::vector<Weight>& weights) {
  const size_t count = edges_.object(object).edges.size();
  Block* block = &blocks_[sights_[k].first_block + first_block_[object.index()]];
  block->before = static_cast<uint32_t>(listed_.size());
  for (uint32_t e = 0; e < count; ++e) {
    if (e > 0 && e % 64 == 0) (++block)->before = static_cast<uint32_t>(listed_.size());
    const EdgeRef edge{object, EdgeId(e)};
    const auto weight = weigh(k, edge);
    if (!weight) continue;
    block->listed |= uint64_t{1} << e % 64;
    listed_.push_back({edge, static_cast<uint32_t>(k), 0});
    weights.push_back(*weight);
    length_ += weight->length;
    swept_ += weight->speed * weight->length;
  }
}

EmitterEdges::Sight EmitterEdges::sight_of(const LightRegions& regions, size_t k) const {
  Sight sight;
  sight.listed = regions.lists_edges(k);
  if (regions.shape(k).valid()) {
    const EmitterHull& hull = regions.hull(k);
    sight.v = hull.center;
    sight.radius = hull.radius;
    sight.light = regions.luminance(k) * hull.area;
  } else {
    const DirectionCap& cap = regions.cap(k);
    sight.infinite = true;
    sight.v = cap.axis;
    sight.radius = cap.sine;
    const double hole = regions.patch(k).inner_versine();
    sight.light = regions.luminance(k) * (cap.sine * cap.sine - hole * (2 - hole)) * kPi;
  }
  sight.listed = sight.listed && sight.radius > 0 && sight.light > 0;
  return sight;
}

std::optional<EmitterEdges::Weight> EmitterEdges::weigh(size_t k, EdgeRef id) const {
  const Sight& sight = sights_[k];
  const EdgeMesh& mesh = edges_.object(id.object);
  const Edge& edge = mesh.edge(id.edge);
  // The side of a plane that all of the region is on; 0 if there is none.
  const auto side_of = [&](const Plane& plane) {
    const double d = sight.infinite ? dot(plane.n, sight.v) : plane.distance(sight.v);
    const double slack = sight.radius * (1 + 1e-6) + (sight.infinite ? 1e-12 : 0);
    return d > slack ? 1 : d < -slack ? -1 : 0;
  };
  const EdgeClass kind = edge.edge_class;
  if (kind == EdgeClass::kTexture) return {};  // it hides nothing
  if (kind == EdgeClass::kSmooth || kind == EdgeClass::kSharp || kind == EdgeClass::kFlat) {
    const int side = side_of(mesh.plane(edge.faces[0]));
    if (side != 0 && side == side_of(mesh.plane(edge.faces[1]))) return {};
  }
  for (const FaceRef face : mesh.faces_around(id.edge)) {
    if (face.shape == emitters_[k]) return {};
  }
  const Vec3d x0 = mesh.position(edge.vertices[0]), x1 = mesh.position(edge.vertices[1]);
  const double edge_length = length(x1 - x0);
  const Vec3d w = sight.infinite ? sight.v * reach_ : 0.5 * (x0 + x1) - sight.v;
  const double distance = std::max(length(w), sight.infinite ? 0.0 : sight.radius);
  Weight weight;
  weight.length = sight.light * edge_length / (distance + edge_length);
  if (!sight.infinite) weight.length /= distance * distance;
  if (!(weight.length > 0)) return {};
  const Vec3d normal = cross(w, x1 - x0);
  const double size = length(normal);
  if (mesh.tangents.empty() || !(size > 0)) return weight;
  for (const VertexId end : edge.vertices) {
    const Vec3<Lanes>& v = mesh.tangent(end);
    const Lanes across = v.x * normal.x + v.y * normal.y + v.z * normal.z;
    for (int lane = 0; lane < lanes_; ++lane) {
      weight.speed[lane] =
          std::max(weight.speed[lane], std::fabs(across[lane]) / (size * distance));
    }
  }
  return weight;
}

// As for the edges of sharp shadows: half of the lines follow length times speed, half length
// alone, since a surface or a camera that moves makes all edges count. Not tuned.
double EmitterEdges::share_of(const Weight& weight) const {
  const double own = weight.length / length_;
  double share = 0;
  for (int k = 0; k < lanes_; ++k) {
    share += own + (swept_[k] > 0 ? weight.speed[k] * weight.length / swept_[k] : own);
  }
  return share / (2 * lanes_);
}

EmitterEdges::Drawn EmitterEdges::draw(double u) const {
  const double target = u * cumulative_.back();
  const size_t last = listed_.size() - 1;
  size_t i = guide_[std::min(static_cast<size_t>(u * static_cast<double>(listed_.size())), last)];
  // The first whose sum is larger; rounding may start the search behind it.
  while (i > 0 && cumulative_[i - 1] > target) --i;
  while (i < last && cumulative_[i] <= target) ++i;
  return listed_[i];
}

double EmitterEdges::probability(size_t k, EdgeRef edge) const {
  if (!sights_[k].listed) return 0;
  const uint32_t e = edge.edge.index();
  const Block& block = blocks_[sights_[k].first_block + first_block_[edge.object.index()] + e / 64];
  const uint64_t bit = uint64_t{1} << e % 64;
  if (!(block.listed & bit)) return 0;
  return listed_[block.before + std::popcount(block.listed & (bit - 1))].probability;
}

EmitterWays emitter_ways(const PathContext& context, const EdgeSamplerInput& edges,
                         const LightRegions& regions, const EmitterEdges& emitter_edges) {
  constexpr double kScattered = 0.25;  // not tuned
  const int max_depth = context.scene.max_depth;
  const bool scatters = (max_depth < 0 || max_depth > 2) && !context.straight_ways;
  return {context.scene, edges, regions, emitter_edges, scatters ? kScattered : 0};
}

// Lines leave p on the side that they came to. Paths share the vertices of surfaces with smooth
// lobes by probabilities of their own.
double scattered_density(const Scene& scene, const EmitterLine& line, const PathStep& step) {
  if (!step.face.shape.valid()) return 0;
  const auto smooth = [](const Bsdf* bsdf) { return bsdf && bsdf->lobes().smooth; };
  const Bsdf& bsdf = *scene.shape(step.face.shape).bsdf;
  if (is_lifted(scene, step.face.shape) || smooth(bsdf.side(true)) || smooth(bsdf.side(false))) {
    return 0;
  }
  if (!(dot(line.n, step.from - line.p) * dot(line.n, line.e - line.p) > 0)) return 0;
  // Not by the cosine: seen at a grazing angle a moving p slides by one over it.
  return film_density(scene, line.p, 1 / (2 * kPi), step.face, step.from, step.from - step.before);
}

PenumbraShare penumbra_share(const EmitterWays& ways, const EmitterLine& line, const PathStep& step,
                             int bounces) {
  const auto& [scene, edges, regions, emitter_edges, scattered] = ways;
  if (bounces > 0 && !(step.pdf > 0)) return {};
  const double probability = emitter_edges.probability(line.region, line.edge);
  const Vec3d through = line.e - line.p;
  const double behind = length(through);
  if (!(probability > 0 && behind > 0)) return {};
  const Vec3d omega = through / behind;
  const double pdf = regions.direction_pdf(line.region, line.e, omega);
  if (!(pdf > 0)) return {};

  const Vec3d sight = line.p - step.from;
  const double distance = length(sight);
  const double seen = std::fabs(dot(line.n, sight)) / (distance * distance * distance);
  PenumbraShare result;
  result.density = pdf * std::fabs(dot(line.n, omega)) / (behind * behind * seen);

  // Per sample of a pixel, each way: how many of its points lie here, per length of the edge. Lines
  // are drawn for the whole film; at p, four points on the edges that cross an emitter that is seen
  // beside e with a width of |p - e| / sqrt(pdf), or less.
  double lines = probability * result.density, points = step.pdf;
  const double pixels = static_cast<double>(scene.film.crop_width) * scene.film.crop_height;
  double more = 0;  // scattered lines for one from the vertex before
  if (bounces == 0) {
    lines *=
        (1 - scattered) * pixels / film_per_solid_angle(scene.camera, sight / distance, distance);
    points = 1;
  } else if (bounces == 1 && scattered > 0) {
    more = scattered * pixels * scattered_density(scene, line, step);
  }
  const auto& ends = edges.object(line.edge.object).edge(line.edge.edge).vertices;
  const EdgeMesh& mesh = edges.object(line.edge.object);
  lines /= length(mesh.position(ends[1]) - mesh.position(ends[0]));
  points *= 4 * std::sqrt(pdf) / behind;
  // Where one way hardly comes, the little that it would be left with is a rare event.
  const double ratio = points / lines;
  if (!std::isfinite(lines) || !std::isfinite(ratio) || !std::isfinite(more)) return result;
  const double others = 1 + ratio * ratio, squared = more * more;
  result.share = 1 / (others + squared);
  result.scattered = 1 / (1 + others / squared);
  return result;
}

double direct_share(const EmitterWays& ways, const EdgeSample& sample, size_t k,
                    const SurfacePoint<double>& at, const PathStep& step, int bounces) {
  const EdgeMesh& mesh = ways.edges.object(sample.edge.object);
  const auto& ends = mesh.edge(sample.edge.edge).vertices;
  const Vec3d e = mesh.position(ends[0]) * (1 - sample.t) + mesh.position(ends[1]) * sample.t;
  const EmitterLine line{k, sample.edge, e, at.p, at.n_g};
  const PenumbraShare of = penumbra_share(ways, line, step, bounces);
  return 1 - of.share - of.scattered;
}

}  // namespace limn
