// The edge forest as a sampler: descents.
#include "edgetree/forest/edge_forest.h"

#include <algorithm>
#include <bit>
#include <iterator>

#include "edgetree/forest/forest_build.h"
#include "edgetree/forest/forest_choice.h"
#include "edgetree/forest/forest_query.h"
#include "edgetree/lobe/seen_edge.h"
#include "limn/core/prefetch.h"

namespace limn {
namespace {

// A fast test for the edges of the query's own face, by the distance from its plane.
class OwnEdges {
 public:
  OwnEdges(const EdgeSamplerInput& input, const EdgeQuery& query, double extent)
      : input_(input), query_(query), any_(query.face.shape.valid()) {
    if (!any_) return;
    plane_ = input.object(query.face.shape).plane(query.face.face);
    // Far above rounding. Not tuned.
    near_ = 0x1.0p-16 * (extent + length(query.p));
  }
  bool holds(const ListedEdge& edge) const {
    return any_ && std::fabs(plane_.distance(edge.x0)) <= near_ &&
           std::fabs(plane_.distance(edge.x1)) <= near_ && is_own_edge(input_, query_, edge.id);
  }

 private:
  const EdgeSamplerInput& input_;
  const EdgeQuery& query_;
  bool any_;
  Plane plane_;
  double near_ = 0;
};

}  // namespace

struct EdgeForest::Impl {
  const EdgeSamplerInput& input;
  ForestConfig config;
  LightClusters lights;
  Forest forest;
  ShapeId crossings;  // the first object whose ends are not floats, or none: after all shapes
  // The roots but those of textures, which are no outlines.
  std::vector<NodeId> outlines, moving_outlines;

  ForestQuery prepare(const EdgeQuery& query) const {
    const bool lit = config.light_term && !lights.empty();
    const RadiancePyramid* environment =
        config.environment_term ? input.environment.get() : nullptr;
    ForestQuery prepared(forest, lit ? &lights : nullptr, environment, query, input);
    prepared.any_direction = !config.normal_speed;
    return prepared;
  }
  // Valid until this thread expands another query.
  const ExpandedNodes& expand(const ForestQuery& query) const {
    static thread_local ExpandedNodes nodes;
    nodes.expand(forest, config, query);
    return nodes;
  }

  // Ready to draw; valid until this thread starts another query.
  ForestWalk& walk(const ForestQuery& query) const {
    static thread_local ForestWalk walk;
    walk.begin(forest, config, query, expand(query));
    return walk;
  }
  // Tests the edge at the end of a descent, and samples a point on it.
  std::optional<EdgeSample> finish(const EdgeQuery& query, const ForestQuery& prepared,
                                   const ForestWalk::End& end, double u_t) const {
    if (!end.node) return std::nullopt;
    const EdgeRef id = end.edge();
    const EdgeMesh& mesh = input.object(id.object);
    mesh.fetch_edge(id.edge);  // used after this draw
    if (!accepts(query, prepared.point, *end.node, end.lane)) return std::nullopt;
    const SeenEdge edge = seen_edge(prepared.lobe, query.p, *end.node, end.lane);
    if (!edge.is_seen()) return std::nullopt;
    EdgeSample sample{id, edge.sample_t(u_t), end.probability, 0};
    mesh.fetch_ends(id.edge);
    sample.pdf_t = edge.pdf_t(sample.t);
    // Rejected where the density underflows, on an edge in the horizon.
    if (!(sample.pdf_t > 0)) return std::nullopt;
    return sample;
  }

  // A node with its probability for one query, and its index among expanded nodes, if any.
  struct Reached {
    double probability;
    int expanded;
  };
  // Descends to a child. Probabilities are multiplied from the root on, as in `draw`, with the same
  // bits.
  Reached reach(NodeId id, int lane, const ForestQuery& query, const ExpandedNodes& nodes) const {
    const uint32_t parent = forest.head(id).parent;
    const bool is_root = parent == kNoParent;
    const Reached here = is_root ? Reached{1, nodes.find_root(id)}
                                 : reach(static_cast<NodeId>(parent / kWidth),
                                         static_cast<int>(parent % kWidth), query, nodes);
    const bool is_expanded = here.expanded != ExpandedNodes::kNotExpanded;
    if (here.probability == 0 || (is_root && !is_expanded)) return {0, ExpandedNodes::kNotExpanded};
    const Choice choice =
        is_expanded ? nodes.choice(here.expanded) : choice_at(forest, config, query, id);
    const double scale = is_root ? nodes.total() : choice.total;
    return {scale > 0 ? here.probability * (choice.weights[lane] / scale) : 0,
            is_expanded ? nodes.child(here.expanded, lane) : ExpandedNodes::kNotExpanded};
  }

  // Exact test of a drawn edge; most pass without access to the mesh.
  bool accepts(const EdgeQuery& query, const ForestPoint& point, const EdgeNode& node,
               int lane) const {
    const EdgeRef id = node.edge_at(lane);
    // With culling, concave edges of the forest are candidates only as silhouettes.
    if (!config.cull_concave || !surely_candidate(node, lane, point)) {
      if (!is_candidate(input.object(id.object), id.edge, query.p)) return false;
    }
    const ListedEdge edge{id, end_of(node, lane, 0), end_of(node, lane, 1)};
    return !OwnEdges(input, query, forest.extent).holds(edge);
  }
  Vec3d end_of(const EdgeNode& node, int lane, int e) const {
    if (crossings.valid() && node.head.object.index() >= crossings.index()) {
      const EdgeMesh& mesh = input.object(node.head.object);
      return mesh.position(mesh.edge(node.edge_at(lane).edge).vertices[e]);
    }
    return {node.ends[e][0][lane], node.ends[e][1][lane], node.ends[e][2][lane]};
  }
  SeenEdge seen_edge(const LtcLobe& lobe, const Vec3d& p, const EdgeNode& node, int lane) const {
    return {lobe, end_of(node, lane, 0) - p, end_of(node, lane, 1) - p};
  }
};

EdgeForest::EdgeForest(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
EdgeForest::~EdgeForest() = default;

std::unique_ptr<EdgeForest> EdgeForest::build(const EdgeSamplerInput& input, int threads,
                                              const ForestConfig& config, SharedObjects* shared) {
  // An environment that is not uniform has its own weight.
  const bool spread = config.environment_term && input.environment;
  const double uniform_luminance = spread ? 0 : input.environment_luminance;
  uint32_t first = 0;  // of the objects that are no shapes
  while (first < input.objects.size() && input.objects[first].shape.valid() &&
         !input.objects[first].of_texture()) {
    ++first;
  }
  const ShapeId crossings = first < input.objects.size() ? ShapeId(first) : ShapeId::none();
  auto impl = std::unique_ptr<Impl>(new Impl{input,
                                             config,
                                             LightClusters(input.lights, uniform_luminance),
                                             build_forest(input, threads, config, shared),
                                             crossings,
                                             {},
                                             {}});
  const auto is_outline = [&](NodeId root) {
    return !input.object(impl->forest.head(root).object).of_texture();
  };
  std::ranges::copy_if(impl->forest.roots, std::back_inserter(impl->outlines), is_outline);
  std::ranges::copy_if(impl->forest.moving_roots, std::back_inserter(impl->moving_outlines),
                       is_outline);
  return std::unique_ptr<EdgeForest>(new EdgeForest(std::move(impl)));
}

std::optional<EdgeSample> EdgeForest::sample(const EdgeQuery& query, Rng& rng) const {
  const ForestQuery prepared = impl_->prepare(query);
  const double u_edge = rng.uniform(), u_t = rng.uniform();
  return impl_->finish(query, prepared, impl_->walk(prepared).draw(u_edge), u_t);
}

// Random numbers that select edges are stratified over [0, 1). The remainder of a number on its
// edge is stratified among the draws of that edge, and selects the point on it after a common
// random shift.
void EdgeForest::sample_several(const EdgeQuery& query, std::span<Rng> rngs,
                                std::vector<std::optional<EdgeSample>>& samples) const {
  samples.clear();
  if (rngs.empty()) return;
  const ForestQuery prepared = impl_->prepare(query);
  ForestWalk& walk = impl_->walk(prepared);
  const auto count = static_cast<double>(rngs.size());
  double shift = 0;
  for (size_t i = 0; i < rngs.size(); ++i) {
    const double u_edge = (static_cast<double>(i) + rngs[i].uniform()) / count;
    if (i == 0) shift = rngs[i].uniform();
    const ForestWalk::End end = walk.draw(below_one(u_edge));
    const double u_t = rngs.size() == 1 ? shift : end.rest + shift;
    samples.push_back(impl_->finish(query, prepared, end, u_t < 1 ? u_t : below_one(u_t - 1)));
  }
}

double EdgeForest::probability(const EdgeQuery& query, EdgeRef id) const {
  const uint32_t slot = impl_->forest.slot(id);
  if (slot == kNoParent) return 0;
  const EdgeNode& node = impl_->forest.edges[slot / kWidth];
  const int lane = static_cast<int>(slot % kWidth);
  const ForestQuery prepared = impl_->prepare(query);
  if (!impl_->accepts(query, prepared.point, node, lane)) return 0;
  if (!impl_->seen_edge(prepared.lobe, query.p, node, lane).is_seen()) return 0;
  return impl_->reach(~static_cast<NodeId>(slot / kWidth), lane, prepared, impl_->expand(prepared))
      .probability;
}

double EdgeForest::pdf_t(const EdgeQuery& query, EdgeRef id, double t) const {
  const uint32_t slot = impl_->forest.slot(id);
  if (slot == kNoParent) return 0;
  const SeenEdge edge =
      impl_->seen_edge(LtcLobe(query.lobe, query.n, query.wi), query.p,
                       impl_->forest.edges[slot / kWidth], static_cast<int>(slot % kWidth));
  return edge.is_seen() ? edge.pdf_t(t) : 0;
}

std::unique_ptr<RejectionTree> EdgeForest::rejection_tree() const {
  return make_forest_rejection_tree(impl_->forest);
}

bool EdgeForest::list_outlines(const EdgeQuery& query, const DirectionCone& directions,
                               std::vector<ListedEdge>& edges) const {
  const Forest& forest = impl_->forest;
  const EdgeSamplerInput& input = impl_->input;
  const ForestCone cone(forest, query, directions, input.lane_scale);
  const OwnEdges own(input, query, forest.extent);
  static thread_local std::vector<NodeId> stack;
  const std::vector<NodeId>& roots = cone.at_rest ? impl_->moving_outlines : impl_->outlines;
  stack.assign(roots.rbegin(), roots.rend());
  while (!stack.empty()) {
    const NodeId id = stack.back();
    stack.pop_back();
    if (id >= 0) {
      const InnerNode& node = forest.inner[id];
      for (uint32_t lanes = bits(may_hold_outlines(node, cone)); lanes != 0; lanes &= lanes - 1) {
        stack.push_back(node.child[std::countr_zero(lanes)]);
        forest.fetch(stack.back());
      }
      continue;
    }
    const EdgeNode& node = forest.edges[~id];
    // With culling, concave edges of the forest are outlines only as silhouettes.
    const bool smooth = impl_->config.cull_concave && node.head.group == ForestGroup::kSilhouette;
    for (uint32_t lanes = bits(may_hold_outlines(node, cone)); lanes != 0; lanes &= lanes - 1) {
      const int lane = std::countr_zero(lanes);
      const EdgeRef edge = node.edge_at(lane);
      if (!(smooth && surely_candidate(node, lane, cone.point)) &&
          !is_outline(input.object(edge.object), edge.edge, query.p)) {
        continue;
      }
      const ListedEdge listed{edge, impl_->end_of(node, lane, 0), impl_->end_of(node, lane, 1)};
      if (own.holds(listed)) continue;
      edges.push_back(listed);
      prefetch(&input.object(edge.object).edge(edge.edge));
    }
  }
  return true;
}

SamplerSize EdgeForest::size() const {
  const Forest& forest = impl_->forest;
  uint64_t bytes = forest.inner.size() * sizeof(InnerNode) +
                   forest.edges.size() * sizeof(EdgeNode) + forest.roots.size() * sizeof(NodeId) +
                   forest.motions.size() * sizeof(ObjectMotion);
  for (const auto& slots : forest.slots) bytes += slots.size() * sizeof(uint32_t);
  return {forest.inner.size() + forest.edges.size(), bytes};
}

}  // namespace limn
