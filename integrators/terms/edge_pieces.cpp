// Pieces of edges: cut so that directions hardly turn within one, weighed, drawn.
#include "integrators/terms/edge_pieces.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// The largest angle of a piece: of the hemisphere, and as a share of the lobe's width. Not tuned.
constexpr double kWidest = 0.3, kShareOfLobe = 0.5, kNarrowest = 0.02;

constexpr double kGauss = 0.21132486540518712;  // (1 - 1 / sqrt(3)) / 2

double widest_of(const LobeSummary& lobe) {
  return std::clamp(kShareOfLobe * lobe.model->width(lobe), kNarrowest, kWidest);
}

}  // namespace

// z(u) meets the edge at s = (u / l_1) / ((1 - u) / l_0 + u / l_1) of the way between the ends.
EdgePiece::Place EdgePiece::place(double u) const {
  const double sum = (1 - u) * inverse_l0 + u * inverse_l1;
  const double s = u * inverse_l1 / sum;
  return {t0 + (t1 - t0) * s, sum * sum / (inverse_l0 * inverse_l1 * (t1 - t0))};
}

EdgePieces::EdgePieces(const EdgeQuery& query, int lanes, const Lanes& lane_scale)
    : query_(query),
      lanes_(lanes),
      scale_(lane_scale),
      lobe_(query.lobe, query.n, query.wi),
      widest_(widest_of(query.lobe)),
      cosine_of_widest_(std::cos(widest_)) {}

void EdgePieces::add(const ListedEdge& edge, const EdgeMesh& mesh, double t0, double t1,
                     std::vector<EdgePiece>& pieces) const {
  const Vec3d w0 = edge.x0 - query_.p, along = edge.x1 - edge.x0;
  const Vec3d side = cross(w0, along);
  const double side_length = length(side);
  if (side_length == 0) return;
  const auto [i, j] = mesh.edge(edge.id.edge).vertices;
  const Vec3d m = side / side_length;
  const auto across = [&](VertexId vertex) {
    const Vec3<Lanes> v = relative_velocity(mesh, vertex, query_);
    Across result{};
    for (int k = 0; k < lanes_; ++k)
      result.lane[k] = scale_[k] * (m.x * v.x[k] + m.y * v.y[k] + m.z * v.z[k]);
    return result;
  };
  const Across v0 = across(i), v1 = across(j);

  const Vec3d a = w0 + along * t0, b = w0 + along * t1;
  const double l_a = length(a), l_b = length(b), cosine = dot(a, b);
  if (l_a == 0 || l_b == 0) return;
  const bool is_short = cosine >= cosine_of_widest_ * l_a * l_b;
  const double angle = is_short ? 0 : std::atan2(side_length * (t1 - t0), cosine);
  const int count = is_short ? 1 : static_cast<int>(std::ceil(angle / widest_));
  double begin = t0;
  Vec3d w_begin = a;
  for (int k = 1; k <= count; ++k) {
    double end = t1;
    if (k < count) {
      // Where the direction has turned by k / count of the angle.
      const double to_a = std::sin(angle * (count - k) / count) / l_a;
      const double to_b = std::sin(angle * k / count) / l_b;
      end = t0 + (t1 - t0) * (to_b / (to_a + to_b));
    }
    const Vec3d w_end = w0 + along * end;
    EdgePiece piece{edge.id, begin, end, 1 / length(w_begin), 1 / length(w_end), 0};
    const double sine = side_length * (end - begin) * piece.inverse_l0 * piece.inverse_l1;
    piece.weight = weigh(w_begin, w_end, piece, sine, v0, v1);
    if (piece.weight > 0 && std::isfinite(piece.weight)) pieces.push_back(piece);
    begin = end;
    w_begin = w_end;
  }
}

double EdgePieces::weigh(const Vec3d& a, const Vec3d& b, const EdgePiece& piece, double sine,
                         const Across& v0, const Across& v1) const {
  double sum = 0;
  for (const double u : {kGauss, 1 - kGauss}) {
    const double to_a = (1 - u) * piece.inverse_l0, to_b = u * piece.inverse_l1;
    const Vec3d z = a * to_a + b * to_b;
    const double z2 = length_squared(z), z_length = std::sqrt(z2);
    // v at t is (1 - t) v0 + t v1.
    const double to_v1 = to_a * piece.t0 + to_b * piece.t1, to_v0 = to_a + to_b - to_v1;
    double speed = 0;
    for (int k = 0; k < lanes_; ++k) speed += std::fabs(v0.lane[k] * to_v0 + v1.lane[k] * to_v1);
    sum += lobe_.value(z / z_length) * speed / (z2 * z_length);
  }
  return 0.5 * sine * sum;
}

}  // namespace limn
