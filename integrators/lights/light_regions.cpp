// Emitters as regions of light: their hulls, and cones around these.
#include "integrators/lights/light_regions.h"

#include <algorithm>
#include <numeric>

#include "limn/core/bounds.h"
#include "limn/core/light.h"

namespace limn {
namespace {

// Emitters of more faces are not tested for whether p is behind all of them. Not tuned.
constexpr size_t kFewFaces = 16;
// Emitters of more corners are taken for the box around them. Not tuned.
constexpr size_t kFewCorners = 64;
// Cones are wider than emitters by this angle [rad], which is beyond rounding: edges on their
// boundary, an emitter's own among them, are inside. Not tuned.
constexpr double kSlack = 1e-8;

Vec3d corner(const Mesh& mesh, uint32_t vertex) { return cast<double>(mesh.positions[vertex]); }

std::vector<Vec3d> distinct_corners(const Mesh& mesh) {
  std::vector<uint32_t> ids;
  for (const FaceIndices& face : mesh.faces) {
    for (const uint32_t vertex : face) ids.push_back(mesh.weld[vertex]);
  }
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  std::vector<Vec3d> corners;
  for (const uint32_t id : ids) corners.push_back(corner(mesh, id));
  return corners;
}

// Planes of faces that have an area.
std::vector<Plane> face_planes(const Mesh& mesh) {
  std::vector<Plane> planes;
  for (const FaceIndices& face : mesh.faces) {
    const Vec3d a = corner(mesh, face[0]);
    const Vec3d n = cross(corner(mesh, face[1]) - a, corner(mesh, face[2]) - a);
    const double n_length = length(n);
    if (n_length > 0) planes.push_back({n / n_length, -dot(n, a) / n_length});
  }
  return planes;
}

struct Point2 {
  double x, y;
};
double turn(const Point2& a, const Point2& b, const Point2& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// The convex hull, counter-clockwise (Andrew's monotone chain). What turns by less than
// `tolerance`, an area, is left out.
std::vector<Point2> convex_hull(std::vector<Point2> points, double tolerance) {
  std::sort(points.begin(), points.end(), [](const Point2& a, const Point2& b) {
    return a.x < b.x || (a.x == b.x && a.y < b.y);
  });
  std::vector<Point2> hull;
  const auto walk = [&](auto begin, auto end) {
    const size_t first = hull.size();
    for (auto p = begin; p != end; ++p) {
      while (hull.size() >= first + 2 && turn(hull[hull.size() - 2], hull.back(), *p) <= tolerance)
        hull.pop_back();
      hull.push_back(*p);
    }
    hull.pop_back();
  };
  walk(points.begin(), points.end());
  walk(points.rbegin(), points.rend());
  return hull;
}

// How far points of the plane reach out of a convex polygon.
double reach_out(const std::vector<Point2>& points, const std::vector<Point2>& polygon) {
  double reach = 0;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Point2 &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    const double side = std::hypot(b.x - a.x, b.y - a.y);
    for (const Point2& p : points) reach = std::max(reach, -turn(a, b, p) / side);
  }
  return reach;
}

// Makes a flat emitter a polygon; leaves the others as they are.
void flatten(const std::vector<Plane>& faces, EmitterHull& hull) {
  constexpr double kFlat = 1e-5;  // of the radius; not tuned
  if (faces.empty() || hull.radius == 0) return;
  const Frame frame(faces[0].n);
  for (const Plane& face : faces) {
    if (dot(face.n, frame.n) < 0.5) return;
  }
  std::vector<Point2> points;
  double deviation = 0;
  for (const Vec3d& x : hull.points) {
    const Vec3d local = frame.to_local(x - hull.center);
    points.push_back({local.x, local.y});
    deviation = std::max(deviation, std::fabs(faces[0].distance(x)));
  }
  if (deviation > kFlat * hull.radius) return;
  const double area = hull.radius * hull.radius;
  const std::vector<Point2> polygon = convex_hull(points, 1e-12 * area);
  if (polygon.size() < 3 || polygon.size() > DirectionCone::kMostPlanes) return;
  hull.flat = true;
  hull.plane = faces[0];
  hull.deviation = deviation + reach_out(points, polygon);
  hull.points.clear();
  hull.area = 0;
  for (size_t i = 2; i < polygon.size(); ++i) {
    hull.area += 0.5 * turn(polygon[0], polygon[i - 1], polygon[i]);
  }
  const Vec3d middle = hull.center - frame.n * faces[0].distance(hull.center);
  for (const Point2& p : polygon) hull.points.push_back(middle + frame.s * p.x + frame.t * p.y);
}

DirectionCone around_polygon(const EmitterHull& emitter, const Vec3d& p, double height) {
  DirectionCone cone;
  const double nearest = std::max(height, length(emitter.center - p) - emitter.radius);
  cone.slack = kSlack + 2 * emitter.deviation / nearest;
  for (size_t i = 0; i < emitter.points.size(); ++i) {
    const Vec3d a = emitter.points[i] - p, b = emitter.points[(i + 1) % emitter.points.size()] - p;
    const Vec3d m = cross(b, a);
    const double m_length = length(m);
    // Where a side points at p its plane is not known, and left out.
    if (m_length > 1e-9 * length(a) * length(b)) cone.add(m / m_length);
  }
  return cone;
}

// The octagon around the points as seen from p; no planes where they fill nearly a hemisphere.
DirectionCone around_points(const EmitterHull& emitter, const Vec3d& p) {
  DirectionCone cone;
  cone.slack = kSlack;
  const Vec3d to = emitter.center - p;
  const double distance = length(to);
  if (distance == 0) return cone;
  const Frame frame(to / distance);
  constexpr int kSides = DirectionCone::kMostPlanes;
  double support[kSides];
  std::fill_n(support, kSides, -1e300);
  const double d = std::sqrt(0.5);
  const double cosines[kSides] = {1, d, 0, -d, -1, -d, 0, d};
  for (const Vec3d& x : emitter.points) {
    const Vec3d w = frame.to_local(x - p);
    if (w.z <= 0.05 * length(w)) return cone;
    for (int k = 0; k < kSides; ++k) {
      const double along = cosines[k] * w.x + cosines[(k + 6) % kSides] * w.y;
      support[k] = std::max(support[k], along / w.z);
    }
  }
  for (int k = 0; k < kSides; ++k) {
    const Vec3d out = frame.s * cosines[k] + frame.t * cosines[(k + 6) % kSides];
    cone.add(normalize(frame.n * support[k] - out));
  }
  return cone;
}

double cap_solid_angle(const DirectionCap& cap) {
  return 2 * kPi * cap.sine * cap.sine / (1 + cap.cosine);
}

// A point of a convex polygon, uniform: of a fan of triangles.
Vec3d draw_in_polygon(const EmitterHull& emitter, double u1, double u2) {
  const Vec3d& a = emitter.points[0];
  double left = u1 * emitter.area;
  for (size_t i = 2;; ++i) {
    const Vec3d b = emitter.points[i - 1] - a, c = emitter.points[i] - a;
    const double part = 0.5 * length(cross(b, c));
    if (left >= part && i + 1 < emitter.points.size()) {
      left -= part;
      continue;
    }
    const double root = std::sqrt(std::min(left / part, 1.0));
    return a + b * (root * (1 - u2)) + c * (root * u2);
  }
}

bool is_in_polygon(const EmitterHull& emitter, const Vec3d& y) {
  for (size_t i = 0; i < emitter.points.size(); ++i) {
    const Vec3d &a = emitter.points[i], &b = emitter.points[(i + 1) % emitter.points.size()];
    if (dot(cross(b - a, y - a), emitter.plane.n) < 0) return false;
  }
  return true;
}

}  // namespace

EmitterHull make_emitter_hull(const Mesh& mesh, ShadingModel shading) {
  EmitterHull hull;
  hull.points = distinct_corners(mesh);
  Bounds bounds;
  for (const Vec3d& x : hull.points) bounds.extend(x);
  hull.center = bounds.center();
  for (const Vec3d& x : hull.points) hull.radius = std::max(hull.radius, length(x - hull.center));
  for (const FaceIndices& face : mesh.faces) {
    const Vec3d a = corner(mesh, face[0]);
    hull.area += 0.5 * length(cross(corner(mesh, face[1]) - a, corner(mesh, face[2]) - a));
  }
  const std::vector<Plane> faces = face_planes(mesh);
  // Interpolated normals let an emitter shine behind its faces.
  const bool by_planes =
      shading == ShadingModel::kContinuous || mesh.normal_source == NormalSource::kFace;
  if (by_planes && faces.size() <= kFewFaces) hull.faces = faces;
  flatten(faces, hull);
  if (hull.flat || hull.points.size() <= kFewCorners) return hull;
  hull.points.clear();
  for (int i = 0; i < 8; ++i) {
    const auto at = [&](int k) { return (i >> k & 1) != 0 ? bounds.upper[k] : bounds.lower[k]; };
    hull.points.push_back({at(0), at(1), at(2)});
  }
  return hull;
}

std::optional<DirectionCone> cone_around(const EmitterHull& emitter, const Vec3d& p,
                                         const Vec3d& n) {
  const auto behind = [&](const Plane& face) { return face.distance(p) <= 0; };
  if (!emitter.faces.empty() && std::all_of(emitter.faces.begin(), emitter.faces.end(), behind))
    return {};
  const auto below = [&](const Vec3d& x) { return dot(n, x - p) + emitter.deviation <= 0; };
  if (std::all_of(emitter.points.begin(), emitter.points.end(), below)) return {};
  if (!emitter.flat) return around_points(emitter, p);
  const double height = emitter.plane.distance(p);
  return height > 0 ? around_polygon(emitter, p, height) : DirectionCone{};
}

// The octagon around the cap.
std::optional<DirectionCone> cone_around(const DirectionCap& cap, const Vec3d& n) {
  if (dot(n, cap.axis) <= -cap.sine) return {};
  DirectionCone cone;
  cone.slack = kSlack;
  const Frame frame(cap.axis);
  for (int k = 0; k < DirectionCone::kMostPlanes; ++k) {
    const double a = 2 * kPi * k / DirectionCone::kMostPlanes;
    const Vec3d out = frame.s * std::cos(a) + frame.t * std::sin(a);
    cone.add(cap.axis * cap.sine - out * cap.cosine);
  }
  return cone;
}

LightRegions::LightRegions(const Scene& scene) : scene_(scene) {
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    if (!shape.is_emitter) continue;
    const double mean = limn::luminance(value(shape.radiance));
    Region& region = regions_.emplace_back();
    region.shape = ShapeId(s);
    region.luminance = mean;
    region.hull = make_emitter_hull(shape.mesh, scene.shading);
    if (!region.hull.flat || shape.mesh.faces.size() > kFewFaces) continue;
    for (uint32_t f = 0; f < shape.mesh.faces.size(); ++f) {
      region.flat_faces.push_back({region.shape, FaceId(f)});
    }
  }
  patches_ = regions_.size();
  hold_all_ = !scene.environment;
  leave_out_dim_emitters();
  add_patches();
  grow_tree();
}

void LightRegions::add_patches() {
  if (!scene_.environment) return;
  for (const BrightPatch& patch : find_bright_patches(*scene_.environment)) {
    Region& region = regions_.emplace_back();
    region.luminance = patch.luminance;
    region.patch = patch;
  }
}

// Edges before so many emitters are listed; of more, by choice. Not tuned.
constexpr size_t kMost = 16;

void LightRegions::grow_tree() {
  size_t moving = 0;
  const auto moves = [&](const Region& region) {
    return region.shape.valid() && !scene_.shape(region.shape).mesh.position_tangents.empty();
  };
  for (const Region& region : regions_) moving += moves(region);
  std::vector<LightTree::Emitter> emitters;
  for (uint32_t k = 0; k < regions_.size(); ++k) {
    const Region& region = regions_[k];
    if (k >= patches_ || patches_ <= kMost || (moving <= kMost && moves(region))) {
      always_.push_back(k);
      continue;
    }
    const double light = region.luminance * region.hull.area;
    // What is not flat shines in all directions.
    const bool flat = region.hull.flat;
    emitters.push_back({region.hull.center, flat ? region.hull.plane.n * light : Vec3d{},
                        flat ? 0 : light / 4, region.hull.area / kPi, light});
    in_tree_.push_back(k);
  }
  tree_ = LightTree(emitters);
}

void LightRegions::choose(const Vec3d& p, double u, std::vector<Choice>& choices) const {
  constexpr double kAny = 0.25;  // chosen whatever they send to p; not tuned
  choices.clear();
  const auto count = static_cast<double>(in_tree_.size());
  for (size_t j = 0; j < kMost && chooses(); ++j) {
    const double target = (static_cast<double>(j) + u) / kMost;
    const size_t in_tree =
        target < kAny ? std::min(static_cast<size_t>(target / kAny * count), in_tree_.size() - 1)
                      : tree_.choose(p, std::min((target - kAny) / (1 - kAny), 1 - 0x1p-53));
    // Neighbouring numbers choose the same one again.
    const uint32_t region = in_tree_[in_tree];
    if (!choices.empty() && choices.back().region == region) {
      choices.back().times += 1;
      continue;
    }
    const double probability = kAny / count + (1 - kAny) * tree_.probability(p, in_tree);
    choices.push_back({region, kMost * probability, 1});
  }
  for (const uint32_t region : always_) choices.push_back({region, 1, 1});
}

void LightRegions::leave_out_dim_emitters() {
  // The least share of all light: before 16 of 10,000 similar emitters, which hold next to none of
  // it, listing edges took a quarter of a short run.
  constexpr double kDim = 1.0 / 256;
  if (regions_.size() <= kMost) return;
  const auto light = [](const Region& region) { return region.luminance * region.hull.area; };
  std::vector<double> lights;
  for (const Region& region : regions_) lights.push_back(light(region));
  const double all = std::accumulate(lights.begin(), lights.end(), 0.0);
  std::nth_element(lights.begin(), lights.begin() + kMost, lights.end(), std::greater<>());
  const double least = std::max(lights[kMost], kDim * all);
  for (Region& region : regions_) region.lists_edges = light(region) > least;
}

bool LightRegions::any_in(const Scene& scene) {
  for (const Shape& shape : scene.shapes) {
    if (shape.is_emitter) return true;
  }
  return scene.environment && has_bright_patch(*scene.environment);
}

std::optional<DirectionCap> LightRegions::cap_around(const Region& region, const Vec3d& x) const {
  if (!region.shape.valid()) return region.patch.cap;
  const Vec3d to = region.hull.center - x;
  const double distance = length(to), sine = region.hull.radius / distance;
  if (!(sine > 0 && sine < 1)) return {};
  return DirectionCap{to / distance, sine, std::sqrt(1 - sine * sine)};
}

std::optional<Vec3d> LightRegions::draw_direction(size_t k, const Vec3d& x, double u1,
                                                  double u2) const {
  const Region& region = regions_[k];
  if (region.hull.flat) {
    if (!(region.hull.plane.distance(x) > 0)) return {};
    return normalize(draw_in_polygon(region.hull, u1, u2) - x);
  }
  const auto cap = cap_around(region, x);
  if (!cap) return {};
  const double inner = region.patch.inner_versine(),
               whole = cap->sine * cap->sine / (1 + cap->cosine);
  const double below = inner + u1 * (whole - inner);  // 1 - the cosine
  const double sine = std::sqrt(below * (2 - below));
  const Frame frame(cap->axis);
  return frame.n * (1 - below) + frame.s * (sine * std::cos(2 * kPi * u2)) +
         frame.t * (sine * std::sin(2 * kPi * u2));
}

double LightRegions::direction_pdf(size_t k, const Vec3d& x, const Vec3d& w) const {
  const Region& region = regions_[k];
  if (region.hull.flat) {
    const double height = region.hull.plane.distance(x), cosine = -dot(region.hull.plane.n, w);
    if (!(height > 0 && cosine > 0)) return 0;
    const double distance = height / cosine;
    if (!is_in_polygon(region.hull, x + w * distance)) return 0;
    return distance * distance / (region.hull.area * cosine);
  }
  const auto cap = cap_around(region, x);
  if (!cap || !cap->holds(w)) return 0;
  if (dot(w, cap->axis) >= region.patch.inner_cosine) return 0;
  return 1 / (cap_solid_angle(*cap) - 2 * kPi * region.patch.inner_versine());
}

Rgb<double> LightRegions::emission(size_t k, const SurfacePoint<double>& surface,
                                   const Vec3d& wi) const {
  if (surface.face.shape != regions_[k].shape) return {};
  return surface.emission(wi, scene_.shading);
}

Rgb<double> LightRegions::emission(const SurfacePoint<double>& surface, const Vec3d& wi) const {
  return surface.emission(wi, scene_.shading);
}

Rgb<double> LightRegions::escaped(size_t k, const Vec3d& w) const {
  const Region& region = regions_[k];
  if (region.shape.valid() || !region.patch.holds(w)) return {};
  return scene_.environment->radiance(w);
}

Rgb<double> LightRegions::escaped(const Vec3d& w) const {
  for (size_t k = patches_; k < regions_.size(); ++k) {
    if (regions_[k].patch.holds(w)) return scene_.environment->radiance(w);
  }
  return {};
}

void LightRegions::add_rest(EdgeSamplerInput& input) const {
  if (!scene_.environment || scene_.environment->is_uniform()) return;
  const auto brightness = [&](const Vec3d& w) {
    return std::max(0.0, limn::luminance(scene_.environment->radiance(w) - escaped(w)));
  };
  input.environment = std::make_shared<RadiancePyramid>(brightness, 8, 2);
}

}  // namespace limn
