// Listing what may move on the film as seen through a lens, and drawing points of it.
#include "integrators/terms/lens_edges.h"

#include <cmath>

#include "limn/integrators/run.h"

namespace limn {
namespace {

// Weights are means over so many points of the lens, squared. Not tuned.
constexpr int kPoints = 4;
// The share of draws that choose among all edges alike: those that only other points of the lens
// see are drawn, too. Not tuned.
constexpr double kAlike = 0.02;

}  // namespace

LensEdges::LensEdges(const PathContext& context, const EdgeSamplerInput& input, int lanes,
                     const FreeMotion* free)
    : FilmEdges(context, input, free), lanes_(free ? 3 : lanes) {
  const Stopwatch watch;
  for (const FilmView& view : views_) images_.emplace_back(view.camera);
  list();
  weigh();
  list_seconds_ = watch.seconds();
}

void LensEdges::list() {
  for (uint32_t v = 0; v < views_.size(); ++v) {
    for (uint32_t o = 0; o < input_.objects.size(); ++o) add_object(ShapeId(o), v);
  }
  for (uint32_t c = 0; c < clips_.size(); ++c) {
    const bool moving = free_ ? free_->moves({&clips_[c].face, 1})
                              : !images_[0].is_constant() || !is_constant(clips_[c].ends[0]) ||
                                    !is_constant(clips_[c].ends[1]);
    if (moving) listed_.push_back({{}, c, 0, {}});
  }
}

void LensEdges::add_object(ShapeId object, uint32_t view) {
  const EdgeMesh& mesh = input_.object(object);
  for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
    const EdgeId edge(e);
    FilmEdge placed;
    const bool seen = views_[view].refracted ? place_refracted({object, edge}, view, placed)
                                             : may_be_seen(mesh, edge, view);
    if (seen && moves(mesh, edge, view)) listed_.push_back({{object, edge}, placed.clip, view, {}});
  }
}

bool LensEdges::may_be_seen(const EdgeMesh& mesh, EdgeId edge, uint32_t view) const {
  const bool out =
      view == 0 ? is_hidden(mesh, edge) : views_[view].touches_mirror(mesh.faces_around(edge));
  return !out && may_be_candidate(mesh, edge, value(images_[view].origin()));
}

bool LensEdges::moves(const EdgeMesh& mesh, EdgeId edge, uint32_t view) const {
  if (free_) return may_move(views_[view], faces_that_move(mesh, edge));
  if (views_[view].refracted || !images_[view].is_constant()) return true;
  if (mesh.tangents.empty()) return false;
  const auto& ends = mesh.edge(edge).vertices;
  return std::any_of(ends.begin(), ends.end(), [&](VertexId v) {
    const Vec3<Lanes>& tangent = mesh.tangent(v);
    return !is_zero(tangent.x) || !is_zero(tangent.y) || !is_zero(tangent.z);
  });
}

// Whether is_candidate may hold at a point of the lens: the planes of the edge's faces lie on sides
// of a ball around it.
bool LensEdges::may_be_candidate(const EdgeMesh& mesh, EdgeId edge, const Vec3d& center) const {
  const double radius = scene().camera.aperture_radius.v;
  const auto facing_at = [&](FaceId face) {
    const Facing at = facing(mesh, face, center);
    const bool near = std::fabs(mesh.plane(face).distance(center)) <= radius;
    return Facing{at.front || near, at.back || near};
  };
  const Facing first = facing_at(mesh.edge(edge).faces[0]);
  const FaceId second = mesh.edge(edge).faces[1];
  return is_candidate(mesh, edge, first, second.valid() ? facing_at(second) : first);
}

bool LensEdges::place(const Listed& listed, const LensPoint& lens, FilmEdge& edge) const {
  if (views_[listed.view].refracted) return place_refracted(listed.id, listed.view, edge);
  edge.view = listed.view;
  const CameraView<Dual> view = images_[listed.view].at(lens);
  if (listed.clip != FilmEdge::kNoClip) return FilmEdges::place(listed.clip, view, edge);
  const EdgeMesh& mesh = input_.object(listed.id.object);
  return is_candidate(mesh, listed.id.edge, value(view.origin())) &&
         FilmEdges::place(listed.id, view, edge, listed.view == 0 ? nullptr : &views_[listed.view]);
}

// By the mean of projected length times speed; every parameter gets an equal share of the samples,
// whatever its unit.
void LensEdges::weigh() {
  Lanes totals;
  for (int i = 0; i < kPoints * kPoints; ++i) {
    const double u = (i % kPoints + 0.5) / kPoints, v = (i / kPoints + 0.5) / kPoints;
    const LensPoint lens = lens_point(u, v);
    for (Listed& listed : listed_) {
      FilmEdge edge;
      if (!place(listed, lens, edge)) continue;
      if (edge.refracted) add_speed(edge, lens, lanes_);
      for (int k = 0; k < lanes_; ++k) {
        listed.weight[k] +=
            std::max(std::fabs(edge.speed0[k]), std::fabs(edge.speed1[k])) * edge.length;
      }
    }
  }
  for (const Listed& listed : listed_) totals += listed.weight;
  double all = 0;
  for (int k = 0; k < lanes_; ++k) all += totals[k] > 0 ? 1 : 0;
  const double alike = (all > 0 ? kAlike * all : 1) / static_cast<double>(listed_.size());
  for (const Listed& listed : listed_) {
    double share = alike;
    for (int k = 0; k < lanes_; ++k) {
      if (totals[k] > 0) share += listed.weight[k] / totals[k];
    }
    choice_.add(share);
  }
}

std::optional<FilmEdgePoint> LensEdges::choose(double u, const LensPoint& lens) const {
  const DiscreteDistribution::Draw draw = choice_.sample(u);
  FilmEdgePoint point;
  FilmEdge& edge = point.edge;
  if (!place(listed_[draw.index], lens, edge)) return {};
  point.s = draw.fraction;
  point.density = draw.probability / edge.length;
  if (edge.refracted) {
    if (!bend(point, lens)) return {};
    return point;
  }
  point.at = {{edge.x0 + (edge.x1 - edge.x0) * point.s, edge.y0 + (edge.y1 - edge.y0) * point.s},
              lens};
  return point;
}

}  // namespace limn
