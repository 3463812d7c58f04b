// The oracle: lists all of E(p), weighs each edge by a bound of its contribution (see
// contribution_bound.h) and draws in proportion. Time grows with the number of faces.
#include <algorithm>
#include <atomic>

#include "limn/edgetree/contribution_bound.h"
#include "samplers.h"

namespace limn {
namespace {

// Planes of a mesh, one array per coefficient, so that eight are tested at once.
struct PlaneArrays {
  std::vector<double> x, y, z, offset;
};

enum Side : uint8_t { kFront = 1, kBack = 2 };  // both bits: on the plane, to rounding

bool same(const Vec3<Lanes>& a, const Vec3<Lanes>& b) {
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < kLanes; ++i)
      if (a[k][i] != b[k][i]) return false;
  return true;
}
bool same(const EdgeQuery& a, const EdgeQuery& b) {
  return a.p == b.p && a.n == b.n && a.wi == b.wi && a.lobe.kind == b.lobe.kind &&
         a.lobe.alpha == b.lobe.alpha && a.lobe.albedo == b.lobe.albedo &&
         same(a.velocity, b.velocity) && a.object == b.object && a.face == b.face;
}

bool is_still(const Vec3<Lanes>& v) { return is_zero(v.x) && is_zero(v.y) && is_zero(v.z); }

// The candidates of the last query that a thread asked; several draws of one query share it.
struct Listing {
  uint64_t sampler = 0;
  EdgeQuery query;
  std::vector<uint8_t> sides;
  std::vector<EdgeId> edges;
  std::vector<double> cumulative;  // of their weights
  double total() const { return cumulative.empty() ? 0 : cumulative.back(); }
};

class BruteForceSampler final : public EdgeSampler {
 public:
  explicit BruteForceSampler(const EdgeSamplerInput& input) : input_(input), serial_(++serials_) {
    for (const EdgeMesh& mesh : input.objects) {
      PlaneArrays& planes = planes_.emplace_back();
      for (const Plane& plane : mesh.planes) {
        planes.x.push_back(plane.n.x);
        planes.y.push_back(plane.n.y);
        planes.z.push_back(plane.n.z);
        planes.offset.push_back(plane.offset);
      }
    }
  }

  bool sample(const EdgeQuery& query, Rng& rng, EdgeSample& sample) const override {
    const Listing& listing = list(query);
    if (listing.edges.empty()) return false;
    const double u_edge = rng.uniform(), u_piece = rng.uniform(), u_angle = rng.uniform();
    const auto begin = listing.cumulative.begin();
    const auto found =
        std::upper_bound(begin, listing.cumulative.end() - 1, u_edge * listing.total());
    sample.edge = listing.edges[found - begin];
    const EdgeBound bound = bound_of(query, sample.edge);
    sample.t = bound.sample_t(u_piece, u_angle);
    sample.pdf_t = bound.pdf_t(sample.t);
    sample.probability = bound.total() / listing.total();
    return true;
  }

  double probability(const EdgeQuery& query, EdgeId id) const override {
    if (!is_candidate(input_.objects[id.object], id.edge, query.p)) return 0;
    if (is_own_edge(input_, query, id)) return 0;
    const double total = list(query).total();
    return total > 0 ? bound_of(query, id).total() / total : 0;
  }

  double pdf_t(const EdgeQuery& query, EdgeId id, double t) const override {
    const EdgeBound bound = bound_of(query, id);
    return bound.total() > 0 ? bound.pdf_t(t) : 0;
  }

 private:
  EdgeBound bound_of(const EdgeQuery& query, EdgeId id) const {
    return {LobeBound(query.n, query.wi, query.lobe),
            segment_of(input_.objects[id.object], id.edge, query)};
  }

  const Listing& list(const EdgeQuery& query) const {
    static thread_local Listing listing;
    if (listing.sampler == serial_ && same(listing.query, query)) return listing;
    listing.sampler = serial_;
    listing.query = query;
    listing.edges.clear();
    listing.cumulative.clear();
    for (uint32_t object = 0; object < input_.objects.size(); ++object) {
      if (input_.objects[object].tangents.empty() && is_still(query.velocity)) continue;
      find_sides(object, query.p, listing.sides);
      list_object(object, query, listing);
    }
    return listing;
  }

  void find_sides(uint32_t object, const Vec3d& p, std::vector<uint8_t>& sides) const {
    const PlaneArrays& planes = planes_[object];
    const size_t count = planes.x.size();
    const double error = distance_error(input_.objects[object], p);
    sides.resize(std::max(sides.size(), count));
    uint8_t* out = sides.data();
    const double *x = planes.x.data(), *y = planes.y.data(), *z = planes.z.data(),
                 *offset = planes.offset.data();
    for (size_t f = 0; f < count; ++f) {
      const double d = x[f] * p.x + y[f] * p.y + z[f] * p.z + offset[f];
      out[f] = static_cast<uint8_t>((d >= -error ? kFront : 0) | (d <= error ? kBack : 0));
    }
  }

  void list_object(uint32_t object, const EdgeQuery& query, Listing& listing) const {
    const EdgeMesh& mesh = input_.objects[object];
    const LobeBound lobe(query.n, query.wi, query.lobe);
    for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
      if (!is_listed(mesh, mesh.edges[e], listing.sides)) continue;
      const EdgeId id{object, e};
      if (is_own_edge(input_, query, id)) continue;
      const EdgeBound bound(lobe, segment_of(mesh, e, query));
      if (!(bound.total() > 0)) continue;
      listing.edges.push_back(id);
      listing.cumulative.push_back(listing.total() + bound.total());
    }
  }

  // is_candidate, from the sides of all planes.
  static bool is_listed(const EdgeMesh& mesh, const Edge& edge, const std::vector<uint8_t>& sides) {
    if (edge.edge_class == EdgeClass::kBorder || edge.edge_class == EdgeClass::kIrregular)
      return true;
    const uint8_t a = sides[edge.faces[0]], b = sides[edge.faces[1]];
    if (edge.edge_class == EdgeClass::kSharp)
      return !mesh.one_sided_closed || ((a | b) & kFront) != 0;
    return (a | b) == (kFront | kBack);
  }

  static inline std::atomic<uint64_t> serials_{0};
  const EdgeSamplerInput& input_;
  uint64_t serial_;
  std::vector<PlaneArrays> planes_;
};

}  // namespace

std::unique_ptr<EdgeSampler> make_brute_force_sampler(const EdgeSamplerInput& input, int) {
  return std::make_unique<BruteForceSampler>(input);
}

}  // namespace limn
