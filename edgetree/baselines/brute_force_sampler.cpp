// The reference sampler: finds E(p) by testing the planes of all faces, in linear time.
#include <algorithm>
#include <memory>

#include "edgetree/baselines/baselines.h"
#include "edgetree/baselines/listing_sampler.h"

namespace limn {
namespace {

// Packed data of a mesh. Planes: one array per coefficient, so that eight are tested at once.
// Edges: the two faces, and for each the sides on which p makes the edge a candidate (see
// is_candidate).
struct Packed {
  std::vector<double> x, y, z, offset;
  std::vector<std::array<uint32_t, 2>> faces;
  std::vector<uint8_t> needed;
};

// Both kFront and kBack: on the plane, up to rounding.
enum Side : uint8_t { kFront = 1, kBack = 2, kNever = 4 };

class BruteForceSampler final : public ListingSampler {
 public:
  explicit BruteForceSampler(const EdgeSamplerInput& input) : ListingSampler(input) {
    for (const EdgeMesh& mesh : input.objects) packed_.push_back(pack(mesh));
  }

  SamplerSize size() const override {
    uint64_t bytes = 0;
    for (const Packed& p : packed_)
      bytes += 4 * p.x.size() * sizeof p.x[0] +
               p.needed.size() * (sizeof p.faces[0] + sizeof p.needed[0]);
    return {0, bytes};
  }

 private:
  // Only grows: a resize would initialise the memory again.
  struct Scratch {
    std::vector<uint8_t> sides;        // of the faces
    std::vector<uint32_t> candidates;  // and one more
  };

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
      packed.faces.push_back({a.index(), b.valid() ? b.index() : a.index()});
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
      case EdgeClass::kTexture:
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

  // Branch-free, independent of the data.
  void find_candidates(ShapeId object, const Vec3d& p,
                       std::vector<uint32_t>& found) const override {
    static thread_local const auto owned = std::make_unique<Scratch>();
    auto& [sides, candidates] = *owned;
    const Packed& packed = packed_[object.index()];
    sides.resize(std::max(sides.size(), packed.x.size()));
    candidates.resize(std::max(candidates.size(), packed.faces.size() + 1));
    find_sides(packed, distance_error(input_.object(object), p), p, sides.data());
    uint32_t* end = candidates.data();
    for (uint32_t e = 0; e < packed.faces.size(); ++e) {
      const auto [a, b] = packed.faces[e];
      *end = e;
      end += ((sides[a] | sides[b]) & packed.needed[e]) == packed.needed[e];
    }
    found.assign(candidates.data(), end);
  }

  std::vector<Packed> packed_;
};

}  // namespace

std::unique_ptr<EdgeSampler> make_brute_force_sampler(const EdgeSamplerInput& input, int) {
  return std::make_unique<BruteForceSampler>(input);
}

}  // namespace limn
