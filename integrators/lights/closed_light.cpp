// Emitters as polygons, what lies before them, and the sums over what is left.
#include "integrators/lights/closed_light.h"

#include <algorithm>
#include <array>
#include <memory>

#include "integrators/lights/closed_light_planes.h"
#include "integrators/lights/closed_light_scratch.h"
#include "integrators/lights/polygon_light.h"
#include "limn/core/reverse.h"

namespace limn {
namespace {

// What is nearer to a point than this part of its distance from the emitter's plane does not shade
// it: about the rounding of positions. Not tuned.
constexpr double kNear = 0x1p-26;
// A window of outlines reaches so many steps of their grid from its middle.
constexpr double kGridHalf = 0x1p29;
// A window is wider than its emitter, so that the emitter's sides are inside. Not tuned.
constexpr double kMargin = 0x1p-10;
// Emitters of which is kept what a point has seen. Not tuned.
constexpr size_t kHeld = 8;

}  // namespace

bool ClosedLight::in_one_place(FaceRef a, FaceRef b) const {
  return a == b || (!(copies_.empty() && overlaps_.empty()) && overlaps_.contains(a, b));
}

bool ClosedLight::is_skipped(FaceRef face, const Receiver& receiver) const {
  if (in_one_place(receiver.face, face)) return true;
  if (!receiver.edge) return false;
  const auto& around = receiver.edge->around.faces;
  return std::any_of(around.begin(), around.end(),
                     [&](FaceRef other) { return in_one_place(other, face); });
}

// Lists the faces that may shade the emitter, after its own; false if it cannot be seen.
bool ClosedLight::list(const EmitterPlane& emitter, const Receiver& receiver,
                       Scratch& scratch) const {
  const Vec3d &p = receiver.p, a = -emitter.plane.n;
  const double height = emitter.plane.distance(p);
  if (!(height > 0)) return false;
  const bool above = std::any_of(emitter.hull.begin(), emitter.hull.end(),
                                 [&](const Vec3d& x) { return dot(receiver.up, x - p) > 0; });
  if (!above) return false;
  // What lies in the emitter's own plane, as its back does, gets nothing of it, however it is
  // rounded.
  if (emitter.in_place.contains(receiver.face)) return false;

  const double px = dot(emitter.u, p), py = dot(emitter.v, p);
  PlaneWindow& window = scratch.window;
  window.center = {(0.5 * (emitter.x0 + emitter.x1) - px) / height,
                   (0.5 * (emitter.y0 + emitter.y1) - py) / height};
  window.half_width = (1 + kMargin) * 0.5 * (emitter.x1 - emitter.x0) / height;
  window.half_height = (1 + kMargin) * 0.5 * (emitter.y1 - emitter.y0) / height;
  scratch.near = kNear * height;
  scratch.far = height - emitter.deviation;

  scratch.faces = emitter.faces;
  scratch.emitter_faces = emitter.faces.size();
  scratch.faces.insert(scratch.faces.end(), emitter.before.begin(), emitter.before.end());
  scratch.uncut = scratch.first_item = scratch.faces.size();
  scratch.items.clear();
  if (!(scratch.far > scratch.near)) return true;
  std::array<HalfSpace, 8> set;
  size_t count = 0;
  const auto bound = [&](const Vec3d& n, double offset) { set[count++] = {n, offset - dot(n, p)}; };
  bound(a * (window.center.x + window.half_width) - emitter.u, 0);
  bound(emitter.u - a * (window.center.x - window.half_width), 0);
  bound(a * (window.center.y + window.half_height) - emitter.v, 0);
  bound(emitter.v - a * (window.center.y - window.half_height), 0);
  bound(receiver.up, 0);
  bound(a, 0);
  bound(-a, scratch.far);
  if (receiver.wedge) bound(*receiver.wedge, 0);
  tree_.list(std::span(set).first(count), scratch.items);
  size_t kept = 0;
  for (const FaceTree::Item* item : scratch.items) {
    // What rises above the horizon by rounding alone is the receiver's own plane.
    const auto rises = [&](const Vec3f& x) {
      const Vec3d w = cast<double>(x) - p;
      return dot(receiver.up, w) > 0x1p-49 * (length(p) + length(w));
    };
    const auto& x = item->corners;
    if (!rises(x[0]) && !rises(x[1]) && !rises(x[2])) continue;
    // What lies in the emitter's plane is before it by the rule, not by how its corners are
    // rounded.
    if (emitter.in_place.contains(item->face) || is_skipped(item->face, receiver)) continue;
    scratch.faces.push_back(item->face);
    scratch.items[kept++] = item;
  }
  scratch.items.resize(kept);
  return true;
}

// The largest first: what is covered already is left at once. Those before the emitter are no
// nearer than each other: each has a depth of its own, in the order of insertion.
void ClosedLight::find_regions(const EmitterPlane& emitter, const Receiver& receiver,
                               Scratch& scratch) const {
  const Vec3d a = -emitter.plane.n;
  const PlaneView emitter_view(receiver.p, emitter.u, emitter.v, a, scratch.near,
                               std::numeric_limits<double>::max());
  const PlaneView view(receiver.p, emitter.u, emitter.v, a, scratch.near,
                       std::max(scratch.far, scratch.near));
  scratch.seen.assign(scratch.faces.size(), {});
  std::vector<uint32_t>& order = scratch.order;
  order.clear();
  for (uint32_t i = 0; i < scratch.faces.size(); ++i) {
    const FaceRef ref = scratch.faces[i];
    const auto corners = face_corners<double>(scene_.shape(ref.shape).mesh, ref.face);
    const auto face = (i < scratch.uncut ? emitter_view : view).face(i, corners);
    if (!face) continue;
    scratch.seen[i] = *face;
    if (i >= scratch.emitter_faces) order.push_back(i);
  }
  const PlaneWindow& window = scratch.window;
  const auto extent = [&](uint32_t i) {
    const SeenFace& face = scratch.seen[i];
    const auto overlap = [](double lower, double upper, double center, double half) {
      return std::min(upper, center + half) - std::max(lower, center - half);
    };
    return overlap(face.lower.x, face.upper.x, window.center.x, window.half_width) *
           overlap(face.lower.y, face.upper.y, window.center.y, window.half_height);
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t i, uint32_t j) { return extent(i) > extent(j); });
  scratch.regions.reset(window);
  const auto insert = [&](SeenFace& face, double inverse_depth) {
    face.inverse_depth = {0, 0, inverse_depth};
    face.nearest = inverse_depth;
    face.depth_error = 0;
    scratch.regions.insert(face);
  };
  for (size_t i = 0; i < scratch.emitter_faces; ++i) {
    SeenFace& face = scratch.seen[i];
    if (face.side_count == 0) continue;
    const auto cut = [&](const Vec3d& n) {
      face.cuts[face.cut_count++] = {dot(n, emitter.u), dot(n, emitter.v), dot(n, a)};
    };
    cut(receiver.up);
    if (receiver.wedge) cut(*receiver.wedge);
    insert(face, 1);
  }
  for (size_t i = 0; i < order.size(); ++i) {
    insert(scratch.seen[order[i]], 3 - static_cast<double>(i) / static_cast<double>(order.size()));
  }
}

// Which way round faces are seen on the grid, where doubles tell. A side between two that are
// turned alike cancels, so that most faces need not be looked at any closer.
void ClosedLight::find_turns(const EmitterPlane& emitter, const Receiver& receiver,
                             const Scratch& scratch, Turns& turns) const {
  const Vec3d a = -emitter.plane.n, &p = receiver.p;
  const double x_steps = kGridHalf / scratch.window.half_width,
               y_steps = kGridHalf / scratch.window.half_height;
  const double steps = std::max(x_steps, y_steps), both = x_steps * y_steps;
  const auto size_of = [](const Vec3d& x) {
    return std::fabs(x.x) + std::fabs(x.y) + std::fabs(x.z);
  };
  turns.of.resize(tree_.size());
  ++turns.query;
  // Farther out the grid's coordinates are themselves off by half a step.
  constexpr double kMostSteps = 0x1p48;
  const PlanePoint& center = scratch.window.center;
  if (!(std::max(std::fabs(center.x), std::fabs(center.y)) * steps < kMostSteps)) return;
  for (const FaceTree::Item* item : scratch.items) {
    const Vec3d w0 = cast<double>(item->corners[0]) - p;
    const Vec3d e1 = cast<double>(item->corners[1]) - p - w0,
                e2 = cast<double>(item->corners[2]) - p - w0;
    const double z0 = dot(w0, a), z1 = z0 + dot(e1, a), z2 = z0 + dot(e2, a);
    const auto [near, far] = std::minmax({z0, z1, z2});
    if (near < scratch.near || far > scratch.far) continue;  // it is cut
    // On the grid twice the area is det(w0, w1, w2) both / (z0 z1 z2). A side's coordinates are
    // below `steps` |e| (near + |w|) / near^2. Corners are rounded to the grid by less than one
    // step, which changes the area by at most 8 of that and 8 more; the determinant's own rounding
    // is below 2^-46 of the lengths in it. Before, the quotients are rounded: as if a corner were
    // moved by 3 * 2^-53 |w|. That is at most 9 * 2^-53 reach^2 side in the determinant, where
    // `error`, over both near^2, is 8 near reach side / steps at least: 2^-45 reach^2 side by
    // the limit on steps below.
    const double volume = dot(cross(e1, e2), w0);
    const double side = size_of(e1) + size_of(e2), reach = size_of(w0) + side;
    if (!(steps * reach < kMostSteps * near)) continue;
    const double error = far * far * far * 8 * (steps * side * (near + reach) + near * near);
    const double size = std::fabs(volume) - 0x1p-46 * side * side * reach;
    if (!(size * both * near * near > error)) continue;
    turns.of[tree_.index_of(*item)] = 2 * turns.query + (volume > 0 ? 1 : 0);
  }
}

// Whether it was found to be whole, turned one way. Then it must not be cut: cancelled sides are
// those of the whole face.
bool ClosedLight::has_turn(const FaceTree::Item& item, const Turns& turns) const {
  return turns.of[tree_.index_of(item)] >= 2 * turns.query;
}

// By bits: the sides of a face that cancel.
uint32_t ClosedLight::cancelled_sides(const FaceTree::Item& item, const Turns& turns) const {
  if (!has_turn(item, turns)) return 0;
  const uint64_t turn = turns.of[tree_.index_of(item)];
  uint32_t sides = 0;
  for (uint32_t k = 0; k < 3; ++k) {
    const uint32_t other = item.neighbours[k];
    if (other != FaceTree::kNone && turns.of[other] == turn) sides |= 1u << k;
  }
  return sides;
}

// False if a corner is too far out.
bool ClosedLight::find_outlines(const EmitterPlane& emitter, const Receiver& receiver,
                                Scratch& scratch, Turns& turns) const {
  using Point = ShadowOutlines::Point;
  const Vec3d a = -emitter.plane.n;
  const PlaneWindow& window = scratch.window;
  const double x_steps = kGridHalf / window.half_width, y_steps = kGridHalf / window.half_height;
  bool within = true;
  const auto on_grid = [&](const Vec3d& w) {
    const double z = dot(w, a);
    const double x = (dot(w, emitter.u) / z - window.center.x) * x_steps;
    const double y = (dot(w, emitter.v) / z - window.center.y) * y_steps;
    within = within && std::fabs(x) < 0x1p60 && std::fabs(y) < 0x1p60;
    return within ? Point{std::llround(x), std::llround(y)} : Point{0, 0};
  };
  const auto clip = [&](const auto& height, uint32_t line) { scratch.clip(height, line, on_grid); };
  scratch.outlines.clear();
  scratch.cut_points.clear();
  find_turns(emitter, receiver, scratch, turns);
  for (uint32_t label = 0; label < scratch.faces.size(); ++label) {
    const bool listed = label >= scratch.first_item;
    const FaceTree::Item* item = listed ? scratch.items[label - scratch.first_item] : nullptr;
    const uint32_t cancelled = item ? cancelled_sides(*item, turns) : 0;
    if (cancelled == 7) continue;
    const FaceRef ref = scratch.faces[label];
    const auto corners = face_corners<double>(scene_.shape(ref.shape).mesh, ref.face);
    const uint32_t line = label * Scratch::kLines;
    scratch.polygon.clear();
    for (uint32_t k = 0; k < 3; ++k) scratch.polygon.push_back({corners[k] - receiver.p, line + k});
    const auto depth = [&](const Scratch::Corner& corner) { return dot(corner.w, a); };
    const auto [nearest, farthest] = std::minmax(
        {depth(scratch.polygon[0]), depth(scratch.polygon[1]), depth(scratch.polygon[2])});
    const double near = scratch.near, far = scratch.far;
    // Not by these depths, which may be rounded otherwise than those that its turn was found by.
    const bool whole = item && has_turn(*item, turns);
    if (!whole && nearest < near) {
      clip([&](const Vec3d& w) { return dot(w, a) - near; }, line + Scratch::kNearCut);
    }
    if (!whole && label >= scratch.uncut && farthest > far) {
      clip([&](const Vec3d& w) { return far - dot(w, a); }, line + Scratch::kFarCut);
    }
    const bool of_emitter = label < scratch.emitter_faces;
    if (of_emitter) {
      clip([&](const Vec3d& w) { return dot(w, receiver.up); }, line + Scratch::kHorizon);
      if (receiver.wedge) {
        clip([&](const Vec3d& w) { return dot(w, *receiver.wedge); }, line + Scratch::kWedge);
      }
    }
    scratch.place(on_grid);
    if (!within) return false;
    if (scratch.points.size() > 2) {
      scratch.outlines.add(scratch.points, scratch.lines, of_emitter, cancelled);
    }
  }
  scratch.sort_cut_points();
  return true;
}

// The polygons of an emitter that a point sees, of their true lines.
template <class S>
class ClosedLight::View {
 public:
  View(const ClosedLight& light, const EmitterPlane& emitter, const Receiver& receiver,
       const Vec3<S>& p, Scratch& scratch)
      : light_(light), emitter_(emitter), receiver_(receiver), p_(p), scratch_(scratch) {}

  // Appends the sides of all regions: their sum is that of the whole.
  void add_regions(std::vector<PolygonSide<S>>& all) const {
    std::vector<PolygonSide<S>> polygon;
    std::vector<Vec3d> units;
    scratch_.regions.for_each_below(
        scratch_.emitter_faces, [&](uint32_t shown, std::span<const PlanePoint> corners,
                                    std::span<const VisibleRegions::Side> sides) {
          polygon.resize(sides.size());
          units.resize(sides.size());
          for (size_t i = 0; i < sides.size(); ++i) {
            polygon[i].normal = normal_of(sides[i], shown);
            units[i] = normalize(value(polygon[i].normal));
          }
          for (size_t i = 0; i < sides.size(); ++i) {
            polygon[i].begin =
                meet(units[i == 0 ? sides.size() - 1 : i - 1], units[i], towards(corners[i]));
          }
          for (size_t i = 0; i < sides.size(); ++i) {
            polygon[i].end = polygon[(i + 1) % sides.size()].begin;
          }
          all.insert(all.end(), polygon.begin(), polygon.end());
        });
  }

  void add_outlines(std::vector<PolygonSide<S>>& all) const {
    scratch_.outlines.for_each([&](const ShadowOutlines::Piece& piece) {
      const Vec3d first = towards(piece.first), last = towards(piece.last);
      Vec3<S> n = normal_of_line<S>(piece.tag, first + last);
      const Vec3d rounded = cross(first, last);  // positive above
      if (value(n) == Vec3d{}) n = {S(rounded.x), S(rounded.y), S(rounded.z)};
      if ((dot(value(n), rounded) > 0) != piece.lit_above) n = -n;
      const Vec3d from = end_of(piece, piece.from), to = end_of(piece, piece.to);
      all.push_back(piece.lit_above ? PolygonSide<S>{n, from, to} : PolygonSide<S>{n, to, from});
    });
  }

 private:
  Vec3d towards(const PlanePoint& x) const {
    return emitter_.u * x.x + emitter_.v * x.y - emitter_.plane.n;
  }

  Vec3d towards(const ShadowOutlines::Point& x) const {
    const PlaneWindow& window = scratch_.window;
    return towards(
        PlanePoint{window.center.x + static_cast<double>(x.x) / kGridHalf * window.half_width,
                   window.center.y + static_cast<double>(x.y) / kGridHalf * window.half_height});
  }

  // Unit direction to an end of a piece.
  Vec3d end_of(const ShadowOutlines::Piece& piece, const ShadowOutlines::End& end) const {
    if (end.kind == ShadowOutlines::Kind::kIntersection)
      return meet(piece.tag, end.tag, piece, towards(end.at));
    if (const Scratch::CutPoint* cut = scratch_.cut_point_at(end.at)) {
      return meet(cut->lines[0], cut->lines[1], piece, cut->w);
    }
    // A corner of the face: that which is nearer to the point on the grid.
    const auto x = face_corners<double>(mesh_of(end.tag), face_of(end.tag).face);
    const uint32_t k = end.tag % Scratch::kLines;
    const Vec3d there = normalize(towards(end.at));
    const Vec3d w0 = x[k] - value(p_), w1 = x[(k + 1) % 3] - value(p_);
    const auto offset = [&](const Vec3d& w) {
      const double distance = length(w);
      return distance > 0 ? length_squared(w / distance - there) : 5;
    };
    return normalize(offset(w0) <= offset(w1) ? w0 : w1);
  }
  Vec3d meet(uint32_t line, uint32_t other, const ShadowOutlines::Piece& piece,
             const Vec3d& about) const {
    if (other < line) std::swap(line, other);  // the same for both pieces to the last bit
    const Vec3d hint = towards(piece.first) + towards(piece.last);
    return meet(normal_of_line<double>(line, hint), normal_of_line<double>(other, hint), about);
  }
  FaceRef face_of(uint32_t line) const { return scratch_.faces[line / Scratch::kLines]; }
  const Mesh& mesh_of(uint32_t line) const { return light_.scene_.shape(face_of(line).shape).mesh; }

  // Of the plane through p and a line. hint: a direction on it, to tell faces of the emitter apart.
  template <class T>
  Vec3<T> normal_of_line(uint32_t line, const Vec3d& hint) const {
    const uint32_t k = line % Scratch::kLines;
    const auto constant = [](const Vec3d& n) { return Vec3<T>{T(n.x), T(n.y), T(n.z)}; };
    if (k == Scratch::kHorizon) return constant(receiver_.up);
    if (k == Scratch::kWedge) return constant(*receiver_.wedge);
    if (k == Scratch::kNearCut) return {};
    const auto x = corners_of<T>(face_of(line));
    if (k == Scratch::kFarCut)
      return normal_of_crossing<T>(x, corners_of<T>(emitter_face_at(hint)));
    return plane_normal<T>(x[k], x[(k + 1) % 3]);
  }
  // The face of the emitter that is seen there, or the nearest.
  FaceRef emitter_face_at(const Vec3d& w) const {
    FaceRef best = emitter_.faces[0];
    double deepest = -std::numeric_limits<double>::infinity();
    for (const FaceRef face : emitter_.faces) {
      const auto x = face_corners<double>(light_.scene_.shape(face.shape).mesh, face.face);
      double depth = std::numeric_limits<double>::infinity();
      for (int k = 0; k < 3; ++k) {  // its corners run clockwise as seen from p
        const Vec3d n = cross(x[(k + 1) % 3] - value(p_), x[k] - value(p_));
        depth = std::min(depth, dot(n, w) / length(n));
      }
      if (depth > deepest) deepest = depth, best = face;
    }
    return best;
  }
  // Where a face goes through the emitter's plane: of all planes through their common line that
  // through p.
  template <class T>
  Vec3<T> normal_of_crossing(const std::array<Vec3<T>, 3>& x,
                             const std::array<Vec3<T>, 3>& y) const {
    const Vec3<T> n = cross(x[1] - x[0], x[2] - x[0]), m = cross(y[1] - y[0], y[2] - y[0]);
    return n * dot(m, point<T>() - y[0]) - m * dot(n, point<T>() - x[0]);
  }

  // Where two lines meet; `about` is where they do on the grid. Lines that are parallel to rounding
  // meet where they do there.
  static Vec3d meet(const Vec3d& n, const Vec3d& m, const Vec3d& about) {
    constexpr double kParallel = 1e-12, kAway = 0.5;  // not tuned
    const Vec3d there = normalize(about), line = cross(n, m);
    const double size = length(line);
    if (!(size > kParallel * length(n) * length(m))) return there;
    const Vec3d here = line * ((dot(line, there) < 0 ? -1 : 1) / size);
    return dot(here, there) > kAway ? here : there;
  }

  // Of the plane through p and a side of a region that shows the emitter's face `shown`, positive
  // inside.
  Vec3<S> normal_of(const VisibleRegions::Side& side, uint32_t shown) const {
    const PlaneFunction& f = side.line;
    const Vec3d rounded = emitter_.u * f.a + emitter_.v * f.b - emitter_.plane.n * f.c;
    Vec3<S> n;
    if (side.side >= 0) {
      const auto x = corners_of<S>(scratch_.faces[side.label]);
      n = plane_normal<S>(x[side.side], x[(side.side + 1) % 3]);
    } else if (side.cut >= 0) {
      n = normal_of_cut(side, shown);
    }
    const Vec3d still = value(n);
    if (still == Vec3d{}) return {S(rounded.x), S(rounded.y), S(rounded.z)};
    return dot(still, rounded) < 0 ? -n : n;
  }
  Vec3<S> normal_of_cut(const VisibleRegions::Side& side, uint32_t shown) const {
    const SeenFace& face = scratch_.seen[side.label];
    if (!face.whole && side.cut == 0) return {};  // just before p
    if (side.label < scratch_.emitter_faces) {
      const Vec3d& n = side.cut == (face.whole ? 0 : 1) ? receiver_.up : *receiver_.wedge;
      return {S(n.x), S(n.y), S(n.z)};
    }
    return normal_of_crossing<S>(corners_of<S>(scratch_.faces[side.label]),
                                 corners_of<S>(scratch_.faces[shown]));
  }
  template <class T>
  std::array<Vec3<T>, 3> corners_of(FaceRef face) const {
    if constexpr (std::is_same_v<T, Var>) {
      return corner_leaves(light_.scene_, face);
    } else {
      return face_corners<T>(light_.scene_.shape(face.shape).mesh, face.face);
    }
  }
  // The point that light falls on: as it moves, or where it is.
  template <class T>
  decltype(auto) point() const {
    if constexpr (std::is_same_v<T, S>) {
      return (p_);
    } else {
      return (receiver_.p);
    }
  }
  template <class T>
  Vec3<T> plane_normal(const Vec3<T>& x0, const Vec3<T>& x1) const {
    if constexpr (std::is_same_v<T, Var>) {
      return triangle_normal(p_, x0, x1);
    } else {
      return cross(x0 - point<T>(), x1 - point<T>());
    }
  }

  const ClosedLight& light_;
  const EmitterPlane& emitter_;
  const Receiver& receiver_;
  const Vec3<S>& p_;
  Scratch& scratch_;
};

// What the point sees of the emitter, in the scratch; as it is there if the last call was for the
// same.
void ClosedLight::find(const EmitterPlane& emitter, const Receiver& receiver, Scratch& scratch,
                       Turns& turns) const {
  Scratch::Found& last = scratch.last;
  const bool held = holds() && !receiver.edge;
  if (held && last.places == places_->number && last.by == by_ && last.p == receiver.p &&
      last.up == receiver.up && last.face == receiver.face && last.emitter == emitter.faces) {
    return;
  }
  last.places = 0;
  if (held) {
    last.places = places_->number;
    last.by = by_, last.p = receiver.p, last.up = receiver.up, last.face = receiver.face;
    last.emitter.assign(emitter.faces.begin(), emitter.faces.end());
  }
  scratch.seen_at_all = list(emitter, receiver, scratch);
  if (!scratch.seen_at_all) return;
  scratch.by_outlines = by_ != By::kRegions && find_outlines(emitter, receiver, scratch, turns);
  if (!scratch.by_outlines) find_regions(emitter, receiver, scratch);
}

template <class S>
Rgb<S> ClosedLight::scattered(const RayTracer& tracer, const SurfacePoint<S>& surface,
                              const Scattering<S>& scattering, const EdgeStart* edge) const {
  // On the heap: a shared library has little room for what belongs to threads.
  struct Space {
    std::array<Scratch, kHeld> of_emitters;
    Turns turns;
  };
  static thread_local const auto space = std::make_unique<Space>();
  static thread_local std::vector<PolygonSide<S>> sides;
  const Vec3d n = value(scattering.normal());
  if (surface.lifted) edge = nullptr;  // rays start off it
  Receiver receiver{value(surface.p), n, surface.start(), edge};
  if (edge) receiver.wedge = wedge_at(scene_, tracer, *edge, receiver.up);
  Rgb<S> sum;
  for (size_t i = 0; i < emitters_.size(); ++i) {
    const EmitterPlane& emitter = emitters_[i];
    const Shape& shape = scene_.shape(emitter.shape);
    Scratch& scratch = space->of_emitters[holds() ? i % kHeld : 0];
    find(emitter, receiver, scratch, space->turns);
    if (!scratch.seen_at_all) continue;
    const View<S> view(*this, emitter, receiver, surface.p, scratch);
    sides.clear();
    if (scratch.by_outlines) {
      view.add_outlines(sides);
    } else {
      view.add_regions(sides);
    }
    const std::span<const PolygonSide<S>> lit(sides);
    const Rgb<S> light = scattering.eval(n) * cosine_integral(lit, scattering.normal());
    sum += light * detail::emitter_radiance<S>(shape, emitter.shape);
  }
  return sum;
}

template Rgb<double> ClosedLight::scattered(const RayTracer&, const SurfacePoint<double>&,
                                            const Scattering<double>&, const EdgeStart*) const;
template Rgb<Dual> ClosedLight::scattered(const RayTracer&, const SurfacePoint<Dual>&,
                                          const Scattering<Dual>&, const EdgeStart*) const;
template Rgb<Var> ClosedLight::scattered(const RayTracer&, const SurfacePoint<Var>&,
                                         const Scattering<Var>&, const EdgeStart*) const;

}  // namespace limn
