// Lists of outlines before glare, and points on them.
#include "integrators/terms/glare_edges.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// Points for one sample. Not tuned.
constexpr int kPoints = 2;
// Wider glare is left to other samplers: lists would be long. Not tuned.
constexpr double kWidest = 0.5;
// And narrower: by rounding a direction would lie in its cap or not.
constexpr double kNarrowest = 1e-6;
// What a piece weighs at least, over what it would if the glare filled its cap evenly.
constexpr double kEven = 0.1;
// Glare is looked for if it is this many times as bright as what else is seen. With any
// the error times time of a teapot under two emitters on gloss was 1.5 times as large.
constexpr double kBright = 4;

}  // namespace

void GlareEdges::list(const PathVertex& vertex, const EdgeQuery& query, View& view) const {
  static thread_local std::vector<ListedEdge> listed;
  static thread_local std::vector<EdgePiece> pieces;
  view.count = 0;
  view.pieces.clear();
  const MirroredLight::Mixture mixture = mirrored_.mixture(vertex.surface, vertex.scattering);
  for (int i = 0; i < mixture.count; ++i) {
    const MirroredLight::Glare& glare = mixture.glare(i);
    if (!(glare.half_angle > kNarrowest && glare.half_angle < kWidest)) continue;
    const DirectionCap cap{glare.toward, std::sin(glare.half_angle), std::cos(glare.half_angle)};
    const double solid_angle = 2 * kPi * cap.sine * cap.sine / (1 + cap.cosine);
    if (!(glare.irradiance > kBright * solid_angle * mixture.elsewhere)) continue;
    const std::optional<DirectionCone> cone = cone_around(cap, query.n);
    if (!cone) continue;
    listed.clear();
    pieces.clear();
    if (!sampler_.list_outlines(query, *cone, listed)) return;
    cut_edges(edges_, query, *cone, listed, pieces);
    if (pieces.empty()) continue;
    const auto k = static_cast<uint32_t>(view.count);
    view.caps[view.count++] = cap;
    const double even = kEven / solid_angle;
    for (const EdgePiece& piece : pieces) {
      double bright = even;
      for (const double u : {0.25, 0.75}) {
        const EdgeSample at{piece.edge, piece.place(u).t, 1, 1};
        bright += 0.5 * MirroredLight::pdf(glare, direction(query, at));
      }
      const double before = view.pieces.empty() ? 0 : view.pieces.back().sum;
      view.pieces.push_back({k, piece, before + piece.weight * bright * glare.irradiance});
    }
  }
}

Vec3d GlareEdges::direction(const EdgeQuery& query, const EdgeSample& sample) const {
  const EdgeMesh& mesh = edges_.object(sample.edge.object);
  const auto& ends = mesh.edge(sample.edge.edge).vertices;
  return normalize(mesh.position(ends[0]) * (1 - sample.t) + mesh.position(ends[1]) * sample.t -
                   query.p);
}

std::optional<uint32_t> GlareEdges::cap_of(const View& view, const Vec3d& omega) {
  for (int k = 0; k < view.count; ++k) {
    if (view.caps[k].holds(omega)) return static_cast<uint32_t>(k);
  }
  return {};
}

bool GlareEdges::hold(const View& view, const EdgeQuery& query, const EdgeSample& sample) const {
  return view.count > 0 && cap_of(view, direction(query, sample)) &&
         is_outline(edges_.object(sample.edge.object), sample.edge.edge, query.p);
}

void GlareEdges::draw(const View& view, const EdgeQuery& query, const Rng& rng, int samples,
                      TermCost& cost, std::vector<DirectPoint>& points) const {
  points.clear();
  if (view.count == 0) return;
  draw_pieces(edges_, view.pieces, rng, kPoints, samples, cost, points);
  const auto is_of_other = [&](const DirectPoint& point) {
    const auto k = cap_of(view, direction(query, point.sample));
    return !k || *k != point.region;
  };
  const auto end = std::remove_if(points.begin(), points.end(), is_of_other);
  cost.zero_weight += static_cast<uint64_t>(points.end() - end);
  points.erase(end, points.end());
}

}  // namespace limn
