// Draws from the image of a vertex: an edge sampler takes it for the vertex itself.
#include "integrators/terms/mirror_edges.h"

#include <fmt/format.h>

#include <algorithm>

namespace limn {
namespace {

// Of the streams of draws, not those of edges that are seen without a mirror.
constexpr uint64_t kStream = 1 << 16;

// The vertex's image, with its directions: those of mirrors turn in the world while its own rest.
// With e_k the images of the axes, they turn by 1/2 sum over k of e_k x e_k'.
EdgeQuery image_of(const EdgeQuery& query, const FlatMirrors& mirrors,
                   const FlatMirrors::Chain& chain) {
  const auto& v = query.velocity;
  Vec3<Dual> p{{query.p.x, v.x}, {query.p.y, v.y}, {query.p.z, v.z}};
  std::array<Vec3<Dual>, 3> axes{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  for (const uint32_t mirror : std::span(chain.mirrors).first(chain.count)) {
    const MirrorPlane<Dual>& plane = mirrors.mirrors()[mirror].plane;
    p = plane.image(p);
    for (Vec3<Dual>& axis : axes) axis = plane.turned(axis);
  }
  const auto velocity_of = [](const Vec3<Dual>& x) { return Vec3<Lanes>{x.x.d, x.y.d, x.z.d}; };
  EdgeQuery image = query;
  image.p = value(p);
  image.velocity = velocity_of(p);
  image.n = image.wi = {};
  image.turn = {};
  for (int k = 0; k < 3; ++k) {
    const Vec3d axis = value(axes[k]);
    image.n += axis * query.n[k];
    image.wi += axis * query.wi[k];
    image.turn.rate = image.turn.rate + cross(axis, velocity_of(axes[k])) * 0.5;
  }
  image.face = {};  // its edges may be seen in the mirror
  return image;
}

}  // namespace

double MirrorEdges::importance(const FlatMirrors::Chain& chain, const PathVertex& vertex) const {
  const int max_depth = context_.scene.max_depth;
  if (max_depth >= 0 && vertex.bounces + 1 + static_cast<int>(chain.count) >= max_depth) return 0;
  if (context_.flat_mirrors->of(vertex.surface.face) == chain.mirrors[0]) return 0;
  Vec3d p = vertex.surface.p;
  double least = 1;
  for (const uint32_t m : std::span(chain.mirrors).first(chain.count)) {
    if (!context_.flat_mirrors->reflects_to(m, p)) return 0;
    const FlatMirrors::Mirror& mirror = context_.flat_mirrors->mirrors()[m];
    const double squared = length_squared(mirror.center - p);
    least = std::min(least, mirror.area / (mirror.area + squared)) * mirror.share;
    p = context_.flat_mirrors->plane(m).image(p);
  }
  return least;
}

std::optional<MirrorEdges::Choice> MirrorEdges::choose(const PathVertex& vertex, double u) const {
  const auto chains = context_.flat_mirrors->chains();
  std::array<double, FlatMirrors::kMost * FlatMirrors::kMost> weights;
  double sum = 0;
  for (size_t c = 0; c < chains.size(); ++c) {
    sum += weights[c] = importance(chains[c], vertex);
  }
  if (!(sum > 0)) return std::nullopt;
  u *= sum;
  size_t last = 0;
  for (size_t c = 0; c < chains.size(); ++c) {
    if (!(weights[c] > 0)) continue;
    last = c;
    if (u < weights[c]) break;
    u -= weights[c];
  }
  return Choice{last, weights[last] / sum};
}

// Of an edge of the last mirror itself, or behind it, it shows nothing.
bool MirrorEdges::is_before_mirror(const MirrorWay& way, const EdgeSample& sample) const {
  const FlatMirrors& mirrors = *context_.flat_mirrors;
  const uint32_t last = way.chain.mirrors[way.chain.count - 1];
  const EdgeMesh& mesh = edges_.object(sample.edge.object);
  const auto around = mesh.faces_around(sample.edge.edge);
  if (std::ranges::any_of(around, [&](FaceRef face) { return mirrors.of(face) == last; }))
    return false;
  const auto [a, b] = mesh.edge(sample.edge.edge).vertices;
  const Vec3d y = mesh.position(a) * (1 - sample.t) + mesh.position(b) * sample.t;
  const MirrorPlane<double> plane = mirrors.plane(last);
  return (plane.distance(y) < 0) != (plane.distance(way.image) < 0);
}

void MirrorEdges::add_at_vertex(const PathVertex& vertex, int samples, BoundarySink& sink) const {
  static thread_local std::vector<std::optional<EdgeSample>> drawn;
  const Rng key = vertex.key.at(Purpose::kEdgeCopy, kStream);
  const auto choice = choose(vertex, key.at(Purpose::kVertexSplit, vertex.bounces).uniform());
  if (!choice) return;
  const FlatMirrors::Chain& chain = context_.flat_mirrors->chains()[choice->chain];
  const EdgeQuery query = image_of(query_at(vertex), *context_.flat_mirrors, chain);
  const MirrorWay way{chain, query.p};
  draw_edges(sampler_, query, key, vertex.bounces, samples, drawn);
  TermCost& cost = sink.cost();
  cost.samples += drawn.size();
  for (int i = 0; i < samples; ++i) {
    if (!drawn[i]) {
      ++cost.no_edge;
    } else if (!is_before_mirror(way, *drawn[i])) {
      ++cost.zero_weight;
    } else {
      EdgeSample sample = *drawn[i];
      sample.probability *= choice->probability;
      if (sink.log()) {
        sink.log()->push_back(fmt::format("  by way of {} flat mirrors:", chain.count));
      }
      EdgeDraw draw{edges_.object(sample.edge.object), sample, {}, key.copy(Purpose::kEdgeCopy, i)};
      draw.roulette = true;
      draw.way = &way;
      add_edge_point(context_, vertex, draw, sink);
    }
  }
}

}  // namespace limn
