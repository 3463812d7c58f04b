// Draws from all of E(p). Each thread caches the list of its last query.
#include "edgetree/baselines/listing_sampler.h"

#include <algorithm>
#include <atomic>
#include <memory>

namespace limn {
namespace {

bool same(const Vec3<Lanes>& a, const Vec3<Lanes>& b) {
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < kLanes; ++i)
      if (a[k][i] != b[k][i]) return false;
  return true;
}
bool same(const EdgeQuery& a, const EdgeQuery& b) {
  return a.p == b.p && a.n == b.n && a.wi == b.wi && a.lobe == b.lobe &&
         same(a.velocity, b.velocity) && same(a.turn.rate, b.turn.rate) &&
         a.turn.axis == b.turn.axis && a.face == b.face;
}

bool is_constant(const Vec3<Lanes>& v) { return is_zero(v.x) && is_zero(v.y) && is_zero(v.z); }

std::atomic<uint64_t> serials{0};

}  // namespace

// The candidates of a thread's last query, shared by further draws.
struct ListingSampler::Listing {
  uint64_t sampler = 0;
  EdgeQuery query;
  std::vector<uint32_t> found;  // candidates of one object
  std::vector<EdgeRef> edges;
  std::vector<double> cumulative;  // of their weights
  double total() const { return cumulative.empty() ? 0 : cumulative.back(); }
};

ListingSampler::ListingSampler(const EdgeSamplerInput& input) : input_(input), serial_(++serials) {}

std::optional<EdgeSample> ListingSampler::sample(const EdgeQuery& query, Rng& rng) const {
  const Listing& listing = list(query);
  if (listing.edges.empty()) return std::nullopt;
  const double u_edge = rng.uniform(), u_piece = rng.uniform(), u_angle = rng.uniform();
  const auto begin = listing.cumulative.begin();
  const auto found =
      std::upper_bound(begin, listing.cumulative.end() - 1, u_edge * listing.total());
  EdgeSample sample;
  sample.edge = listing.edges[found - begin];
  const EdgeBound bound = bound_of(query, sample.edge);
  sample.t = bound.sample_t(u_piece, u_angle);
  sample.pdf_t = bound.pdf_t(sample.t);
  sample.probability = bound.total() / listing.total();
  return sample;
}

double ListingSampler::probability(const EdgeQuery& query, EdgeRef id) const {
  if (!is_candidate(input_.object(id.object), id.edge, query.p)) return 0;
  if (is_own_edge(input_, query, id)) return 0;
  const double total = list(query).total();
  return total > 0 ? bound_of(query, id).total() / total : 0;
}

double ListingSampler::pdf_t(const EdgeQuery& query, EdgeRef id, double t) const {
  const EdgeBound bound = bound_of(query, id);
  return bound.total() > 0 ? bound.pdf_t(t) : 0;
}

double ListingSampler::query_cost() const {
  size_t edges = 0;
  for (const EdgeMesh& mesh : input_.objects) edges += mesh.edges.size();
  return static_cast<double>(edges) / 200;
}

EdgeBound ListingSampler::bound_of(const EdgeQuery& query, EdgeRef id) const {
  return {LobeBound(query.n, query.wi, query.lobe),
          segment_of(input_.object(id.object), id.edge, query)};
}

const ListingSampler::Listing& ListingSampler::list(const EdgeQuery& query) const {
  // On the heap: shared libraries have little thread-local storage.
  static thread_local const auto owned = std::make_unique<Listing>();
  Listing& listing = *owned;
  if (listing.sampler == serial_ && same(listing.query, query)) return listing;
  listing.sampler = serial_;
  listing.query = query;
  listing.edges.clear();
  listing.cumulative.clear();
  const bool still = is_constant(query.velocity) && is_constant(query.turn.rate);
  for (uint32_t o = 0; o < input_.objects.size(); ++o) {
    if (input_.objects[o].tangents.empty() && still) continue;
    list_object(ShapeId(o), query, listing);
  }
  return listing;
}

void ListingSampler::list_object(ShapeId object, const EdgeQuery& query, Listing& listing) const {
  listing.found.clear();
  find_candidates(object, query.p, listing.found);
  const LobeBound lobe(query.n, query.wi, query.lobe);
  for (const uint32_t edge : listing.found) {
    const EdgeRef id{object, EdgeId(edge)};
    if (is_own_edge(input_, query, id)) continue;
    const EdgeBound bound(lobe, segment_of(input_.object(object), id.edge, query));
    if (!(bound.total() > 0)) continue;
    listing.edges.push_back(id);
    listing.cumulative.push_back(listing.total() + bound.total());
  }
}

}  // namespace limn
