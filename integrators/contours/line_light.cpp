// Sums over lines: the sky, maps, emitters.
#include "integrators/contours/line_light.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "integrators/lights/direct_light_check.h"
#include "integrators/lights/polygon_light.h"

namespace limn {
namespace {

// An emitter is worth so many times fewer lines than the sky, where listing contours takes longer.
// With 4, 8, 16, 32 lines the relative error of soft_lamp.xml (64 x 64) after 1.5 s is 5.8, 3.9,
// 2.5, 2.8 parts in 1000; that of ambient occlusion under the pebble after 3 s with 8, 16, 32, 64
// lines is 4.6, 1.3, 0.7, 0.2 parts.
constexpr int kSkyLines = 4;
// Emitters that are no polygon are cut into their faces. Not tuned.
constexpr size_t kMostFaces = 64;

// Few lines can miss the same thing and agree: a tolerance needs as many at least. Of a cube
// that fills a tenth of the azimuths the largest error of 100 offsets at a tolerance of 1e-3 is
// 0.13 from one line, and 1.1e-3 from 8 (test_line_light).
constexpr int kFewestLines = 8;

// A place on a line, by cot theta.
struct Azimuth {
  explicit Azimuth(double cot) {
    if (std::fabs(cot) > 1e100) {
      c = cot > 0 ? 1 : -1, s = 0;
    } else {
      s = 1 / std::sqrt(1 + cot * cot);
      c = cot * s;
    }
  }
  static Azimuth at(double theta) { return {std::cos(theta), std::sin(theta)}; }
  double theta() const { return std::atan2(s, c); }
  double c, s;

 private:
  Azimuth(double cosine, double sine) : c(cosine), s(sine) {}
};

// The integral of n . w sin theta between two places of a line.
double cosine_piece(double along, double across, const Azimuth& from, const Azimuth& to) {
  double sum = along * 0.5 * (to.s * to.s - from.s * from.s);
  if (across != 0) {
    sum += across * 0.5 * ((to.theta() - to.s * to.c) - (from.theta() - from.s * from.c));
  }
  return sum;
}

double size_of(double x) { return std::fabs(x); }
double size_of(const Rgb<double>& x) {
  return std::max({std::fabs(x.r), std::fabs(x.g), std::fabs(x.b)});
}

Pencil pencil_around(const Vec3d& pole) {
  const Frame frame(pole);
  return {pole, frame.s, frame.t};
}

// Of lines over the half sphere around n and above `up`: n, as long as that is well above.
Vec3d pole_between(const Vec3d& up, const Vec3d& n) { return dot(up, n) > 0.1 ? n : up; }

// Cuts a polygon of directions to n . w >= 0.
void cut(std::vector<Vec3d>& polygon, const Vec3d& n) {
  static thread_local std::vector<Vec3d> whole;
  whole = polygon;
  polygon.clear();
  for (size_t i = 0; i < whole.size(); ++i) {
    const Vec3d &a = whole[i], &b = whole[(i + 1) % whole.size()];
    const double at_a = dot(n, a), at_b = dot(n, b);
    if (at_a >= 0) polygon.push_back(a);
    if ((at_a >= 0) != (at_b >= 0)) polygon.push_back(a + (b - a) * (at_a / (at_a - at_b)));
  }
}

// Lines from the middle of a polygon of unit directions, spread by how far its corners reach along
// the axes of their scatter.
Pencil pencil_inside(std::span<const Vec3d> corners) {
  Vec3d sum;
  for (const Vec3d& w : corners) sum += w;
  Pencil pencil = pencil_around(normalize(sum));
  double xx = 0, xy = 0, yy = 0;
  for (const Vec3d& w : corners) {
    const double c = dot(pencil.pole, w);
    const double x = dot(pencil.u, w) / c, y = dot(pencil.v, w) / c;
    xx += x * x, xy += x * y, yy += y * y;
  }
  const double angle = 0.5 * std::atan2(2 * xy, xx - yy);
  const double c = std::cos(angle), s = std::sin(angle);
  const Vec3d u = pencil.u * c + pencil.v * s, v = pencil.v * c - pencil.u * s;
  const double su = std::sqrt(c * c * xx + 2 * c * s * xy + s * s * yy);
  const double sv = std::sqrt(std::fmax(s * s * xx - 2 * c * s * xy + c * c * yy, 0));
  // Slivers keep some width. Not tuned.
  return {pencil.pole, u, v, su, std::fmax(sv, 0.01 * su)};
}

}  // namespace

// What is scattered goes with n . w.
struct LineLight::Receiver {
  ContourPoint at;
  const Scattering<double>& scattering;
  Vec3d n;  // at.up but for rounding
};

struct LineLight::Scratch {
  std::vector<ContourArc> arcs;
  Isolines isolines;
  std::vector<Vec3d> polygon, planes;
  std::vector<PolygonSide<double>> sides;
};

// On the heap: a shared library has little room for what belongs to threads.
LineLight::Scratch& LineLight::scratch() {
  static thread_local const auto owned = std::make_unique<Scratch>();
  return *owned;
}

void LineLight::list(const ContourPoint& at, const DirectionCone& cone,
                     const ContourScreen* screen) const {
  Scratch& own = scratch();
  own.arcs.clear();
  contours_.list(at, cone, screen, own.arcs);
}

void LineLight::check(const Scene& scene, const std::string& method) {
  check_direct_light(scene, method);
  for (const Shape& shape : scene.shapes) {
    for (const bool front : {true, false}) {
      const Bsdf* side = shape.bsdf->side(front);
      if (!side || side->is_lambertian()) continue;
      refuse_light(
          method, shape.where,
          fmt::format(
              "{}: only diffuse surfaces without textures are integrated, this is {}: use another "
              "method (rays, path)",
              shape_in_text(shape), side->describe()));
    }
  }
  const Environment* sky = scene.environment.get();
  if (sky && !sky->is_uniform() && !sky->grid()) {
    refuse_light(method, {scene.file},
                 fmt::format("the environment is neither constant nor a map, but {}: use another "
                             "method (rays, path)",
                             sky->describe()));
  }
}

// What lies in an emitter's place; an error if that is another emitter: rays meet one of them,
// while here each would shine whole.
void LineLight::find_overlaps(int threads) {
  const DuplicateFaces copies(scene_);
  const FaceOverlaps overlaps(scene_, copies, threads);
  for (Emitter& emitter : emitters_) emitter.in_place = overlaps.in_place_of(emitter.faces);
  for (uint32_t s = 0; s < scene_.shapes.size(); ++s) {
    const Shape& shape = scene_.shapes[s];
    if (!shape.is_emitter) continue;
    for (uint32_t f = 0; f < shape.mesh.faces.size(); ++f) {
      if (!has_area(shape.mesh, shape.mesh.faces[f])) continue;
      const FaceRef face{ShapeId(s), FaceId(f)};
      const auto c = face_corners<double>(shape.mesh, face.face);
      const Vec3d towards = -cross(c[1] - c[0], c[2] - c[0]);
      const FaceRef copy = copies.met(face, towards, false).value_or(face);
      FaceRef first = copy;
      for (const FaceRef other : overlaps.of(face)) {
        const FaceRef met = copies.met(other, towards, false).value_or(other);
        if (is_hit_first(scene_, met, first, towards)) first = met;
      }
      if (first == face) continue;
      refuse_light(options_.method, shape.where,
                   fmt::format("{}: its face {} lies in one place with face {} of {}, which hides "
                               "it: leave one of them out, or use another method (rays, path)",
                               shape_in_text(shape), f, first.face.index(),
                               shape_in_text(scene_.shape(first.shape))));
    }
  }
}

LineLight::LineLight(const Scene& scene, const RayTracer& tracer, int threads,
                     const LineOptions& options, bool direct)
    : scene_(scene), contours_(scene, tracer, threads), options_(options) {
  if (!direct) return;
  check(scene, options_.method);
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    if (scene.shapes[s].is_emitter) add_emitter(ShapeId(s));
  }
  if (!emitters_.empty()) find_overlaps(threads);
  const Environment* sky = scene.environment.get();
  if (!sky || !sky->grid()) return;
  columns_ = std::make_unique<RadianceColumns>(*sky, threads);
  if (options_.uniform) return;
  std::vector<double> brightness = columns_->brightness();
  for (int k = 0; k < 2; ++k) {
    warps_.emplace_back(brightness);
    std::reverse(brightness.begin(), brightness.end());
  }
}

void LineLight::add_emitter(ShapeId id) {
  const Shape& shape = scene_.shape(id);
  const EmitterHull whole = make_emitter_hull(shape.mesh, scene_.shading);
  std::vector<FaceRef> faces;
  double area = 0;
  for (uint32_t f = 0; f < shape.mesh.faces.size(); ++f) {
    const auto c = face_corners<double>(shape.mesh, FaceId(f));
    faces.push_back({id, FaceId(f)});
    area += 0.5 * length(cross(c[1] - c[0], c[2] - c[0]));
  }
  // A polygon without holes or bays, to rounding of its corners to floats. Not tuned.
  if (whole.flat && area > whole.area * (1 - 1e-5)) {
    return add_polygon(whole, id, std::move(faces));
  }
  if (shape.mesh.faces.size() > kMostFaces) {
    refuse_light(
        options_.method, shape.where,
        fmt::format("{}: this emitter is no flat convex polygon of at most {} corners, so it "
                    "is taken face by face, and has {} of these where at most {} are "
                    "integrated: use another method (rays, path)",
                    shape_in_text(shape), DirectionCone::kMostPlanes, shape.mesh.faces.size(),
                    kMostFaces));
  }
  for (const FaceRef ref : faces) {
    const FaceIndices& face = shape.mesh.face(ref.face);
    if (!has_area(shape.mesh, face)) continue;
    Mesh one;
    for (const uint32_t vertex : face) one.positions.push_back(shape.mesh.positions[vertex]);
    one.faces = {{0, 1, 2}};
    one.weld = {0, 1, 2};
    const EmitterHull hull = make_emitter_hull(one, scene_.shading);
    if (hull.flat) add_polygon(hull, id, {ref});
  }
}

void LineLight::add_polygon(const EmitterHull& hull, ShapeId id, std::vector<FaceRef> faces) {
  double size = 0;
  for (const Vec3d& x : hull.points) {
    size = std::max({size, std::fabs(x.x), std::fabs(x.y), std::fabs(x.z)});
  }
  // What is nearer than rounding of positions to floats lies in the emitter's plane, wherever the
  // scene lies: at 1e4 from the origin that is 5e-3. Not tuned.
  const double margin = 2 * hull.deviation + 0x1p-21 * size;
  emitters_.push_back({value(scene_.shape(id).radiance),
                       hull,
                       contours_.make_screen(hull.plane, margin, hull.points),
                       std::move(faces),
                       {}});
}

// Over the contours in scratch(), along lines of the pencil as far as they are before all planes:
// the sum of `piece` over what is open; or, where the whole is known and the pole is open, that
// less what is not. w: of the pole. piece(line, from, to): for one radian of azimuth.
template <class V, class Piece>
V LineLight::sum_over_lines(const ContourPoint& at, const Pencil& pencil,
                            std::span<const Vec3d> planes, int w, const V* all, LineChoice choice,
                            const Piece& piece) const {
  int count = choice.count;
  double offset = choice.offset;
  Scratch& own = scratch();
  Isolines& lines = own.isolines;
  const bool open = !all || w != 0;
  const auto once = [&](double shift) {
    lines.build(pencil, count, shift, at, own.arcs);
    V sum{};
    for (int j = 0; j < count; ++j) {
      const Isolines::Line& line = lines.line(j);
      double start = std::numeric_limits<double>::infinity(), end = -start;
      for (const Vec3d& m : planes) {
        // Before it are cot . up + out >= 0: from the pole on, or to its opposite.
        const double up = dot(m, pencil.pole), out = dot(m, line.r);
        if (up > 0) {
          end = std::fmax(end, -out / up);
        } else if (up < 0) {
          start = std::fmin(start, -out / up);
        } else if (out < 0) {
          start = -std::numeric_limits<double>::infinity();
        }
      }
      lines.for_ranges(j, w, start, end, open, [&](double from, double to) {
        sum += piece(line, Azimuth(from), Azimuth(to)) * line.weight;
      });
    }
    return open ? sum : *all - sum;
  };
  if (options_.tolerance > 0) count = std::max(count, kFewestLines);
  V sum = once(offset);
  while (options_.tolerance > 0) {
    if (2 * count > kMostLines) {
      missed_.fetch_add(1, std::memory_order_relaxed);
      break;
    }
    // The lines between those that there are.
    const V other = once(offset < 0.5 ? offset + 0.5 : offset - 0.5);
    const double apart = size_of(other - sum);
    sum = (sum + other) * 0.5;
    if (!(apart > 2 * options_.tolerance * size_of(sum))) break;
    count *= 2;
    offset = offset < 0.5 ? 2 * offset : 2 * offset - 1;
  }
  return sum;
}

double LineLight::openness(const ContourPoint& at, double offset) const {
  list(at, {}, nullptr);
  const int w = contours_.count(at, at.up, nullptr);
  const double sum = sum_over_lines<double>(
      at, pencil_around(at.up), {&at.up, 1}, w, nullptr, {options_.lines, offset},
      [](const Isolines::Line&, const Azimuth& from, const Azimuth& to) { return from.c - to.c; });
  return sum / (2 * kPi);
}

double LineLight::ambient_occlusion(const ContourPoint& at, const Vec3d& n, double offset) const {
  list(at, {}, nullptr);
  const Vec3d planes[] = {at.up, n};
  const Pencil pencil = pencil_around(pole_between(at.up, n));
  const int w = contours_.count(at, pencil.pole, nullptr);
  const double along = dot(n, pencil.pole);
  const double sum = sum_over_lines<double>(
      at, pencil, planes, w, nullptr, {options_.lines, offset},
      [&](const Isolines::Line& line, const Azimuth& from, const Azimuth& to) {
        return cosine_piece(along, pencil.pole == n ? 0 : dot(n, line.r), from, to);
      });
  return sum / kPi;
}

// Of a uniform environment.
Rgb<double> LineLight::sky_light(const Receiver& receiver, double offset) const {
  const ContourPoint& at = receiver.at;
  const Vec3d planes[] = {at.up, receiver.n};
  const Pencil pencil = pencil_around(pole_between(at.up, receiver.n));
  const int w = contours_.count(at, pencil.pole, nullptr);
  const Rgb<double> radiance = scene_.environment->radiance(at.up);
  const double sum =
      sum_over_lines<double>(at, pencil, planes, w, nullptr, {options_.lines, offset},
                             [&](const Isolines::Line&, const Azimuth& from, const Azimuth& to) {
                               return cosine_piece(1, 0, from, to);
                             });
  return receiver.scattering.eval(receiver.n) * radiance * sum;
}

// A map's own, from its pole above the face.
Pencil LineLight::meridians(const Vec3d& up, const Environment::Grid& grid) const {
  const Vec3d pole = grid.pole * (dot(up, grid.pole) >= 0 ? 1 : -1);
  const Vec3d quarter = cross(pole, grid.zero);
  // Around one pole azimuths run as columns do, around the other they run back.
  const AzimuthWarp* warp = warps_.empty() ? nullptr : &warps_[dot(quarter, grid.quarter) < 0];
  return {pole, grid.zero, quarter, 1, 1, warp};
}

// Of a map, along its own meridians.
Rgb<double> LineLight::map_light(const Receiver& receiver, double offset) const {
  const ContourPoint& at = receiver.at;
  const Environment::Grid& grid = columns_->grid();
  const Pencil pencil = meridians(at.up, grid);
  const double turned = dot(pencil.pole, grid.pole);
  const int w = contours_.count(at, pencil.pole, nullptr);
  const auto cosine = [&](const RadianceColumns::Meridian& meridian, const Vec3d& r,
                          const Azimuth& from, const Azimuth& to) {
    const double along = dot(receiver.n, grid.pole), across = dot(receiver.n, r);
    const auto up_to = [&](const Azimuth& end) {
      const double c = end.c * turned;
      return columns_->up_to(meridian, std::atan2(end.s, c), c, end.s, along, across);
    };
    return (up_to(to) - up_to(from)) * turned;
  };
  const Rgb<double> scale = receiver.scattering.eval(receiver.n);
  const Vec3d planes[] = {at.up};
  const Rgb<double> sum = sum_over_lines<Rgb<double>>(
      at, pencil, planes, w, nullptr, {options_.lines, offset},
      [&](const Isolines::Line& line, const Azimuth& a, const Azimuth& b) {
        return cosine(columns_->meridian(line.r), line.r, a, b);
      });
  return scale * sum;
}

void LineLight::record(const SurfacePoint<double>& surface, const Scattering<double>& scattering,
                       double offset, double weight, SkyRecord& record) const {
  const Receiver receiver = receiver_at(surface, scattering);
  const ContourPoint& at = receiver.at;
  list(at, {}, nullptr);
  const Environment::Grid& grid = record.grid();
  const Pencil pencil = meridians(at.up, grid);
  const int w = contours_.count(at, pencil.pole, nullptr);
  const bool turned = dot(pencil.pole, grid.pole) < 0;
  record.begin(scattering.eval(receiver.n) * weight, receiver.n, offset,
               dot(pencil.v, grid.quarter) < 0);
  sum_over_lines<double>(at, pencil, {&at.up, 1}, w, nullptr, {options_.lines, offset},
                         [&](const Isolines::Line& line, const Azimuth& from, const Azimuth& to) {
                           const size_t j = &line - &scratch().isolines.line(0);
                           const double a = from.theta(), b = to.theta();
                           record.add_range(j, turned ? kPi - b : a, turned ? kPi - a : b);
                           return 0.0;
                         });
  record.end();
}

Rgb<double> LineLight::emitter_light(const Emitter& emitter, const Receiver& receiver,
                                     double offset) const {
  Scratch& own = scratch();
  const ContourPoint& at = receiver.at;
  // What lies in the emitter's own plane, as its back does, gets nothing of it, however it is
  // rounded; nor does a point above whose horizon no more than rounding of the emitter is seen.
  const double rounding = contours_.rounding(at, emitter.faces[0].shape);
  if (!(emitter.hull.plane.distance(at.p) > rounding)) return {};
  if (std::none_of(emitter.hull.points.begin(), emitter.hull.points.end(),
                   [&](const Vec3d& x) { return dot(at.up, x - at.p) > rounding; })) {
    return {};
  }
  if (emitter.in_place.contains(at.face)) return {};
  const auto cone = cone_around(emitter.hull, at.p, at.up);
  if (!cone) return {};
  own.polygon.clear();
  for (const Vec3d& x : emitter.hull.points) own.polygon.push_back(normalize(x - at.p));
  cut(own.polygon, at.up);
  if (own.polygon.size() < 3) return {};
  // Corners run so that the inside is on the right, as directions are looked at from outside.
  own.planes.clear();
  own.sides.clear();
  for (size_t i = 0; i < own.polygon.size(); ++i) {
    const Vec3d a = normalize(own.polygon[i]);
    const Vec3d b = normalize(own.polygon[(i + 1) % own.polygon.size()]);
    const Vec3d inward = cross(b, a);
    const double sine = length(inward);
    if (sine == 0) continue;
    own.planes.push_back(inward / sine);
    own.sides.push_back({inward, b, a});
  }
  const Pencil pencil = pencil_inside(own.polygon);
  const Rgb<double> f = receiver.scattering.eval(receiver.n);
  const double all = cosine_integral(own.sides, receiver.n);
  list(at, *cone, &emitter.screen);
  const int w = contours_.count(at, pencil.pole, &emitter.screen);
  const int emitter_lines = std::max(1, options_.lines / kSkyLines);
  if (own.arcs.empty()) return w == 0 ? f * emitter.radiance * all : Rgb<double>{};
  const double along = dot(receiver.n, pencil.pole);
  const double sum = sum_over_lines<double>(
      at, pencil, own.planes, w, &all, {emitter_lines, offset},
      [&](const Isolines::Line& line, const Azimuth& from, const Azimuth& to) {
        return cosine_piece(along, dot(receiver.n, line.r), from, to);
      });
  return f * emitter.radiance * sum;
}

LineLight::Receiver LineLight::receiver_at(const SurfacePoint<double>& surface,
                                           const Scattering<double>& scattering) const {
  return {at(surface, scattering.normal()), scattering, scattering.normal()};
}

Rgb<double> LineLight::emitters(const SurfacePoint<double>& surface,
                                const Scattering<double>& scattering, double offset) const {
  const Receiver receiver = receiver_at(surface, scattering);
  Rgb<double> sum;
  for (const Emitter& emitter : emitters_) sum += emitter_light(emitter, receiver, offset);
  return sum;
}

Rgb<double> LineLight::environment(const SurfacePoint<double>& surface,
                                   const Scattering<double>& scattering, double offset) const {
  if (!scene_.environment) return {};
  const Receiver receiver = receiver_at(surface, scattering);
  list(receiver.at, {}, nullptr);
  return columns_ ? map_light(receiver, offset) : sky_light(receiver, offset);
}

}  // namespace limn
