// Wedges from the mesh of their edges.
#include "edgetree/forest/wedge_list.h"

#include <algorithm>
#include <cmath>

#include "edgetree/forest/forest_query.h"

namespace limn {
namespace {

template <class T>
void permute(std::vector<uint32_t>& order, std::vector<T>& items) {
  for (uint32_t i = 0; i < order.size(); ++i) {
    const T first = items[i];
    uint32_t to = i;
    for (uint32_t from; (from = order[to]) != i; to = from) {
      items[to] = items[from];
      order[to] = to;
    }
    items[to] = first;
    order[to] = to;
  }
}

std::array<Plane, 2> planes_of(const EdgeMesh& mesh, const Edge& edge) {
  const Plane& first = mesh.plane(edge.faces[0]);
  return {first, edge.faces[1].valid() ? mesh.plane(edge.faces[1]) : first};
}

}  // namespace

void WedgeList::add(EdgeId id) {
  const Edge& edge = mesh_->edge(id);
  const auto planes = planes_of(*mesh_, edge);
  const Vec3d &n0 = planes[0].n, &n1 = planes[1].n;
  const auto [a, b] = edge.vertices;
  edges_.push_back({length(mesh_->position(b) - mesh_->position(a)),
                    std::atan2(length(cross(n0, n1)), dot(n0, n1)), 0, id});
}

void WedgeList::put_in_order(std::vector<uint32_t> order) {
  mesh_ ? permute(order, edges_) : permute(order, stand_ins_);
}

std::array<Vec3d, 2> WedgeList::ends(size_t i) const {
  if (!mesh_) return stand_ins_[i].ends;
  const auto [a, b] = mesh_->edge(edges_[i].edge).vertices;
  return {mesh_->position(a), mesh_->position(b)};
}

Wedge WedgeList::operator[](size_t i) const {
  if (!mesh_) return stand_ins_[i];
  const Kept& kept = edges_[i];
  const Edge& edge = mesh_->edge(kept.edge);
  Wedge wedge{planes_of(*mesh_, edge), ends(i), kept.length, kept.angle, kept.speed, 1, kept.edge};
  if (edge.edge_class == EdgeClass::kSharp && std::isfinite(mesh_->fold_contrast)) {
    wedge.fold =
        std::clamp(2 * std::tan(0.5 * wedge.angle) * mesh_->fold_contrast, double{kLeastFold}, 1.0);
  }
  return wedge;
}

Bounds WedgeList::bounds(EdgeRange range) const {
  Bounds bounds;
  for (uint32_t i = range.begin; i < range.end; ++i)
    for (const Vec3d& x : ends(i)) bounds.extend(x);
  return bounds;
}

std::span<const Wedge> WedgeWindow::wedges(EdgeRange range) {
  if (range.size() == 0) return {};
  if (range.begin < range_.begin || range.end > range_.end) {
    range_ = range;
    wedges_.clear();
    wedges_.reserve(range.size());
    for (uint32_t i = range.begin; i < range.end; ++i) wedges_.push_back(list_[i]);
  }
  return std::span<const Wedge>(wedges_).subspan(range.begin - range_.begin, range.size());
}

}  // namespace limn
