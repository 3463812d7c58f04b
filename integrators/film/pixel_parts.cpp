// Areas and moments of visible regions from their true lines.
#include "integrators/film/pixel_parts.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "integrators/lights/closed_light_planes.h"
#include "integrators/lights/polygon_light.h"
#include "limn/core/reverse.h"

namespace limn {
namespace {

// Lines that meet farther than this from where they do on the grid [pixels] are one line to its
// rounding there. Not tuned.
constexpr double kFar = 0.25;

// Below this area [pixels^2] a centroid is rounding. What lies on a border has no area but sides
// that sweep one: it is taken for kNoArea, far below rounding, with the middle of its box for a
// centroid, whose motion gives, to first order, the light where the sides are. Not tuned.
constexpr double kLeastArea = 0x1p-40, kNoArea = 0x1p-56;

// Of what the middle of a side adds, by how many steps of the grid it lies within the window: half
// on the pixel's border, one step in, as in the pixel beyond.
double share_of(const PlanePoint& middle) {
  double share = 1;
  for (const double t : {middle.x, middle.y}) {
    const double steps = std::round((0.5 + kPixelMargin - std::fabs(t)) / kPixelMargin);
    share *= std::clamp(0.5 * steps, 0.0, 1.0);
  }
  return share;
}

double at(const Vec3d& line, const PlanePoint& p) { return line.x * p.x + line.y * p.y + line.z; }

PlanePoint foot(const Vec3d& line, const PlanePoint& p) {
  const double size = line.x * line.x + line.y * line.y;
  if (!(size > 0)) return p;
  const double t = at(line, p) / size;
  return {p.x - t * line.x, p.y - t * line.y};
}

// Where two lines meet, which is at `rounded` on the grid.
PlanePoint meet(const Vec3d& l, const Vec3d& m, const PlanePoint& rounded) {
  // About that place, where little cancels.
  const double l0 = at(l, rounded), m0 = at(m, rounded);
  const double w = l.x * m.y - m.x * l.y;
  const PlanePoint d{(l.y * m0 - m.y * l0) / w, (m.x * l0 - l.x * m0) / w};
  if (d.x * d.x + d.y * d.y <= kFar * kFar) return {rounded.x + d.x, rounded.y + d.y};
  const PlanePoint p = foot(l, rounded), q = foot(m, rounded);
  return {0.5 * (p.x + q.x), 0.5 * (p.y + q.y)};
}

template <class S>
std::array<Vec3<S>, 3> corners_of(const Scene& scene, FaceRef face) {
  if constexpr (std::is_same_v<S, Var>) {
    return corner_leaves(scene, face);
  } else {
    return face_corners<S>(scene.shape(face.shape).mesh, face.face);
  }
}

template <class S>
Vec3<S> normal_of(const std::array<Vec3<S>, 3>& x) {
  return cross(x[1] - x[0], x[2] - x[0]);
}

template <class S>
bool stands_still(const Scene& scene, FaceRef face) {
  const Mesh& mesh = scene.shape(face.shape).mesh;
  if constexpr (std::is_same_v<S, Var>) {
    return Tape::current()->slots()->mesh(face.shape).positions == 0;
  } else {
    return mesh.position_tangents.empty();
  }
}

}  // namespace

// The normal of the plane through the camera that a side's line is seen in.
template <class S>
Vec3<S> PixelParts::plane_of(const Scene& scene, const CameraView<S>& view,
                             const Side& side) const {
  const Vec3<S>& o = view.origin();
  const auto x = corners_of<S>(scene, pixels_.face_of(side.label));
  if (side.side >= 0) {
    const Vec3<S>&a = x[side.side], &b = x[(side.side + 1) % 3];
    if constexpr (std::is_same_v<S, Var>) {
      return triangle_normal(o, a, b);
    } else {
      return cross(a - o, b - a);
    }
  }
  // Of all planes through the line where the face's meets another that through the camera.
  const Vec3<S> n = normal_of(x);
  const S n_o = dot(n, o - x[0]);
  if (side.cut >= 0) {
    double nearest = view_.depth(value(x[0]));
    for (int k = 1; k < 3; ++k) nearest = std::min(nearest, view_.depth(value(x[k])));
    const Camera& camera = scene.camera;
    const bool near = side.cut == 0 && nearest <= camera.near_clip;
    return n * S(near ? -camera.near_clip : -camera.far_clip) - view.forward() * n_o;
  }
  const auto y = corners_of<S>(scene, pixels_.face_of(side.other));
  const Vec3<S> m = normal_of(y);
  return n * dot(m, o - y[0]) - m * n_o;
}

template <class S>
Vec3<S> PixelParts::line(const Scene& scene, const CameraView<S>& view,
                         const typename CameraView<S>::Plane& plane, const Side& side) const {
  const Vec3<S> n = plane_of(scene, view, side);
  return {dot(n, plane.u), dot(n, plane.v), dot(n, plane.a)};
}

PixelParts::TrueSide PixelParts::true_side(const Side& side) const {
  const PlaneFunction& f = side.line;
  const auto sign = [](double x) { return x > 0 ? 1.0 : x < 0 ? -1.0 : 0.0; };
  if (side.label == VisibleRegions::kNothing) return {{sign(f.a), sign(f.b), 0.5}, true, false};
  const Vec3d rounded{f.a, f.b, f.at(center_)};
  const Vec3d l = line<double>(scene_, view_, plane_, side);
  const double along = l.x * rounded.x + l.y * rounded.y;
  if (!(along != 0)) return {rounded, true, false};  // an edge seen end-on
  return {along < 0 ? -l : l, false, along < 0};
}

void PixelParts::add_region(uint32_t label, std::span<const PlanePoint> corners,
                            std::span<const Side> sides, bool moving) {
  const size_t n = sides.size();
  ring_.clear();
  for (const Side& side : sides) ring_.push_back(true_side(side));
  corners_.clear();
  const auto on_grid = [&](size_t i) {
    return PlanePoint{corners[i % n].x - center_.x, corners[i % n].y - center_.y};
  };
  for (size_t i = 0; i < n; ++i) {
    corners_.push_back(meet(ring_[i == 0 ? n - 1 : i - 1].line, ring_[i].line, on_grid(i)));
  }
  Part& part = parts_.emplace_back(Part{label});
  const PlanePoint& first = corners_[0];
  for (size_t i = 0; i < n; ++i) {
    const PlanePoint &p = corners_[i], &q = corners_[(i + 1) % n];
    part.x0 = std::min(part.x0, p.x), part.x1 = std::max(part.x1, p.x);
    part.y0 = std::min(part.y0, p.y), part.y1 = std::max(part.y1, p.y);
    const double area =
        0.5 * ((p.x - first.x) * (q.y - first.y) - (q.x - first.x) * (p.y - first.y));
    part.area += area;
    part.mx += area * (first.x + p.x + q.x) / 3;
    part.my += area * (first.y + p.y + q.y) / 3;
    const TrueSide& side = ring_[i];
    if (!moving || side.still) continue;
    const double along = std::hypot(side.line.x, side.line.y);
    // Signed: where the true lines have another order than those of the grid, it runs back.
    const double length = ((q.x - p.x) * side.line.y - (q.y - p.y) * side.line.x) / along;
    const PlanePoint from = on_grid(i), to = on_grid(i + 1);
    const double share = share_of({0.5 * (from.x + to.x), 0.5 * (from.y + to.y)});
    const double scale = (side.flipped ? -share : share) * length / along;
    const double x = 0.5 * (p.x + q.x), y = 0.5 * (p.y + q.y);
    const double dx = 0.5 * (q.x - p.x), dy = 0.5 * (q.y - p.y);
    const double xx = x * x + dx * dx / 3, xy = x * y + dx * dy / 3, yy = y * y + dy * dy / 3;
    sides_.push_back(
        {label,
         sides[i],
         {Vec3d{x, y, 1} * scale, Vec3d{xx, xy, x} * scale, Vec3d{xy, yy, y} * scale}});
  }
}

void PixelParts::join_parts() {
  std::stable_sort(parts_.begin(), parts_.end(),
                   [](const Part& a, const Part& b) { return a.label < b.label; });
  size_t count = 0;
  for (const Part& part : parts_) {
    if (count == 0 || parts_[count - 1].label != part.label) {
      parts_[count++] = part;
      continue;
    }
    Part& to = parts_[count - 1];
    to.area += part.area;
    to.mx += part.mx;
    to.my += part.my;
    to.x0 = std::min(to.x0, part.x0), to.x1 = std::max(to.x1, part.x1);
    to.y0 = std::min(to.y0, part.y0), to.y1 = std::max(to.y1, part.y1);
  }
  parts_.resize(count);
}

// By parts, each line once.
void PixelParts::join_sides() {
  const auto key = [](const PartSide& s) {
    return std::tuple(s.shown, s.line.label, s.line.side, s.line.cut, s.line.other);
  };
  std::stable_sort(sides_.begin(), sides_.end(),
                   [&](const PartSide& a, const PartSide& b) { return key(a) < key(b); });
  size_t count = 0;
  for (const PartSide& side : sides_) {
    if (count > 0 && key(sides_[count - 1]) == key(side)) {
      Weights& to = sides_[count - 1].weights;
      to.area += side.weights.area;
      to.mx += side.weights.mx;
      to.my += side.weights.my;
    } else {
      sides_[count++] = side;
    }
  }
  sides_.resize(count);
  size_t next = 0;
  for (Part& part : parts_) {
    part.first_side = next;
    while (next < count && sides_[next].shown == part.label) ++next;
    part.end_side = next;
  }
}

void PixelParts::find(int x, int y, const VisibleRegions& regions, bool moving) {
  center_ = {x + 0.5, y + 0.5};
  plane_ = view_.plane(center_.x, center_.y);
  parts_.clear();
  sides_.clear();
  regions.for_each_below(
      uint64_t{VisibleRegions::kNothing} + 1,
      [&](uint32_t label, std::span<const PlanePoint> corners, std::span<const Side> sides) {
        add_region(label, corners, sides, moving);
      });
  join_parts();
  if (moving) join_sides();
}

template <class S>
FacePart<S> PixelParts::part(size_t i, const Scene& seeded, const CameraView<S>& view) const {
  const Part& part = parts_[i];
  const bool has_area = std::fabs(part.area) > kLeastArea;
  const double area = has_area ? part.area : kNoArea;
  // Within the box that holds it: of a sliver it may be off by rounding.
  const auto centroid = [&](double moment, double from, double to) {
    const double c = moment / area;
    return has_area && c >= from && c <= to ? c : 0.5 * (from + to);
  };
  const double x = centroid(part.mx, part.x0, part.x1), y = centroid(part.my, part.y0, part.y1);
  FacePart<S> result{pixels_.face_of(part.label), area, center_.x + x, center_.y + y};
  if constexpr (!std::is_same_v<S, double>) {
    const double inverse = 1 / area;
    const bool still_camera = view.is_constant();
    const auto plane = view.plane(center_.x, center_.y);
    std::vector<std::pair<Vec3<S>, const Weights*>> lines;
    for (size_t k = part.first_side; k < part.end_side; ++k) {
      const Side& side = sides_[k].line;
      const FaceRef face = pixels_.face_of(side.label), other = pixels_.face_of(side.other);
      if (still_camera && stands_still<S>(seeded, face) &&
          (!other.shape.valid() || stands_still<S>(seeded, other))) {
        continue;
      }
      lines.emplace_back(line<S>(seeded, view, plane, side), &sides_[k].weights);
    }
    const auto add = [&](S& to, const auto& weights_of) {
      if constexpr (std::is_same_v<S, Var>) {
        Tape& tape = *Tape::current();
        for (const auto& [l, weights] : lines) detail::add_entries(tape, l, weights_of(*weights));
        if (!lines.empty()) to.node = tape.end();
      } else {
        for (const auto& [l, weights] : lines) to.d += dot(l, weights_of(*weights)).d;
      }
    };
    add(result.area, [](const Weights& w) { return w.area; });
    add(result.x, [&](const Weights& w) { return (w.mx - w.area * x) * inverse; });
    add(result.y, [&](const Weights& w) { return (w.my - w.area * y) * inverse; });
  }
  return result;
}

template FacePart<double> PixelParts::part(size_t, const Scene&, const CameraView<double>&) const;
template FacePart<Dual> PixelParts::part(size_t, const Scene&, const CameraView<Dual>&) const;
template FacePart<Var> PixelParts::part(size_t, const Scene&, const CameraView<Var>&) const;

}  // namespace limn
