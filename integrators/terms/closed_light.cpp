// Lamps as polygons, what lies before them, and the sums over what is left.
#include "integrators/terms/closed_light.h"

#include <fmt/format.h>

#include <algorithm>

#include "integrators/terms/polygon_light.h"
#include "limn/core/visible_regions.h"

namespace limn {
namespace {

// Planes of a lamp are told apart beyond so many roundings of its coordinates to floats. Not tuned.
constexpr double kRoundings = 8 * 0x1p-24;
// What is nearer to a point than this part of its distance from the lamp's plane does not shade it.
// Not tuned: far below the rounding of positions, far above that of directions.
constexpr double kNear = 0x1p-30;
// A window is wider than its lamp, so that the lamp's sides are inside. Not tuned.
constexpr double kMargin = 0x1p-10;

constexpr const char* kInstead = "use another method (render: path)";

bool is_diffuse(const Bsdf& bsdf) {
  const LobeSummary lobe = bsdf.lobe();
  return lobe.model == &kHemisphere;
}

std::string name_of(const std::string& kind, const std::string& id) {
  return id.empty() ? kind : fmt::format("{} \"{}\"", kind, id);
}

[[noreturn]] void refuse(const SourceLocation& where, const std::string& what) {
  throw InputError(where, "the method \"analytic\": " + what);
}

}  // namespace

void check_closed_light(const Scene& scene) {
  if (scene.max_depth == 1) return;
  const SourceLocation whole{scene.file};
  if (scene.max_depth != 2) {
    refuse(whole, fmt::format("only light that is scattered once has a closed form: set the "
                              "integrator's max_depth to 2 (it is {}), or {}",
                              scene.max_depth, kInstead));
  }
  if (scene.environment) {
    refuse(whole, fmt::format("{}: light from all around has no closed form here: {}",
                              name_of("emitter", scene.environment_id), kInstead));
  }
  for (const auto& light : scene.delta_lights) {
    refuse(whole, fmt::format("{}: only area lights are integrated: {}",
                              name_of("emitter", light->id), kInstead));
  }
  for (const Shape& shape : scene.shapes) {
    for (const bool front : {true, false}) {
      const Bsdf* side = shape.bsdf->side(front);
      if (!side || is_diffuse(*side)) continue;
      refuse(shape.where, fmt::format("{}: only diffuse surfaces have a closed form, this is "
                                      "{}: {}",
                                      name_of("shape", shape.id), side->describe(), kInstead));
    }
    const bool interpolates = shape.mesh.normal_source != NormalSource::kFace;
    if (scene.shading == ShadingModel::kMitsuba && interpolates) {
      refuse(shape.where, fmt::format("{}: its interpolated normals need --shading continuous",
                                      name_of("shape", shape.id)));
    }
  }
}

// The point that light falls on.
struct ClosedLight::Receiver {
  Vec3d p;
  Vec3d up;  // unit, of its face, towards the viewer
  FaceRef face;
  const EdgeStart* edge;
  // Of a point on an edge: another face there leaves directions w with wedge . w >= 0.
  std::optional<Vec3d> wedge = {};
};

struct ClosedLight::Scratch {
  std::vector<const FaceTree::Item*> items;
  std::vector<FaceRef> faces;  // by label: first the lamp's, then those before it
  std::vector<SeenFace> seen;  // the same
  size_t lamp_faces = 0;
  std::vector<uint32_t> order;
  VisibleRegions regions{{}};
};

ClosedLight::ClosedLight(const Scene& scene, int threads)
    : scene_((check_closed_light(scene), scene)),
      copies_(scene),
      overlaps_(scene, copies_, threads),
      tree_(scene) {
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    if (scene.shapes[s].is_emitter && scene.max_depth == 2) add_lamp(ShapeId(s));
  }
}

void ClosedLight::add_lamp(ShapeId id) {
  const Shape& shape = scene_.shape(id);
  const Mesh& mesh = shape.mesh;
  struct Face {
    FaceRef ref;
    std::array<Vec3d, 3> corners;
    Vec3d normal;
    double area;
  };
  std::vector<Face> faces;
  double size = 0;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const FaceRef ref{id, FaceId(f)};
    if (!has_area(mesh, mesh.faces[f])) continue;
    const auto c = face_corners<double>(mesh, ref.face);
    const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
    if (!copies_.empty() && copies_.met(ref, -n, false) != ref) continue;
    faces.push_back({ref, c, normalize(n), length(n)});
    for (const Vec3d& x : c)
      size = std::max({size, std::fabs(x.x), std::fabs(x.y), std::fabs(x.z)});
  }
  // The largest face knows its plane best.
  std::stable_sort(faces.begin(), faces.end(),
                   [](const Face& a, const Face& b) { return a.area > b.area; });
  const size_t before = lamps_.size();
  for (const Face& face : faces) {
    const auto fits = [&](const LampPlane& lamp) {
      return dot(lamp.plane.n, face.normal) > 0.5 &&
             std::all_of(face.corners.begin(), face.corners.end(), [&](const Vec3d& x) {
               return std::fabs(lamp.plane.distance(x)) <= kRoundings * size;
             });
    };
    auto lamp = std::find_if(lamps_.begin() + static_cast<ptrdiff_t>(before), lamps_.end(), fits);
    if (lamp == lamps_.end()) {
      LampPlane& added = lamps_.emplace_back();
      added.shape = id;
      added.plane = {face.normal, -dot(face.normal, face.corners[0])};
      added.deviation = 2 * kRoundings * size;
      lamp = lamps_.end() - 1;
    }
    lamp->faces.push_back(face.ref);
    lamp->hull.insert(lamp->hull.end(), face.corners.begin(), face.corners.end());
  }
  if (lamps_.size() - before > kMostPlanes) {
    refuse(shape.where,
           fmt::format("{} has {} planes, at most {} are integrated: {}",
                       name_of("shape", shape.id), lamps_.size() - before, kMostPlanes, kInstead));
  }
  for (size_t i = before; i < lamps_.size(); ++i) finish(lamps_[i]);
}

// The axes along which the lamp's box is smallest, and what lies in its plane before it.
void ClosedLight::finish(LampPlane& lamp) const {
  double least = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < lamp.hull.size(); ++i) {
    const size_t next = i % 3 == 2 ? i - 2 : i + 1;
    const Vec3d side = lamp.hull[next] - lamp.hull[i];
    const Vec3d u = normalize(side - lamp.plane.n * dot(side, lamp.plane.n));
    const Vec3d v = cross(u, lamp.plane.n);  // (u x v) . (-n) = 1
    double x0 = 1e300, x1 = -1e300, y0 = 1e300, y1 = -1e300;
    for (const Vec3d& x : lamp.hull) {
      x0 = std::min(x0, dot(u, x)), x1 = std::max(x1, dot(u, x));
      y0 = std::min(y0, dot(v, x)), y1 = std::max(y1, dot(v, x));
    }
    if (!((x1 - x0) * (y1 - y0) < least)) continue;
    least = (x1 - x0) * (y1 - y0);
    lamp.u = u, lamp.v = v;
    lamp.x0 = x0, lamp.x1 = x1, lamp.y0 = y0, lamp.y1 = y1;
  }
  for (const FaceRef face : lamp.faces) {
    for (const FaceRef other : overlaps_.of(face)) {
      if (is_met_first(scene_, other, face, -lamp.plane.n)) lamp.before.push_back(other);
    }
  }
}

bool ClosedLight::is_skipped(FaceRef face, const Receiver& receiver) const {
  if (face == receiver.face) return true;
  const bool alone = copies_.empty() && overlaps_.empty();
  if (!alone && overlaps_.contains(receiver.face, face)) return true;
  if (!receiver.edge) return false;
  const auto& around = receiver.edge->around.faces;
  return std::any_of(around.begin(), around.end(), [&](FaceRef other) {
    return face == other || (!alone && overlaps_.contains(other, face));
  });
}

// Finds the regions of the lamp that the point sees; false if there are none.
bool ClosedLight::list(const LampPlane& lamp, const Receiver& receiver, Scratch& scratch) const {
  const Vec3d &p = receiver.p, a = -lamp.plane.n;
  const double height = lamp.plane.distance(p);
  if (!(height > 0)) return false;
  const bool above = std::any_of(lamp.hull.begin(), lamp.hull.end(),
                                 [&](const Vec3d& x) { return dot(receiver.up, x - p) > 0; });
  if (!above) return false;

  const double px = dot(lamp.u, p), py = dot(lamp.v, p);
  PlaneWindow window;
  window.center = {(0.5 * (lamp.x0 + lamp.x1) - px) / height,
                   (0.5 * (lamp.y0 + lamp.y1) - py) / height};
  window.half_width = (1 + kMargin) * 0.5 * (lamp.x1 - lamp.x0) / height;
  window.half_height = (1 + kMargin) * 0.5 * (lamp.y1 - lamp.y0) / height;

  const double near = kNear * height, far = height - lamp.deviation;
  constexpr double kInfinity = std::numeric_limits<double>::max();
  const PlaneView lamp_view(p, lamp.u, lamp.v, a, near, kInfinity);
  scratch.faces.clear();
  scratch.seen.clear();
  const auto add = [&](const PlaneView& view, FaceRef ref) {
    const auto corners = face_corners<double>(scene_.shape(ref.shape).mesh, ref.face);
    const auto face = view.face(static_cast<uint32_t>(scratch.seen.size()), corners);
    if (!face) return;
    scratch.faces.push_back(ref);
    scratch.seen.push_back(*face);
  };
  for (const FaceRef face : lamp.faces) add(lamp_view, face);
  scratch.lamp_faces = scratch.seen.size();
  for (const FaceRef face : lamp.before) add(lamp_view, face);
  if (far > near) {
    const PlaneView view(p, lamp.u, lamp.v, a, near, far);
    std::array<HalfSpace, 8> set;
    size_t count = 0;
    const auto bound = [&](const Vec3d& n, double offset) {
      set[count++] = {n, offset - dot(n, p)};
    };
    bound(a * (window.center.x + window.half_width) - lamp.u, 0);
    bound(lamp.u - a * (window.center.x - window.half_width), 0);
    bound(a * (window.center.y + window.half_height) - lamp.v, 0);
    bound(lamp.v - a * (window.center.y - window.half_height), 0);
    bound(receiver.up, 0);
    bound(a, 0);
    bound(-a, far);
    if (receiver.wedge) bound(*receiver.wedge, 0);
    scratch.items.clear();
    tree_.list(std::span(set).first(count), scratch.items);
    for (const FaceTree::Item* item : scratch.items) {
      if (!is_skipped(item->face, receiver)) add(view, item->face);
    }
  }

  // The largest first: what is covered already is left at once. Those before the lamp are no nearer
  // than each other: each has a depth of its own, in the order of insertion.
  std::vector<uint32_t>& order = scratch.order;
  order.clear();
  for (size_t i = scratch.lamp_faces; i < scratch.seen.size(); ++i) {
    order.push_back(static_cast<uint32_t>(i));
  }
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
  scratch.regions.reset(window, getenv("GRID") ? order.size() * atof(getenv("GRID")) : 0);
  const auto insert = [&](SeenFace& face, double inverse_depth) {
    face.inverse_depth = {0, 0, inverse_depth};
    face.nearest = inverse_depth;
    face.depth_error = 0;
    scratch.regions.insert(face);
  };
  for (size_t i = 0; i < scratch.lamp_faces; ++i) {
    SeenFace& face = scratch.seen[i];
    const auto cut = [&](const Vec3d& n) {
      face.cuts[face.cut_count++] = {dot(n, lamp.u), dot(n, lamp.v), dot(n, a)};
    };
    cut(receiver.up);
    if (receiver.wedge) cut(*receiver.wedge);
    insert(face, 1);
  }
  for (size_t i = 0; i < order.size(); ++i) {
    insert(scratch.seen[order[i]], 3 - static_cast<double>(i) / static_cast<double>(order.size()));
  }
  return scratch.lamp_faces > 0;
}

// The polygons of a lamp that a point sees, of their true lines.
template <class S>
class ClosedLight::View {
 public:
  View(const ClosedLight& light, const LampPlane& lamp, const Receiver& receiver, const Vec3<S>& p,
       const Scratch& scratch)
      : light_(light), lamp_(lamp), receiver_(receiver), p_(p), scratch_(scratch) {}

  // visit(sides)
  template <class Visit>
  void for_each_polygon(const Visit& visit) const {
    std::vector<PolygonSide<S>> polygon;
    std::vector<Vec3d> units;
    scratch_.regions.for_each_below(
        static_cast<uint32_t>(scratch_.lamp_faces),
        [&](uint32_t shown, std::span<const PlanePoint> corners,
            std::span<const VisibleRegions::Side> sides) {
          polygon.resize(sides.size());
          units.resize(sides.size());
          for (size_t i = 0; i < sides.size(); ++i) {
            polygon[i].normal = normal_of(sides[i], shown);
            units[i] = normalize(value(polygon[i].normal));
          }
          for (size_t i = 0; i < sides.size(); ++i) {
            polygon[i].begin = meet(units[i == 0 ? sides.size() - 1 : i - 1], units[i], corners[i]);
          }
          visit(std::span<const PolygonSide<S>>(polygon));
        });
  }

 private:
  Vec3d towards(const PlanePoint& x) const { return lamp_.u * x.x + lamp_.v * x.y - lamp_.plane.n; }

  // Where two lines meet; near `corner`, where they do on the grid. Lines that are parallel to
  // rounding meet where they do there.
  Vec3d meet(const Vec3d& first, const Vec3d& second, const PlanePoint& corner) const {
    constexpr double kParallel = 1e-12, kAway = 0.5;  // not tuned
    const Vec3d there = normalize(towards(corner)), line = cross(first, second);
    const double size = length(line);
    if (!(size > kParallel)) return there;
    const Vec3d here = line * ((dot(line, there) < 0 ? -1 : 1) / size);
    return dot(here, there) > kAway ? here : there;
  }

  // Of the plane through p and a side of a region that shows the lamp's face `shown`, positive
  // inside.
  Vec3<S> normal_of(const VisibleRegions::Side& side, uint32_t shown) const {
    const PlaneFunction& f = side.line;
    const Vec3d rounded = lamp_.u * f.a + lamp_.v * f.b - lamp_.plane.n * f.c;
    Vec3<S> n;
    if (side.side >= 0) {
      const auto x = corners_of(scratch_.faces[side.label]);
      n = cross(x[side.side] - p_, x[(side.side + 1) % 3] - p_);
    } else if (side.cut >= 0) {
      n = normal_of_cut(side, shown);
    }
    const Vec3d still = value(n);
    if (still == Vec3d{}) return {S(rounded.x), S(rounded.y), S(rounded.z)};
    return dot(still, rounded) < 0 ? -n : n;
  }
  Vec3<S> normal_of_cut(const VisibleRegions::Side& side, uint32_t shown) const {
    const SeenFace& face = scratch_.seen[side.label];
    if (side.label < scratch_.lamp_faces) {
      const Vec3d& n = side.cut == 0 ? receiver_.up : *receiver_.wedge;
      return {S(n.x), S(n.y), S(n.z)};
    }
    if (!face.whole && side.cut == 0) return {};  // just before p
    // Where the face goes through the lamp's plane: of all planes through their common line that
    // through p.
    const auto x = corners_of(scratch_.faces[side.label]), y = corners_of(scratch_.faces[shown]);
    const Vec3<S> n = cross(x[1] - x[0], x[2] - x[0]), m = cross(y[1] - y[0], y[2] - y[0]);
    return n * dot(m, p_ - y[0]) - m * dot(n, p_ - x[0]);
  }
  std::array<Vec3<S>, 3> corners_of(FaceRef face) const {
    return face_corners<S>(light_.scene_.shape(face.shape).mesh, face.face);
  }

  const ClosedLight& light_;
  const LampPlane& lamp_;
  const Receiver& receiver_;
  const Vec3<S>& p_;
  const Scratch& scratch_;
};

namespace {

// Of the faces around an edge that rise above the start's own, which is what a point near the edge
// sees of them: the one that rises first leaves directions w with this . w >= 0.
std::optional<Vec3d> wedge_at(const Scene& scene, const RayTracer& tracer, const EdgeStart& edge,
                              const Vec3d& up) {
  const Vec3d along = normalize(edge.x1 - edge.x0);
  const Vec3d& f = edge.start.into;
  const auto turn = [&](const Vec3d& a, const Vec3d& b) { return dot(along, cross(a, b)); };
  const double sign = turn(f, up) < 0 ? -1 : 1;
  std::optional<Vec3d> wedge;
  double nearest = -2;
  for_every_side(scene, edge.around, edge.x0, along, [&](const FaceSide& side, Incidence) {
    if (side.face == edge.start.face || overlap(tracer, side, edge.start)) return;
    if (!(sign * turn(f, side.into) > 0) || !(dot(f, side.into) > nearest)) return;
    nearest = dot(f, side.into);
    wedge = cross(along, side.into) * -sign;
  });
  return wedge;
}

}  // namespace

template <class S>
Rgb<S> ClosedLight::scattered(const RayTracer& tracer, const SurfacePoint<S>& surface,
                              const Scattering<S>& scattering, const EdgeStart* edge) const {
  static thread_local Scratch scratch;
  const bool front = dot(surface.n_g, value(scattering.wi())) > 0;
  Receiver receiver{value(surface.p), front ? surface.n_g : -surface.n_g, surface.face, edge};
  if (edge) receiver.wedge = wedge_at(scene_, tracer, *edge, receiver.up);
  const Vec3d n_s = front ? value(surface.n_s) : -value(surface.n_s);
  // At the rim of smooth surfaces normals are bent, and two of them enter the scattering function.
  const bool bent = !(value(scattering.normal()) == n_s);
  const double horizon = value(surface.horizon);
  const std::array<Kink, 3> kinks = {
      {{value(scattering.normal()), 0}, {n_s, horizon}, {n_s, horizon * (2 - horizon)}}};
  Rgb<S> sum;
  for (const LampPlane& lamp : lamps_) {
    const Shape& shape = scene_.shape(lamp.shape);
    if (!list(lamp, receiver, scratch)) continue;
    const View<S> view(*this, lamp, receiver, surface.p, scratch);
    Rgb<S> light;
    if (!bent) {
      S cosines{};
      view.for_each_polygon([&](const auto& polygon) {
        cosines += ramp_integral(polygon, scattering.normal(), surface.horizon);
      });
      light = scattering.eval(value(scattering.normal())) * cosines;
    } else {
      const Vec3d middle = lamp.u * (0.5 * (lamp.x0 + lamp.x1)) +
                           lamp.v * (0.5 * (lamp.y0 + lamp.y1)) - lamp.plane.n * lamp.plane.offset;
      const Vec3d pole = normalize(middle - receiver.p);
      view.for_each_polygon([&](const auto& polygon) {
        light += polygon_integral<S>(polygon, pole, kinks,
                                     [&](const Vec3d& w) { return scattering.eval(w); });
      });
    }
    sum += light * as<S>(shape.radiance);
  }
  return sum;
}

template Rgb<double> ClosedLight::scattered(const RayTracer&, const SurfacePoint<double>&,
                                            const Scattering<double>&, const EdgeStart*) const;
template Rgb<Dual> ClosedLight::scattered(const RayTracer&, const SurfacePoint<Dual>&,
                                          const Scattering<Dual>&, const EdgeStart*) const;

}  // namespace limn
