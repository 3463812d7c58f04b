// Pieces of edges with nearly constant directions: cutting, weights, sampling.
#include "limn/edgetree/edge_pieces.h"

#include <algorithm>
#include <cmath>

#include "edgetree/lobe/ltc.h"

namespace limn {
namespace {

// Largest angle of a piece: absolute, and as a share of the lobe's width. Not tuned.
constexpr double kWidest = 0.3, kShareOfLobe = 0.5, kNarrowest = 0.02;

constexpr double kGauss = 0.21132486540518712;  // (1 - 1 / sqrt(3)) / 2

double widest_of(const LobeSummary& lobe) {
  return std::clamp(kShareOfLobe * lobe.model->width(lobe), kNarrowest, kWidest);
}

// Prefetch distance in edges. Not tuned.
constexpr size_t kAhead = 4;

Lanes dot_lanes(const Vec3<Lanes>& v, const Vec3d& m) { return v.x * m.x + v.y * m.y + v.z * m.z; }

// Cuts the edges seen by one query.
class EdgeCutter {
 public:
  EdgeCutter(const EdgeQuery& query, const Lanes& lane_scale);
  // Adds the part [t0, t1] of an edge, which is above the horizon.
  void add(const ListedEdge& edge, const EdgeMesh& mesh, double t0, double t1,
           std::vector<EdgePiece>& pieces) const;

 private:
  double mean_over(const EdgePiece& piece, const Vec3d& w0, const Vec3d& along, const Lanes& v0,
                   const Lanes& v1) const;

  const EdgeQuery& query_;
  Lanes scale_;
  LtcLobe lobe_;
  double widest_, cosine_of_widest_;
  bool turns_;
};

// Prefetches the mesh data that `add` reads.
void fetch(const ListedEdge& edge, const EdgeMesh& mesh) {
  if (mesh.tangents.empty()) return;
  for (const VertexId vertex : mesh.edge(edge.id.edge).vertices)
    mesh.tangents.fetch(vertex.index());
}

EdgeCutter::EdgeCutter(const EdgeQuery& query, const Lanes& lane_scale)
    : query_(query),
      scale_(lane_scale),
      lobe_(query.lobe, query.n, query.wi),
      widest_(widest_of(query.lobe)),
      cosine_of_widest_(std::cos(widest_)),
      turns_(!is_zero(query.turn.rate.x) || !is_zero(query.turn.rate.y) ||
             !is_zero(query.turn.rate.z)) {}

void EdgeCutter::add(const ListedEdge& edge, const EdgeMesh& mesh, double t0, double t1,
                     std::vector<EdgePiece>& pieces) const {
  const Vec3d w0 = edge.x0 - query_.p, along = edge.x1 - edge.x0;
  const Vec3d side = cross(w0, along);
  const Vec3d a = w0 + along * t0, b = w0 + along * t1;
  const double l_a = length(a), l_b = length(b), side_length = length(side);
  if (side_length == 0 || l_a == 0 || l_b == 0) return;
  const Vec3d m = side / side_length;
  Lanes v0 = dot_lanes(query_.velocity, -m), v1 = v0;
  if (!mesh.tangents.empty()) {
    const auto [i, j] = mesh.edge(edge.id.edge).vertices;
    v0 += dot_lanes(mesh.tangent(i), m);
    v1 += dot_lanes(mesh.tangent(j), m);
  }
  if (turns_) {
    v0 = v0 - dot_lanes(query_.turn.velocity(w0), m);
    v1 = v1 - dot_lanes(query_.turn.velocity(w0 + along), m);
  }
  if (is_zero(v0) && is_zero(v1)) return;

  const auto append = [&](double begin, double end, double l_begin, double l_end) {
    EdgePiece piece{edge.id, begin, end, 1 / l_begin, 1 / l_end, 0};
    const double sine = side_length * (end - begin) * piece.inverse_l0 * piece.inverse_l1;
    piece.weight = sine * mean_over(piece, w0, along, v0, v1);
    if (piece.weight > 0 && std::isfinite(piece.weight)) pieces.push_back(piece);
  };
  const double cosine = dot(a, b);
  if (cosine >= cosine_of_widest_ * l_a * l_b) return append(t0, t1, l_a, l_b);
  const double angle = std::atan2(side_length * (t1 - t0), cosine);
  const int count = static_cast<int>(std::ceil(angle / widest_));
  double begin = t0, l_begin = l_a;
  for (int k = 1; k <= count; ++k) {
    // The point where the direction has turned by k / count of the angle.
    const double to_a = std::sin(angle * (count - k) / count) / l_a;
    const double to_b = std::sin(angle * k / count) / l_b;
    const double end = k < count ? t0 + (t1 - t0) * (to_b / (to_a + to_b)) : t1;
    const double l_end = length(w0 + along * end);
    append(begin, end, l_begin, l_end);
    begin = end;
    l_begin = l_end;
  }
}

// Mean over u of f_s(z / |z|) |m . v(z)| / |z|^3, with velocities divided by distance. m: normal of
// the plane through p and the edge; v0, v1: m . v at the ends of the whole edge.
double EdgeCutter::mean_over(const EdgePiece& piece, const Vec3d& w0, const Vec3d& along,
                             const Lanes& v0, const Lanes& v1) const {
  double sum = 0;
  for (const double u : {kGauss, 1 - kGauss}) {
    const double to_begin = (1 - u) * piece.inverse_l0, to_end = u * piece.inverse_l1;
    const double to_both = to_begin + to_end, to_v1 = to_begin * piece.t0 + to_end * piece.t1;
    double speed = 0;
    for (int k = 0; k < kLanes; ++k)
      speed += scale_[k] * std::fabs(v0[k] * (to_both - to_v1) + v1[k] * to_v1);
    sum += speed * lobe_.homogeneous_value(w0 * to_both + along * to_v1);
  }
  return 0.5 * sum;
}

}  // namespace

// z(u) meets the edge at the fraction s = (u / l_1) / ((1 - u) / l_0 + u / l_1) between the ends.
EdgePiece::Sample EdgePiece::place(double u) const {
  const double sum = (1 - u) * inverse_l0 + u * inverse_l1;
  const double s = u * inverse_l1 / sum;
  return {t0 + (t1 - t0) * s, sum * sum / (inverse_l0 * inverse_l1 * (t1 - t0))};
}

void cut_edges(const EdgeSamplerInput& input, const EdgeQuery& query, const DirectionCone& cone,
               std::span<const ListedEdge> edges, std::vector<EdgePiece>& pieces) {
  if (edges.empty()) return;
  const EdgeCutter cutter(query, input.lane_scale);
  for (size_t i = 0; i < edges.size(); ++i) {
    if (i + kAhead < edges.size()) {
      const ListedEdge& next = edges[i + kAhead];
      fetch(next, input.object(next.id.object));
    }
    const Vec3d w0 = edges[i].x0 - query.p, w1 = edges[i].x1 - query.p;
    double t0 = 0, t1 = 1;
    if (!DirectionCone::clip_by(dot(query.n, w0), dot(query.n, w1), t0, t1)) continue;
    if (!cone.clip(w0, w1, t0, t1)) continue;
    cutter.add(edges[i], input.object(edges[i].id.object), t0, t1, pieces);
  }
}

}  // namespace limn
