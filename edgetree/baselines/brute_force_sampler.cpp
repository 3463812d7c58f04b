// The oracle: lists all of E(p), weighs each edge by a bound of its contribution (see
// contribution_bound.h) and draws in proportion. Time grows with the number of faces.
#include <algorithm>
#include <atomic>
#include <memory>

#include "edgetree/baselines/baselines.h"
#include "limn/edgetree/contribution_bound.h"

namespace limn {
namespace {

// What listing needs of a mesh, packed. Planes: one array per coefficient, so that eight are tested
// at once. Edges: the two faces, and the sides that p must be on, of either face, for the edge to
// be a candidate (see is_candidate).
struct Packed {
  std::vector<double> x, y, z, offset;
  std::vector<std::array<uint32_t, 2>> faces;
  std::vector<uint8_t> needed;
};

// Front and back at once: on the plane, to rounding.
enum Side : uint8_t { kFront = 1, kBack = 2, kNever = 4 };

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

bool is_still(const Vec3<Lanes>& v) { return is_zero(v.x) && is_zero(v.y) && is_zero(v.z); }

// The candidates of the last query that a thread asked; several draws of one query share it.
struct Listing {
  uint64_t sampler = 0;
  EdgeQuery query;
  std::vector<uint8_t> sides;   // of p, by face of one object
  std::vector<uint32_t> found;  // candidates of one object
  std::vector<EdgeRef> edges;
  std::vector<double> cumulative;  // of their weights
  double total() const { return cumulative.empty() ? 0 : cumulative.back(); }
};

class BruteForceSampler final : public EdgeSampler {
 public:
  explicit BruteForceSampler(const EdgeSamplerInput& input) : input_(input), serial_(++serials_) {
    for (const EdgeMesh& mesh : input.objects) packed_.push_back(pack(mesh));
  }

  std::optional<EdgeSample> sample(const EdgeQuery& query, Rng& rng) const override {
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

  double probability(const EdgeQuery& query, EdgeRef id) const override {
    if (!is_candidate(input_.object(id.object), id.edge, query.p)) return 0;
    if (is_own_edge(input_, query, id)) return 0;
    const double total = list(query).total();
    return total > 0 ? bound_of(query, id).total() / total : 0;
  }

  double pdf_t(const EdgeQuery& query, EdgeRef id, double t) const override {
    const EdgeBound bound = bound_of(query, id);
    return bound.total() > 0 ? bound.pdf_t(t) : 0;
  }

  // It bounds every edge.
  double draw_cost() const override {
    size_t edges = 0;
    for (const EdgeMesh& mesh : input_.objects) edges += mesh.edges.size();
    return static_cast<double>(edges) / 200;
  }
  SamplerSize size() const override {
    uint64_t bytes = 0;
    for (const Packed& p : packed_)
      bytes += 4 * p.x.size() * sizeof p.x[0] +
               p.needed.size() * (sizeof p.faces[0] + sizeof p.needed[0]);
    return {0, bytes};
  }

 private:
  EdgeBound bound_of(const EdgeQuery& query, EdgeRef id) const {
    return {LobeBound(query.n, query.wi, query.lobe),
            segment_of(input_.object(id.object), id.edge, query)};
  }

  const Listing& list(const EdgeQuery& query) const {
    // On the heap: a shared library has little room for what belongs to threads.
    static thread_local const auto owned = std::make_unique<Listing>();
    Listing& listing = *owned;
    if (listing.sampler == serial_ && same(listing.query, query)) return listing;
    listing.sampler = serial_;
    listing.query = query;
    listing.edges.clear();
    listing.cumulative.clear();
    const bool still = is_still(query.velocity) && is_still(query.turn.rate);
    for (uint32_t o = 0; o < input_.objects.size(); ++o) {
      if (input_.objects[o].tangents.empty() && still) continue;
      list_object(ShapeId(o), query, listing);
    }
    return listing;
  }

  static Packed pack(const EdgeMesh& mesh) {
    Packed packed;
    for (const Plane& plane : mesh.planes) {
      packed.x.push_back(plane.n.x);
      packed.y.push_back(plane.n.y);
      packed.z.push_back(plane.n.z);
      packed.offset.push_back(plane.offset);
    }
    for (const Edge& edge : mesh.edges) {
      const auto [a, b] = edge.faces;
      packed.faces.push_back({a.index(), b.valid() ? b.index() : 0});
      packed.needed.push_back(needed_sides(mesh, edge));
    }
    return packed;
  }

  static uint8_t needed_sides(const EdgeMesh& mesh, const Edge& edge) {
    switch (edge.edge_class) {
      case EdgeClass::kSmooth:
        return edge.concave && mesh.one_sided_closed ? kNever : kFront | kBack;
      case EdgeClass::kFlat:
        return kFront | kBack;
      case EdgeClass::kSharp:
        return mesh.one_sided_closed ? kFront : 0;
      default:
        return 0;
    }
  }

  static void find_sides(const Packed& packed, double error, const Vec3d& p, uint8_t* sides) {
    const double *x = packed.x.data(), *y = packed.y.data(), *z = packed.z.data(),
                 *offset = packed.offset.data();
    const size_t count = packed.x.size();
    for (size_t f = 0; f < count; ++f) {
      const double d = x[f] * p.x + y[f] * p.y + z[f] * p.z + offset[f];
      sides[f] = static_cast<uint8_t>((d >= -error ? kFront : 0) | (d <= error ? kBack : 0));
    }
  }

  // Writes the candidates' indices and returns their number; no branch depends on the data.
  static size_t find_candidates(const Packed& packed, const uint8_t* sides, uint32_t* found) {
    size_t count = 0;
    for (uint32_t e = 0; e < packed.faces.size(); ++e) {
      const auto [a, b] = packed.faces[e];
      found[count] = e;
      count += ((sides[a] | sides[b]) & packed.needed[e]) == packed.needed[e];
    }
    return count;
  }

  void list_object(ShapeId object, const EdgeQuery& query, Listing& listing) const {
    const EdgeMesh& mesh = input_.object(object);
    const Packed& packed = packed_[object.index()];
    listing.sides.resize(std::max(listing.sides.size(), packed.x.size()));
    listing.found.resize(std::max(listing.found.size(), packed.faces.size() + 1));
    find_sides(packed, distance_error(mesh, query.p), query.p, listing.sides.data());
    const size_t count = find_candidates(packed, listing.sides.data(), listing.found.data());
    const LobeBound lobe(query.n, query.wi, query.lobe);
    for (size_t i = 0; i < count; ++i) {
      const EdgeRef id{object, EdgeId(listing.found[i])};
      if (is_own_edge(input_, query, id)) continue;
      const EdgeBound bound(lobe, segment_of(mesh, id.edge, query));
      if (!(bound.total() > 0)) continue;
      listing.edges.push_back(id);
      listing.cumulative.push_back(listing.total() + bound.total());
    }
  }

  static inline std::atomic<uint64_t> serials_{0};
  const EdgeSamplerInput& input_;
  uint64_t serial_;
  std::vector<Packed> packed_;
};

}  // namespace

std::unique_ptr<EdgeSampler> make_brute_force_sampler(const EdgeSamplerInput& input, int) {
  return std::make_unique<BruteForceSampler>(input);
}

}  // namespace limn
