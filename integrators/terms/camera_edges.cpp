// Listing what moves on the film, and drawing points of it.
#include "integrators/terms/camera_edges.h"

#include "integrators/estimates/splat.h"

namespace limn {
namespace {

// Where positions move, edges are drawn in pieces of so many pixels at most. Not tuned.
constexpr double kPieceLength = 2;
// The share of its motion against all pixels around it in how likely a piece is drawn; the rest
// goes by those that see its middle. Not tuned.
constexpr double kAllAround = 0.1;
// The weight, beside that of a parameter, of edges seen through panes, which are alike in it. Not
// tuned.
constexpr double kAlike = 0.1;
// The least of the share of either kind of edges that it would have if differences were alike. Not
// tuned.
constexpr double kLeastOfKind = 0.25;
// Points of either kind whose differences are looked at. Not tuned.
constexpr int kLooks = 128;

Lanes larger(const Lanes& a, const Lanes& b) {
  Lanes result;
  for (int k = 0; k < kLanes; ++k) result[k] = std::max(std::fabs(a[k]), std::fabs(b[k]));
  return result;
}

// The root mean square, over the pixels that see a piece of an edge, of how fast it moves against
// their positions. Positive wherever that is not zero for one of them.
class SpeedAgainstFilm {
 public:
  SpeedAgainstFilm(const Film& film, const FilmMotionAt& motion) : film_(film), motion_(motion) {}

  Lanes of(const FilmEdge& edge, double s0, double s1) const {
    const auto at = [&](double a, double b, double s) { return a + (b - a) * s; };
    const double x0 = at(edge.x0, edge.x1, s0), x1 = at(edge.x0, edge.x1, s1);
    const double y0 = at(edge.y0, edge.y1, s0), y1 = at(edge.y0, edge.y1, s1);
    const Lanes v0 = edge.speed0 * (1 - s0) + edge.speed1 * s0;
    const Lanes v1 = edge.speed0 * (1 - s1) + edge.speed1 * s1;
    Lanes around, seen;
    double count = 0, weights = 0;
    const auto square = [&](int x, int y) {
      Lanes along;
      if (const FilmMotion* m = motion_(x, y)) along = m->x * edge.nx + m->y * edge.ny;
      const Lanes moving = larger(v0 - along, v1 - along), held = larger(v0, v1);
      const bool rests = ends_at_once(film_.filter, film_.range_x(x).lower) ||
                         ends_at_once(film_.filter, film_.range_x(x).upper) ||
                         ends_at_once(film_.filter, film_.range_y(y).lower) ||
                         ends_at_once(film_.filter, film_.range_y(y).upper);
      Lanes result;
      for (int k = 0; k < kLanes; ++k) {
        result[k] = moving[k] * moving[k] + (rests ? kTaper * held[k] * held[k] : 0);
      }
      return result;
    };
    const auto [first_x, last_x] = pixels(x0, x1, film_.crop_x, film_.crop_width);
    const auto [first_y, last_y] = pixels(y0, y1, film_.crop_y, film_.crop_height);
    for (int y = first_y; y <= last_y; ++y) {
      for (int x = first_x; x <= last_x; ++x) {
        around += square(x, y);
        ++count;
      }
    }
    for_every_pixel_of(film_, 0.5 * (x0 + x1), 0.5 * (y0 + y1), [&](int x, int y, double weight) {
      seen += square(x, y) * std::fabs(weight);
      weights += std::fabs(weight);
    });
    Lanes result;
    for (int k = 0; k < kLanes; ++k) {
      double mean = count > 0 ? kAllAround * around[k] / count : 0;
      if (weights > 0) mean += (1 - kAllAround) * seen[k] / weights;
      result[k] = std::sqrt(mean);
    }
    return result;
  }

 private:
  // That may see something between two places.
  std::pair<int, int> pixels(double a, double b, int begin, int count) const {
    const double radius = film_.filter.radius;
    const double first = std::floor(std::min(a, b) - 0.5 - radius);
    const double last = std::ceil(std::max(a, b) - 0.5 + radius);
    return {static_cast<int>(std::max<double>(begin, first)),
            static_cast<int>(std::min<double>(begin + count - 1, last))};
  }

  const Film& film_;
  const FilmMotionAt& motion_;
};

}  // namespace

CameraEdges::CameraEdges(const PathContext& context, const EdgeSamplerInput& input, int lanes,
                         const FreeMotion* free)
    : FilmEdges(context, input, free), lanes_(free ? 3 : lanes) {
  const Stopwatch watch;
  list();
  weigh({});
  find_contrasts();
  moving_ = std::count_if(pieces_.begin(), pieces_.end(),
                          [](const Piece& piece) { return !is_zero(piece.weight); });
  list_seconds_ = watch.seconds();
}

void CameraEdges::list() {
  edges_.clear();
  for (uint32_t v = 0; v < views_.size(); ++v) {
    const size_t first = edges_.size();
    if (views_[v].refracted) {
      for (uint32_t o = 0; o < input_.objects.size(); ++o) add_refracted(ShapeId(o), v);
      continue;
    }
    const CameraView<Dual> view(views_[v].camera);
    for (uint32_t o = 0; o < input_.objects.size(); ++o) add_object(ShapeId(o), v, view);
    if (v == 0) {
      for (uint32_t c = 0; c < clips_.size(); ++c) add_clip(c);
    }
    find_in_line(first);
  }
}

void CameraEdges::find_in_line(size_t first) {
  const auto edges = std::span(edges_).subspan(first);
  const EdgesInLine found = find_edges_in_line(edges, resting_, context_.scene.camera);
  for (size_t e = 0; e < edges.size(); ++e) edges[e].in_line = found.in_line[e];
  if (!parting_ || first == 0) parting_ = found.parting;
  resting_ = {};
}

void CameraEdges::add_object(ShapeId object, uint32_t index, const CameraView<Dual>& camera) {
  const FilmView& view = views_[index];
  const EdgeMesh& mesh = input_.object(object);
  for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
    const EdgeRef id{object, EdgeId(e)};
    FilmEdge edge;
    edge.view = index;
    if (!view.viewpoint->is_candidate(mesh, id.edge)) continue;
    if (view.direct() ? is_hidden(mesh, id.edge) : view.touches_mirror(mesh.faces_around(id.edge)))
      continue;
    if (!place(id, camera, edge, view.direct() ? nullptr : &view)) continue;
    const FacesAround around = mesh.around(id.edge);
    if (!view.viewpoint->sees_edge_on(around)) edge.shape = around.faces[0].shape;
    add(edge, faces_that_move(mesh, id.edge));
  }
}

void CameraEdges::add_refracted(ShapeId object, uint32_t view) {
  for (uint32_t e = 0; e < input_.object(object).edges.size(); ++e) {
    FilmEdge edge;
    if (!place_refracted({object, EdgeId(e)}, view, edge)) continue;
    add_speed(edge, {}, lanes_);
    edges_.push_back(edge);
  }
}

void CameraEdges::add_clip(uint32_t index) {
  FilmEdge edge;
  if (place(index, CameraView<Dual>(views_[0].camera), edge)) add(edge, {&clips_[index].face, 1});
}

void CameraEdges::move_film(const FilmMotionAt& motion) {
  const Stopwatch watch;
  lanes_ = kLanes;
  if (motion && !lists_all_) {
    lists_all_ = true;
    list();
  } else if (!motion && lists_all_) {
    lists_all_ = false;
    std::erase_if(edges_, [](const FilmEdge& edge) { return !moves(edge); });
    edges_.shrink_to_fit();
  }
  weigh(motion);
  list_seconds_ += watch.seconds();
}

void CameraEdges::add_pieces(uint32_t index, const FilmMotionAt& motion) {
  const FilmEdge& edge = edges_[index];
  if (!motion) {
    pieces_.push_back({index, 0, 1, larger(edge.speed0, edge.speed1) * edge.length});
    return;
  }
  const SpeedAgainstFilm speed(context_.scene.film, motion);
  const int count = static_cast<int>(std::ceil(std::max(1.0, edge.length / kPieceLength)));
  for (int i = 0; i < count; ++i) {
    const double s0 = static_cast<double>(i) / count, s1 = static_cast<double>(i + 1) / count;
    pieces_.push_back({index, s0, s1, speed.of(edge, s0, s1) * (edge.length * (s1 - s0))});
  }
}

double CameraEdges::emitted_at(const FilmEdge& edge) const {
  if (edge.clip != FilmEdge::kNoClip) return 0;
  double most = 0;
  for (const FaceRef face : input_.object(edge.id.object).faces_around(edge.id.edge)) {
    const Shape& shape = scene().shape(face.shape);
    if (!shape.is_emitter) continue;
    const Rgb<double> radiance = value(shape.radiance);
    most = std::max(most, (radiance.r + radiance.g + radiance.b) / 3);
  }
  return most;
}

double CameraEdges::fold_at(const EdgeMesh& mesh, EdgeId id) const {
  const Mesh& of = scene().shape(mesh.shape).mesh;
  if (of.normal_source != NormalSource::kFace || of.textured) return 1;
  const auto [first, second] = mesh.edge(id).faces;
  return length(cross(mesh.plane(first).n, mesh.plane(second).n));
}

CameraEdges::Contrast CameraEdges::contrast_of(const FilmEdge& edge) const {
  if (const double emitted = emitted_at(edge); emitted > 0) return {kEmitter, emitted};
  const Camera& camera = views_[edge.view].camera;
  if (edge.clip != FilmEdge::kNoClip || edge.refracted || camera.is_orthographic())
    return {kOutline, 1};
  const EdgeMesh& mesh = input_.object(edge.id.object);
  const EdgeId id = edge.id.edge;
  if (mesh.edge(id).edge_class != EdgeClass::kSharp || is_outline(mesh, id, value(camera.origin)))
    return {kOutline, 1};
  return {kFold, fold_at(mesh, id)};
}

double CameraEdges::root_mean_square(Kind kind) const {
  DiscreteDistribution choice;
  for (const Piece& piece : pieces_) {
    const FilmEdge& edge = edges_[piece.edge];
    double share = 0;
    for (int k = 0; k < lanes_; ++k) share += piece.weight[k];
    choice.add(!edge.refracted && contrast_of(edge).kind == kind ? share : 0);
  }
  if (!(choice.sum() > 0)) return 0;
  double squares = 0;
  for (int i = 0; i < kLooks; ++i) {
    const DiscreteDistribution::Draw draw = choice.sample((i + 0.5) / kLooks);
    const FilmEdgePoint point = point_on(pieces_[draw.index], draw.fraction);
    const double over = contrast_of(point.edge).unit;
    RayCount rays;
    Rgb<double> d;
    MirrorFaces by;
    try {
      if (!difference_at(point, {0, 0, static_cast<uint64_t>(i)}, rays, d, by)) continue;
    } catch (const UntraceableRay&) {  // samples will count it
      continue;
    }
    if (is_finite(d) && over > 0)
      squares += (d.r * d.r + d.g * d.g + d.b * d.b) / (3 * over * over * kLooks);
  }
  return std::sqrt(squares);
}

void CameraEdges::find_contrasts() {
  std::array<bool, kKinds> any{};
  for (const FilmEdge& edge : edges_)
    if (moves(edge) && !edge.refracted) any[contrast_of(edge).kind] = true;
  if (empty() || std::ranges::count(any, true) < 2) return;
  for (int kind = 0; kind < kKinds; ++kind)
    differences_[kind] = root_mean_square(static_cast<Kind>(kind));
  weigh({});
}

double CameraEdges::expected_difference(const FilmEdge& edge) const {
  if (!(*std::ranges::max_element(differences_) > 0)) return 1;
  const Contrast contrast = contrast_of(edge);
  return differences_[contrast.kind] * contrast.unit;
}

// Projected length times speed times the difference that kinds of edges have; a share goes without
// the latter. Every parameter gets an equal share of the samples, whatever its unit.
void CameraEdges::weigh(const FilmMotionAt& motion) {
  pieces_ = {};
  choice_ = {};
  for (uint32_t e = 0; e < edges_.size(); ++e) add_pieces(e, motion);
  Lanes totals, contrasts;
  size_t refracted = 0;
  for (const Piece& piece : pieces_) {
    totals += piece.weight;
    contrasts += piece.weight * expected_difference(edges_[piece.edge]);
    refracted += edges_[piece.edge].refracted;
  }
  for (const Piece& piece : pieces_) {
    const double by = expected_difference(edges_[piece.edge]);
    double share = 0;
    for (int k = 0; k < lanes_; ++k) {
      if (!(totals[k] > 0)) continue;
      const double alike = piece.weight[k] / totals[k];
      share += contrasts[k] > 0
                   ? kLeastOfKind * alike + (1 - kLeastOfKind) * piece.weight[k] * by / contrasts[k]
                   : alike;
    }
    if (edges_[piece.edge].refracted) share += kAlike / static_cast<double>(refracted);
    choice_.add(share);
  }
}

FilmEdgePoint CameraEdges::point_on(const Piece& piece, double fraction) const {
  FilmEdgePoint point{edges_[piece.edge], 0, {}, 0};
  const FilmEdge& edge = point.edge;
  point.s = piece.s0 + (piece.s1 - piece.s0) * fraction;
  point.at.x = edge.x0 + (edge.x1 - edge.x0) * point.s;
  point.at.y = edge.y0 + (edge.y1 - edge.y0) * point.s;
  return point;
}

std::optional<FilmEdgePoint> CameraEdges::choose(double u, const LensPoint&) const {
  const DiscreteDistribution::Draw draw = choice_.sample(u);
  const Piece& piece = pieces_[draw.index];
  FilmEdgePoint point = point_on(piece, draw.fraction);
  const FilmEdge& edge = point.edge;
  if (edge.refracted && !bend(point, {})) return {};
  point.density = draw.probability / (edge.length * (piece.s1 - piece.s0));
  return point;
}

}  // namespace limn
