// Lists of outlines in front of highlights, and points on them.
#include "integrators/terms/highlight_edges.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// Points for one sample. Not tuned.
constexpr int kPoints = 2;
// Wider highlights are left to other samplers: lists would be long. Not tuned.
constexpr double kWidest = 0.8;
// And narrower: by rounding a direction would lie in its cap or not.
constexpr double kNarrowest = 1e-6;
// What a piece weighs at least, over what it would if the highlight filled its cap evenly.
constexpr double kEven = 0.1;
// A highlight is listed if it is this many times as bright as what else is seen. With any
// the error times time of a teapot under two emitters on gloss was 1.5 times as large.
constexpr double kBright = 4;
// A grazing highlight is narrow across, and its cap says little. A facing one fills its cap with
// this share of its peak.
constexpr double kOfPeak = 0.25;
// The most times that a piece is halved. Not tuned.
constexpr int kHalvings = 8;
// Beside the middle of a piece, where the density shows which half holds its brightest point.
constexpr double kBeside = 0x1p-7;

// The most sharp edges of a glossy shape that are listed beside outlines, and the widest lobe of
// one. Not tuned.
constexpr size_t kMostOfShape = 64;
constexpr double kGlossy = 0.35;

// The halves of a piece, with half its weight each: a weight is that of the viewer's lobe, which
// changes little over a piece.
std::array<EdgePiece, 2> halves_of(const EdgePiece& piece) {
  std::array<EdgePiece, 2> halves{piece, piece};
  halves[0].t1 = halves[1].t0 = piece.place(0.5).t;
  halves[0].inverse_l1 = halves[1].inverse_l0 = 0.5 * (piece.inverse_l0 + piece.inverse_l1);
  for (EdgePiece& half : halves) half.weight = 0.5 * piece.weight;
  return halves;
}

}  // namespace

HighlightEdges::HighlightEdges(const Scene& scene, const EdgeSamplerInput& edges,
                               const EdgeSampler& sampler, const MirroredLight& mirrored)
    : edges_(edges), sampler_(sampler), mirrored_(mirrored) {
  const auto is_glossy = [](const Bsdf* bsdf) {
    return bsdf && bsdf->lobe().model->width(bsdf->lobe()) < kGlossy;
  };
  for (uint32_t o = 0; o < edges.objects.size(); ++o) {
    const EdgeMesh& mesh = edges.objects[o];
    if (!mesh.shape.valid() || mesh.of_texture()) continue;
    if (mesh.count(EdgeClass::kSharp) > kMostOfShape) continue;
    const auto& bsdf = scene.shape(mesh.shape).bsdf;
    if (!is_glossy(bsdf->side(true)) && !is_glossy(bsdf->side(false))) continue;
    for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
      const EdgeId id(e);
      const auto& ends = mesh.edge(id).vertices;
      if (mesh.edge(id).edge_class != EdgeClass::kSharp) continue;
      of_gloss_.push_back({{ShapeId(o), id}, mesh.position(ends[0]), mesh.position(ends[1])});
    }
  }
}

bool HighlightEdges::is_of_gloss(EdgeRef edge, const Vec3d& p) const {
  const EdgeMesh& mesh = edges_.object(edge.object);
  return is_candidate(mesh, edge.edge, p) && !is_outline(mesh, edge.edge, p);
}

void HighlightEdges::list(const PathVertex& vertex, const EdgeQuery& query, View& view) const {
  static thread_local std::vector<ListedEdge> listed;
  static thread_local std::vector<EdgePiece> pieces;
  view.count = 0;
  view.pieces.clear();
  const MirroredLight::Mixture mixture = mirrored_.mixture(vertex.surface, vertex.scattering);
  for (int i = 0; i < mixture.count; ++i) {
    const MirroredLight::Highlight& highlight = mixture.highlight(i);
    if (!(highlight.half_angle > kNarrowest && highlight.half_angle < kWidest)) continue;
    const DirectionCap cap{highlight.toward, std::sin(highlight.half_angle),
                           std::cos(highlight.half_angle)};
    const double solid_angle = 2 * kPi * cap.sine * cap.sine / (1 + cap.cosine);
    const double peak = MirroredLight::pdf(highlight, cap.axis);
    const double bright = std::max(1 / solid_angle, kOfPeak * peak);
    if (!(highlight.irradiance * bright > kBright * mixture.elsewhere)) continue;
    const std::optional<DirectionCone> cone = cone_around(cap, query.n);
    if (!cone) continue;
    listed.clear();
    pieces.clear();
    if (!sampler_.list_outlines(query, *cone, listed)) return;
    for (const ListedEdge& edge : of_gloss_) {
      if (is_of_gloss(edge.id, query.p) && !is_own_edge(edges_, query, edge.id)) {
        listed.push_back(edge);
      }
    }
    cut_edges(edges_, query, *cone, listed, pieces);
    if (pieces.empty()) continue;
    view.caps[view.count] = cap;
    // Of a lobe of that peak, and in the other direction as wide as one that faces the point.
    const double narrow = 1 / (kPi * peak * highlight.half_angle);
    for (const EdgePiece& piece : pieces) {
      add_pieces(query, highlight, mixture.elsewhere, piece, narrow, view);
    }
    ++view.count;
  }
}

void HighlightEdges::add_pieces(const EdgeQuery& query, const MirroredLight::Highlight& highlight,
                                double elsewhere, EdgePiece piece, double narrow,
                                View& view) const {
  const auto direction_at = [&](const EdgePiece& of, double u) {
    return direction(query, {of.edge, of.place(u).t, 1, 1});
  };
  // From behind the plane no edge bounds what is seen in it.
  const auto is_behind = [&](const EdgePiece& of) {
    return -dot(position(of.edge, of.place(0.5).t) - query.p, highlight.normal) > highlight.depth;
  };
  const DirectionCap& cap = view.caps[view.count];
  const double even = kEven / (2 * kPi * cap.sine * cap.sine / (1 + cap.cosine));
  const auto add = [&](const EdgePiece& part) {
    double bright = even;
    // At the ends: beside the brightest point it is brightest there.
    for (const double u : {0.0, 1.0}) {
      if (is_behind(part)) break;
      bright += 0.5 * MirroredLight::pdf(highlight, direction_at(part, u));
    }
    const double before = view.pieces.empty() ? 0 : view.pieces.back().sum;
    view.pieces.push_back({static_cast<uint32_t>(view.count), part,
                           before + part.weight * (bright * highlight.irradiance + elsewhere)});
  };
  for (int i = 0; i < kHalvings && !is_behind(piece); ++i) {
    if (length(direction_at(piece, 1) - direction_at(piece, 0)) <= narrow) break;
    const auto brightness = [&](double u) {
      return MirroredLight::alignment(highlight, direction_at(piece, u));
    };
    const int brighter = brightness(0.5 + kBeside) > brightness(0.5 - kBeside) ? 1 : 0;
    const auto halves = halves_of(piece);
    add(halves[1 - brighter]);
    piece = halves[brighter];
  }
  add(piece);
}

Vec3d HighlightEdges::position(EdgeRef edge, double t) const {
  const EdgeMesh& mesh = edges_.object(edge.object);
  const auto& ends = mesh.edge(edge.edge).vertices;
  return mesh.position(ends[0]) * (1 - t) + mesh.position(ends[1]) * t;
}

Vec3d HighlightEdges::direction(const EdgeQuery& query, const EdgeSample& sample) const {
  return normalize(position(sample.edge, sample.t) - query.p);
}

std::optional<uint32_t> HighlightEdges::cap_of(const View& view, const Vec3d& omega) {
  for (int k = 0; k < view.count; ++k) {
    if (view.caps[k].holds(omega)) return static_cast<uint32_t>(k);
  }
  return {};
}

bool HighlightEdges::hold(const View& view, const EdgeQuery& query,
                          const EdgeSample& sample) const {
  if (view.count == 0 || !cap_of(view, direction(query, sample))) return false;
  const auto is_it = [&](const ListedEdge& edge) { return edge.id == sample.edge; };
  return is_outline(edges_.object(sample.edge.object), sample.edge.edge, query.p) ||
         std::ranges::any_of(of_gloss_, is_it);
}

void HighlightEdges::draw(const View& view, const EdgeQuery& query, const Rng& rng, int samples,
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
