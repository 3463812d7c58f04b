// Projects faces to the plane of a view and clips them at the near depth.
#include <algorithm>
#include <cmath>
#include <tuple>

#include "limn/core/visible_regions.h"

namespace limn {

PlaneView::PlaneView(const Vec3d& origin, const Vec3d& u, const Vec3d& v, const Vec3d& a,
                     double near, double far)
    : origin_(origin), u_(u), v_(v), a_(a), near_(near), far_(far) {
  // The dual basis of (u, v, a).
  const double volume = determinant(u, v, a);
  right_handed_ = volume > 0;
  const double scale = 1 / volume;
  to_x_ = cross(v, a) * scale;
  to_y_ = cross(a, u) * scale;
  to_z_ = cross(u, v) * scale;
}

PlaneView::Corner PlaneView::project(const Vec3d& w) const {
  const double z = dot(w, to_z_);
  return {w, {dot(w, to_x_) / z, dot(w, to_y_) / z}, z};
}

// Returns false if the side lies in front of the near depth, and with it the rest of the face.
bool PlaneView::add_side(const Corner& a, const Corner& b, SeenFace& face) const {
  const auto key = [](const Corner& c) { return std::tuple(c.w.x, c.w.y, c.w.z); };
  const bool reversed = key(b) < key(a);
  const Corner &from = reversed ? b : a, &to = reversed ? a : b;
  const bool from_seen = from.z > near_, to_seen = to.z > near_;
  if (!from_seen && !to_seen) return false;
  SeenFace::Side& side = face.sides[face.side_count++];
  side = {from.p, to.p, from_seen, to_seen, reversed, 0};
  if (from_seen && to_seen) return true;
  const double t = (near_ - from.z) / (to.z - from.z);
  (from_seen ? side.to : side.from) = project(from.w + (to.w - from.w) * t).p;
  return true;
}

std::optional<SeenFace> PlaneView::face(uint32_t label, const std::array<Vec3d, 3>& corners) const {
  std::array<Corner, 3> c;
  for (int k = 0; k < 3; ++k) c[k] = project(corners[k] - origin_);
  const auto [nearest, farthest] = std::minmax({c[0].z, c[1].z, c[2].z});
  if (!(farthest > near_ && nearest < far_)) return {};

  const Vec3d e1 = corners[1] - corners[0], e2 = corners[2] - corners[0];
  const Vec3d n = cross(e1, e2);
  const double d = dot(n, c[0].w);
  if (d == 0) return {};
  SeenFace face;
  face.label = label;
  face.counter_clockwise = (d > 0) == right_handed_;
  // n . w = d, w = z (a + x u + y v).
  face.inverse_depth = {dot(n, u_) / d, dot(n, v_) / d, dot(n, a_) / d};
  face.nearest = 1 / std::max(nearest, near_);
  // n is off by at most four roundings of |e1| |e2|, d by as much times |w| and its own.
  const double size = std::max({length(c[0].w), length(c[1].w), length(c[2].w)});
  face.depth_error = 0x1.0p-49 * length(e1) * length(e2) * size * face.nearest / std::fabs(d);

  for (uint8_t k = 0; k < 3; ++k) {
    if (add_side(c[k], c[(k + 1) % 3], face)) face.sides[face.side_count - 1].number = k;
  }
  face.whole = nearest > near_;
  const PlaneFunction& q = face.inverse_depth;
  if (nearest <= near_) face.cuts[face.cut_count++] = {-q.a, -q.b, 1 / near_ - q.c};
  if (farthest > far_) face.cuts[face.cut_count++] = {q.a, q.b, q.c - 1 / far_};
  face.lower = face.upper = face.sides[0].from;
  for (int k = 0; k < face.side_count; ++k) {
    for (const PlanePoint& p : {face.sides[k].from, face.sides[k].to}) {
      face.lower = {std::min(face.lower.x, p.x), std::min(face.lower.y, p.y)};
      face.upper = {std::max(face.upper.x, p.x), std::max(face.upper.y, p.y)};
    }
  }
  return face;
}

}  // namespace limn
