// Lists the pieces of shadows on faces, and draws points on them by a forest of edges.
//
// Through y(t) = (1 - t) y_0 + t y_1 light passes along w(t), which is linear in t, and it reaches
// l + w(t) / k, or y(t) - k d at infinity. So points of the sheet with (t, k) on a line are on a
// line in space, and what light meets first behind the edge is the upper envelope of all segments
// in which faces cut the sheet: of those below the edge, where none above it hides the edge.
#include "integrators/terms/shadow_pieces.h"

#include <algorithm>
#include <cmath>

#include "integrators/terms/shadow_edges.h"
#include "limn/core/parallel.h"
#include "limn/edgetree/edge_sampler_types.h"

namespace limn {
namespace {

// Nearer to its edge, a shadow starts behind the edge for every viewer (ShadowEdges::cast).
constexpr double kTouching = 0x1p-20;
// Relative to the distance of the edge: what lies nearer to a light hides the edge, too.
constexpr double kAtLight = 0x1p-20;

bool is_around(const FacesAround& around, FaceRef face) {
  return std::find(around.all.begin(), around.all.end(), face) != around.all.end();
}

}  // namespace

LightSheet::LightSheet(const LightOrigin& origin, const Vec3d& y0, const Vec3d& y1)
    : infinite_(origin.infinite),
      y0_(y0),
      along_(y1 - y0),
      w0_(origin.through(y0)),
      w1_(origin.through(y1)),
      normal_(cross(w0_, along_)) {
  const double scale = 1 / length_squared(normal_);
  if (infinite_) {
    // x - y_0 = b along - k w
    to_b_ = cross(w0_, normal_) * -scale;
    to_a_ = -to_b_;
    to_k_ = cross(along_, normal_) * -scale;
  } else {
    // x - l = a w_0 + b w_1
    to_a_ = cross(w1_, normal_) * scale;
    to_b_ = cross(normal_, w0_) * scale;
  }
  const double offset = dot(normal_, y0_);
  const OnSheet at = on_sheet({});
  bounds_ = {{{normal_, -offset}, {-normal_, offset}, {to_a_, at.a}, {to_b_, at.b}}};
}

LightSheet::OnSheet LightSheet::on_sheet(const Vec3d& x) const {
  if (infinite_) {
    const double b = dot(to_b_, x - y0_);
    return {1 - b, b, dot(to_k_, x - y0_)};
  }
  const Vec3d from = x - y0_ + w0_;
  return {dot(to_a_, from), dot(to_b_, from), 0};
}

std::optional<Stretch> LightSheet::cut(const std::array<Vec3d, 3>& corners, uint32_t label) const {
  OnSheet ends[2];
  int count = 0;
  double sides[3];
  for (int i = 0; i < 3; ++i) sides[i] = dot(normal_, corners[i] - y0_);
  for (int i = 0; i < 3 && count < 2; ++i) {
    const int j = (i + 1) % 3;
    if ((sides[i] < 0) == (sides[j] < 0)) continue;
    const double s = sides[i] / (sides[i] - sides[j]);
    ends[count++] = on_sheet(corners[i] + (corners[j] - corners[i]) * s);
  }
  if (count < 2) return {};
  double from = 0, to = 1;
  const auto clip = [&](double at_0, double at_1) {
    return DirectionCone::clip_by(at_0, at_1, from, to);
  };
  if (!clip(ends[0].a, ends[1].a) || !clip(ends[0].b, ends[1].b)) return {};
  if (!infinite_ && !clip(ends[0].a + ends[0].b - kAtLight, ends[1].a + ends[1].b - kAtLight))
    return {};
  double t[2], k[2];
  for (int e = 0; e < 2; ++e) {
    const double s = e == 0 ? from : to;
    const double a = ends[0].a * (1 - s) + ends[1].a * s, b = ends[0].b * (1 - s) + ends[1].b * s;
    t[e] = std::clamp(b / (a + b), 0.0, 1.0);
    k[e] = infinite_ ? ends[0].k * (1 - s) + ends[1].k * s : 1 / (a + b);
  }
  const bool turned = t[0] > t[1];
  const Stretch stretch{t[turned], t[!turned], k[turned], k[!turned], label};
  const bool wide = stretch.t1 - stretch.t0 > 0x1p-40;
  if (!wide || !std::isfinite(stretch.k0 + stretch.k1)) return {};
  return stretch;
}

Vec3d LightSheet::point(double t, double k) const {
  const Vec3d y = y0_ + along_ * t;
  if (infinite_) return y - w0_ * k;
  const Vec3d w = w0_ + along_ * t;
  return y - w + w * (1 / k);
}

double ShadowPiece::from_edge(double t, double& slope) const {
  const double s = std::clamp((t - t0) / (t1 - t0), 0.0, 1.0);
  slope = 1 / (t1 - t0);
  if (infinite) return s;
  const double sum = (1 - s) * k0 + s * k1;
  slope *= k0 * k1 / (sum * sum);
  return s * k1 / sum;
}

double ShadowPiece::to_edge(double fraction) const {
  const double s = infinite ? fraction : fraction * k0 / ((1 - fraction) * k1 + fraction * k0);
  return t0 + (t1 - t0) * s;
}

ShadowPieces::ShadowPieces(const PathContext& context, const EdgeSamplerInput& input,
                           std::span<const ShadowEdge> edges, bool free, int threads)
    : context_(context), input_(input) {
  list(edges, threads);
  if (pieces_.empty()) return;
  place(edges, free);
  forest_ = make_edge_sampler("forest", placed_, threads);
}

void ShadowPieces::list(std::span<const ShadowEdge> edges, int threads) {
  constexpr size_t kBlock = 64;  // edges; not tuned
  const FaceTree tree(context_.scene);
  const double reach = bounds_of(context_.scene).diagonal();
  std::vector<std::vector<ShadowPiece>> found((edges.size() + kBlock - 1) / kBlock);
  parallel_for(found.size(), threads, [&](size_t block) {
    std::vector<const FaceTree::Item*> items;
    std::vector<Stretch> cuts;
    for (size_t i = kBlock * block; i < std::min(edges.size(), kBlock * (block + 1)); ++i) {
      const EdgeMesh& mesh = input_.object(edges[i].id.object);
      const auto& ends = mesh.edge(edges[i].id.edge).vertices;
      const FacesAround around = mesh.around(edges[i].id.edge);
      const LightSheet sheet(edges[i].light->origin(), mesh.position(ends[0]),
                             mesh.position(ends[1]));
      items.clear();
      cuts.clear();
      tree.list(sheet.bounds(), items);
      for (uint32_t n = 0; n < items.size(); ++n) {
        if (is_around(around, items[n]->face)) continue;
        const auto& c = items[n]->corners;
        const auto cut = sheet.cut({cast<double>(c[0]), cast<double>(c[1]), cast<double>(c[2])}, n);
        if (cut) cuts.push_back(*cut);
      }
      const double most = sheet.infinite() ? -kTouching * reach : 1 - kTouching;
      for (const Stretch& part : upper_envelope(cuts)) {
        double from = 0, to = 1;
        if (!DirectionCone::clip_by(most - part.k0, most - part.k1, from, to)) continue;
        const double width = part.t1 - part.t0;
        const double t0 = part.t0 + width * from, t1 = part.t0 + width * to;
        if (!(t1 > t0)) continue;
        found[block].push_back({static_cast<uint32_t>(i),
                                t0,
                                t1,
                                part.at(t0),
                                part.at(t1),
                                items[part.label]->face,
                                {},
                                sheet.infinite()});
      }
    }
  });
  first_.assign(edges.size() + 1, 0);
  for (const auto& some : found) {
    for (const ShadowPiece& piece : some) ++first_[piece.edge + 1];
    pieces_.insert(pieces_.end(), some.begin(), some.end());
  }
  for (size_t i = 0; i < edges.size(); ++i) first_[i + 1] += first_[i];
}

// Of the point of a face that light through y(t) meets.
Vec3<Lanes> ShadowPieces::velocity(const ShadowEdge& edge, FaceRef face, double t) const {
  const EdgeMesh& mesh = input_.object(edge.id.object);
  const auto& ends = mesh.edge(edge.id.edge).vertices;
  const Vec3<Dual> y =
      moving_vertex(mesh, ends[0]) * Dual(1 - t) + moving_vertex(mesh, ends[1]) * Dual(t);
  const Vec3<Dual> w = edge.light->origin().through(y);
  const auto c = face_corners<Dual>(context_.scene.shape(face.shape).mesh, face.face);
  const Vec3<Dual> n = cross(c[1] - c[0], c[2] - c[0]);
  const Vec3<Dual> x = y + w * (dot(n, c[0] - y) / dot(n, w));
  Vec3<Lanes> v{x.x.d, x.y.d, x.z.d};
  for (int k = 0; k < 3; ++k)
    for (int lane = 0; lane < kLanes; ++lane)
      if (!std::isfinite(v[k][lane])) v[k][lane] = 0;
  return v;
}

void ShadowPieces::place(std::span<const ShadowEdge> edges, bool free) {
  const Vec3<Lanes> axes{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
  placed_.lane_scale = input_.lane_scale;
  placed_.objects.resize(input_.objects.size());
  numbers_.resize(input_.objects.size());
  for (size_t o = 0; o < input_.objects.size(); ++o) {
    placed_.objects[o].planes = input_.objects[o].planes;
    placed_.objects[o].shape = input_.objects[o].shape;
    placed_.objects[o].face_offsets = {0};
  }
  for (uint32_t i = 0; i < pieces_.size(); ++i) {
    ShadowPiece& piece = pieces_[i];
    const ShadowEdge& edge = edges[piece.edge];
    const EdgeMesh& caster = input_.object(edge.id.object);
    const Edge& own = caster.edge(edge.id.edge);
    EdgeMesh& mesh = placed_.objects[edge.id.object.index()];
    piece.place = {edge.id.object, EdgeId(static_cast<uint32_t>(mesh.edges.size()))};
    numbers_[edge.id.object.index()].push_back(i);
    const LightSheet sheet(edge.light->origin(), caster.position(own.vertices[0]),
                           caster.position(own.vertices[1]));
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (const bool end : {false, true}) {
      const double t = end ? piece.t1 : piece.t0;
      const Vec3d x = sheet.point(t, end ? piece.k1 : piece.k0);
      mesh.positions.push_back(x);
      mesh.tangents.push_back(free ? axes : velocity(edge, piece.face, t));
      mesh.extent = std::max({mesh.extent, std::fabs(x.x), std::fabs(x.y), std::fabs(x.z)});
    }
    Edge placed;
    placed.vertices = {VertexId(first), VertexId(first + 1)};
    placed.faces = {own.faces[0], FaceId{}};
    placed.edge_class = EdgeClass::kBoundary;
    mesh.edges.push_back(placed);
    mesh.incident_faces.push_back(piece.face);
    mesh.face_offsets.push_back(static_cast<uint32_t>(mesh.edges.size()));
  }
}

void ShadowPieces::draw(const EdgeQuery& query, std::span<Rng> rngs,
                        std::vector<std::optional<ShadowDraw>>& draws) const {
  static thread_local std::vector<std::optional<EdgeSample>> drawn;
  forest_->sample_several(query, rngs, drawn);
  draws.clear();
  for (const auto& sample : drawn) {
    draws.emplace_back();
    if (!sample) continue;
    const auto& numbers = numbers_[sample->edge.object.index()];
    const ShadowPiece& piece = pieces_[numbers[sample->edge.edge.index()]];
    const double t = piece.to_edge(sample->t);
    double slope;
    piece.from_edge(t, slope);
    draws.back() = {piece.edge, t, sample->probability * sample->pdf_t * slope};
  }
}

double ShadowPieces::density(const EdgeQuery& query, uint32_t edge, double t) const {
  const auto begin = pieces_.begin() + first_[edge], end = pieces_.begin() + first_[edge + 1];
  const auto found = std::lower_bound(
      begin, end, t, [](const ShadowPiece& piece, double at) { return piece.t1 < at; });
  if (found == end || t < found->t0) return 0;
  double slope;
  const double fraction = found->from_edge(t, slope);
  const double probability = forest_->probability(query, found->place);
  if (!(probability > 0)) return 0;
  return probability * forest_->pdf_t(query, found->place, fraction) * slope;
}

}  // namespace limn
