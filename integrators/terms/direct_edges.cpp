// Lists of silhouettes before emitters and patches, and points on them.
#include "integrators/terms/direct_edges.h"

#include <algorithm>

namespace limn {

namespace {

// Points for one sample. Sixteen instead took 1.6 times the time for 0.57 of the squared error with
// four emitters on gloss, where the list is long: what is left is the error of p within its pixel.
constexpr int kPoints = 4;
// Emitters are small below this angle [rad], and have few sides up to this number. Not tuned.
constexpr double kSmall = 0.1;
constexpr int kMostSides = 8;

DirectPoint point_at(const DirectPieces::Piece& piece, double u, double times) {
  const auto [t, density] = piece.piece.place(u);
  return {piece.region, {piece.piece.edge, t, density, times * piece.density}};
}

// The contributions of an emitter's sides nearly cancel. So every sample takes a point on each
// side, all at the same place along it.
void draw_sides(std::span<const DirectPieces::Piece> sides, double u, int samples, TermCost& cost,
                std::vector<DirectPoint>& drawn) {
  cost.samples += sides.size() * static_cast<uint64_t>(samples);
  for (int i = 0; i < samples; ++i) {
    for (const DirectPieces::Piece& side : sides)
      drawn.push_back(point_at(side, (i + u) / samples, 1));
  }
}

}  // namespace

void draw_pieces(const EdgeSamplerInput& edges, std::span<const DirectPieces::Piece> pieces,
                 Rng rng, int points, int samples, TermCost& cost,
                 std::vector<DirectPoint>& drawn) {
  const int count = points * samples;
  cost.samples += static_cast<uint64_t>(count);
  const double total = pieces.empty() ? 0 : pieces.back().sum;
  if (!(total > 0)) {
    cost.no_edge += static_cast<uint64_t>(count);
    return;
  }
  const double offset = rng.uniform();
  size_t i = 0;
  for (int j = 0; j < count; ++j) {
    const double target = (j + offset) / count * total;
    while (i + 1 < pieces.size() && pieces[i].sum <= target) ++i;
    // What is read of its edge comes in while the others are drawn.
    const EdgeRef edge = pieces[i].piece.edge;
    edges.object(edge.object).fetch_ends(edge.edge);
    const double before = i == 0 ? 0 : pieces[i - 1].sum, weight = pieces[i].sum - before;
    const double u = std::clamp((target - before) / weight, 0.0, 1.0);
    drawn.push_back(point_at(pieces[i], u, weight / total * points));
  }
}

namespace {
thread_local ListCount listed_here;
}

ListCount listed_by_thread() { return listed_here; }

double list_work(const ListCount& count) {
  return 2 * static_cast<double>(count.cones) + 0.25 * static_cast<double>(count.pieces);
}

void DirectEdges::list(const EdgeQuery& emitters, const EdgeQuery& patches, double u,
                       DirectPieces& to) const {
  static thread_local std::vector<LightRegions::Choice> choices;
  static thread_local std::vector<ListedEdge> listed;
  static thread_local std::vector<EdgePiece> pieces;
  to.clear();
  ++listed_here.lists;
  regions_.choose(emitters.p, u, choices);
  for (const auto& [k, expected, times] : choices) {
    const EdgeQuery& query = regions_.shape(k).valid() ? emitters : patches;
    const std::optional<DirectionCone> cone = regions_.cone(k, query.p, query.n);
    if (!cone) continue;
    ++listed_here.cones;
    listed.clear();
    pieces.clear();
    sampler_.list_outlines(query, *cone, listed);
    cut_edges(edges_, query, *cone, listed, pieces);
    listed_here.pieces += pieces.size();
    const auto is_own = [&, k = k](const EdgePiece& piece) {
      return piece.edge.object == regions_.shape(k);
    };
    const bool small = regions_.hull(k).radius < kSmall * length(regions_.hull(k).center - query.p);
    const bool apart = small || std::ranges::count_if(pieces, is_own) <= kMostSides;
    for (const EdgePiece& piece : pieces) {
      std::vector<DirectPieces::Piece>& list = apart && is_own(piece) ? to.outlines : to.others;
      const bool first = list.empty() || (&list == &to.outlines && list.back().region != k);
      const double density = expected / times;
      const double weight = piece.weight * regions_.luminance(k) / density;
      list.push_back({k, piece, weight + (first ? 0 : list.back().sum), density});
    }
  }
}

void DirectEdges::draw(const DirectPieces& pieces, const Rng& key, int bounces, int samples,
                       TermCost& cost, std::vector<DirectPoint>& points) const {
  points.clear();
  draw_pieces(edges_, pieces.others, key.at(Purpose::kDirect, bounces), kPoints, samples, cost,
              points);
  const Rng rng = key.copy(Purpose::kDirectCopy, 1).at(Purpose::kDirect, bounces);
  const std::span outlines(pieces.outlines);
  for (size_t begin = 0, end = 0; begin < outlines.size(); begin = end) {
    while (end < outlines.size() && outlines[end].region == outlines[begin].region) ++end;
    const auto sides = outlines.subspan(begin, end - begin);
    if (sides.size() > kMostSides) {
      draw_pieces(edges_, sides, rng, kMostSides, samples, cost, points);
    } else {
      draw_sides(sides, Rng(rng).uniform(), samples, cost, points);
    }
  }
}

}  // namespace limn
