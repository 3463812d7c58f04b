// The boundary term of light that shading points see directly from regions: all silhouettes inside
// a region's cone are listed, and points on them drawn by what each would add.
//   dL_o/dtheta  +=  sum over regions k of the sum over edges of
//                    the integral over t of dL_k(t) f_s(w_t) J(t) dt
// dL_k, the jump of what region k emits and p sees directly, is not zero but on outlines inside the
// cone of directions around the region (those of the lamp itself are on its boundary). With weights
// W_i of the pieces i of these, W their sum, N points u_j = (j + xi) / N of the cumulated weights,
// in the order of the list, estimate the sum: each piece is drawn N W_i / W times on average. The
// order is the trees': points that follow each other lie near each other in the scene.
#include <fmt/format.h>

#include <algorithm>

#include "integrators/terms/penumbra.h"
#include "integrators/terms/term_table.h"
#include "integrators/terms/vertex_edges.h"
#include "limn/edgetree/edge_pieces.h"

namespace limn {
namespace {

// Points for one sample. Sixteen instead took 1.6 times the time for 0.57 of the squared error with
// four lamps on gloss, where the list is long: what is left is the error of p within its pixel.
constexpr int kPoints = 4;
// What a list costs per point, in the unit of Term::work: timed as 0.2 (the sun), 1.0 (soft
// shadow), 1.9 (CAD part), 3.3 (plant), 3.5 (four lamps), against draws of the forest.
constexpr double kListCost = 1;
// Lamps are small below this angle [rad], and have few sides up to this number. Not tuned.
constexpr double kSmall = 0.1;
constexpr int kMostSides = 8;

// A vertex whose directions are held, and the same with directions that turn. What lamps emit is
// seen with the first, see path.h.
struct Viewers {
  explicit Viewers(const PathVertex& turning) : vertices{turning, turning} {
    vertices[0].turn = {};
    if (turning.turned) {
      held = *turning.turned;
      held.turn = {};
      held.sum = {};
      vertices[0].turned = &held;
    }
    queries[0] = query_at(vertices[0]);
    queries[1] = query_at(vertices[1]);
  }
  PathVertex vertices[2];
  TurnedVertex held;
  EdgeQuery queries[2];
};

struct Drawn {
  uint32_t region;
  EdgePiece piece;
  double sum;  // of the weights up to here
};

class DirectTerm final : public Term {
 public:
  explicit DirectTerm(TermInput& input)
      : context_(input.context),
        edges_(input.edges()),
        sampler_(input.edge_sampler()),
        regions_(*input.regions()),
        lamp_edges_(*input.lamp_edges()) {}

  bool uses_vertices() const override { return true; }
  void add_at_vertex(const PathVertex& vertex, int samples, TermCost& cost,
                     Rgb<Lanes>& sum) const override;
  double work(const TermCost& cost) const override {
    return static_cast<double>(cost.rays) + kListCost * static_cast<double>(cost.samples);
  }

 private:
  struct Lists {
    std::vector<Drawn> others;
    std::vector<Drawn> outlines;  // of small lamps, one lamp after the other
    void clear() { others.clear(), outlines.clear(); }
  };
  void list(const Viewers& viewers, Lists& lists) const;
  void add_drawn(const Viewers& viewers, int samples, const std::vector<Drawn>& drawn,
                 TermCost& cost, Rgb<Lanes>& sum) const;
  // Pieces [begin, end).
  void add_outline(const Viewers& viewers, int sample, const Drawn* begin, const Drawn* end,
                   TermCost& cost, Rgb<Lanes>& sum) const;
  // Whether the edge is a side of the lamp itself.
  bool is_own_edge(uint32_t region, EdgeRef edge) const;
  double own_share(const PathVertex& vertex, const EdgeMesh& mesh, const EdgeSample& sample,
                   uint32_t region) const;
  void add_point(const Viewers& viewers, const Drawn& drawn, double u, double times, TermCost& cost,
                 Rgb<Lanes>& sum) const;
  size_t turns(uint32_t region) const { return regions_.shape(region).valid() ? 0 : 1; }

  const PathContext& context_;
  const EdgeSamplerInput& edges_;
  const EdgeSampler& sampler_;
  const LightRegions& regions_;
  const LampEdges& lamp_edges_;
};

void DirectTerm::list(const Viewers& viewers, Lists& lists) const {
  static thread_local std::vector<ListedEdge> listed;
  static thread_local std::vector<EdgePiece> pieces;
  const auto append = [](std::vector<Drawn>& to, uint32_t k, const EdgePiece& piece, double light) {
    to.push_back({k, piece, (to.empty() ? 0 : to.back().sum) + piece.weight * light});
  };
  for (uint32_t k = 0; k < regions_.size(); ++k) {
    const EdgeQuery& query = viewers.queries[turns(k)];
    const std::optional<DirectionCone> cone = regions_.cone(k, query.p, query.n);
    if (!cone) continue;
    listed.clear();
    pieces.clear();
    sampler_.list_outlines(query, *cone, listed);
    cut_edges(edges_, query, *cone, listed, pieces);
    const bool small = regions_.shape(k).valid() &&
                       regions_.hull(k).radius < kSmall * length(regions_.hull(k).center - query.p);
    for (const EdgePiece& piece : pieces) {
      const bool own = small && is_own_edge(k, piece.edge);
      append(own ? lists.outlines : lists.others, k, piece, regions_.luminance(k));
    }
  }
}

bool DirectTerm::is_own_edge(uint32_t region, EdgeRef edge) const {
  const auto faces = edges_.object(edge.object).faces_around(edge.edge);
  return std::any_of(faces.begin(), faces.end(),
                     [&](FaceRef face) { return face.shape == regions_.shape(region); });
}

void DirectTerm::add_at_vertex(const PathVertex& vertex, int samples, TermCost& cost,
                               Rgb<Lanes>& sum) const {
  static thread_local Lists lists;
  lists.clear();
  Viewers viewers(vertex);
  list(viewers, lists);
  if (vertex.log) {
    vertex.log->push_back(fmt::format("  direct: {} pieces of silhouettes before {} regions",
                                      lists.others.size() + lists.outlines.size(),
                                      regions_.size()));
  }
  add_drawn(viewers, samples, lists.others, cost, sum);
  const auto& outlines = lists.outlines;
  for (size_t begin = 0, end = 0; begin < outlines.size(); begin = end) {
    while (end < outlines.size() && outlines[end].region == outlines[begin].region) ++end;
    for (int i = 0; i < samples; ++i) {
      add_outline(viewers, i, &outlines[begin], &outlines[begin] + (end - begin), cost, sum);
    }
  }
  if (vertex.turned) vertex.turned->sum = vertex.turned->sum + viewers.held.sum;
}

void DirectTerm::add_drawn(const Viewers& viewers, int samples, const std::vector<Drawn>& drawn,
                           TermCost& cost, Rgb<Lanes>& sum) const {
  const PathVertex& vertex = viewers.vertices[0];
  const int points = kPoints * samples;
  cost.samples += static_cast<uint64_t>(points);
  const double total = drawn.empty() ? 0 : drawn.back().sum;
  if (!(total > 0)) {
    cost.no_edge += static_cast<uint64_t>(points);
    return;
  }
  Rng rng = vertex.key.at(Purpose::kDirect, vertex.bounces);
  const double offset = rng.uniform();
  // The piece of each point; what is read of its edge comes in while the points before are met.
  static thread_local std::vector<size_t> chosen;
  chosen.clear();
  size_t i = 0;
  for (int j = 0; j < points; ++j) {
    const double target = (j + offset) / points * total;
    while (i + 1 < drawn.size() && drawn[i].sum <= target) ++i;
    chosen.push_back(i);
    const EdgeRef edge = drawn[i].piece.edge;
    edges_.object(edge.object).fetch_ends(edge.edge);
  }
  for (int j = 0; j < points; ++j) {
    const double target = (j + offset) / points * total;
    i = chosen[j];
    const double before = i == 0 ? 0 : drawn[i - 1].sum, weight = drawn[i].sum - before;
    const double u = std::clamp((target - before) / weight, 0.0, 1.0);
    add_point(viewers, drawn[i], u, weight / total * kPoints, cost, sum);
  }
}

// What the sides of a small lamp add cancels but for its size: none of them is left out, and all
// are met at the same place. Of many, each is met as often as it weighs.
void DirectTerm::add_outline(const Viewers& viewers, int sample, const Drawn* begin,
                             const Drawn* end, TermCost& cost, Rgb<Lanes>& sum) const {
  const PathVertex& vertex = viewers.vertices[0];
  Rng rng = vertex.key.copy(Purpose::kDirectCopy, sample + 1).at(Purpose::kDirect, vertex.bounces);
  const double u = rng.uniform();
  if (end - begin <= kMostSides) {
    cost.samples += static_cast<uint64_t>(end - begin);
    for (const Drawn* piece = begin; piece != end; ++piece) {
      add_point(viewers, *piece, u, 1, cost, sum);
    }
    return;
  }
  cost.samples += kMostSides;
  const double first = begin->sum - begin->piece.weight * regions_.luminance(begin->region);
  const double total = (end - 1)->sum - first;
  const Drawn* piece = begin;
  for (int j = 0; j < kMostSides; ++j) {
    const double target = first + (j + u) / kMostSides * total;
    while (piece + 1 != end && piece->sum <= target) ++piece;
    const double before = piece == begin ? first : (piece - 1)->sum;
    const double weight = piece->sum - before;
    const double place = std::clamp((target - before) / weight, 0.0, 1.0);
    add_point(viewers, *piece, place, weight / total * kMostSides, cost, sum);
  }
}

// Of what the edge adds at the vertex, but for what turning directions change.
double DirectTerm::own_share(const PathVertex& vertex, const EdgeMesh& mesh,
                             const EdgeSample& sample, uint32_t region) const {
  const auto& ends = mesh.edge(sample.edge.edge).vertices;
  const Vec3d e = mesh.position(ends[0]) * (1 - sample.t) + mesh.position(ends[1]) * sample.t;
  const LampLine line{region, sample.edge, e, value(vertex.surface.p), vertex.surface.n_g};
  return 1 - penumbra_share(context_.scene, edges_, regions_, lamp_edges_, line, vertex.step,
                            vertex.bounces)
                 .share;
}

// times: how often the piece is drawn, on average, for one sample.
void DirectTerm::add_point(const Viewers& viewers, const Drawn& drawn, double u, double times,
                           TermCost& cost, Rgb<Lanes>& sum) const {
  const PathVertex& vertex = viewers.vertices[turns(drawn.region)];
  const auto [t, density] = drawn.piece.place(u);
  const EdgeSample sample{drawn.piece.edge, t, density, times};
  const EdgeMesh& mesh = edges_.object(sample.edge.object);
  add_edge_point(context_, mesh, vertex, viewers.queries[turns(drawn.region)], sample,
                 {&regions_, drawn.region}, vertex.key, cost, sum,
                 own_share(vertex, mesh, sample, drawn.region));
}

}  // namespace

std::unique_ptr<Term> make_direct_term(TermInput& input) {
  return std::make_unique<DirectTerm>(input);
}

}  // namespace limn
