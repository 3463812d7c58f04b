// Which faces a viewpoint sees edge-on, and from where their edges are looked at instead.
#include "integrators/edges/viewpoint.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "limn/core/duplicate_faces.h"
#include "limn/core/shading.h"

namespace limn {
namespace {

constexpr double kAside = 0x1p-12;  // not tuned
// Of rays in floats a part of 2^-24 is lost to rounding. 2^-16 and 2^-14 pass the tests of
// test_kinks.cpp, too; 2^-18 does not.
constexpr double kHardly = 0x1p-15;
// No plane through an edge and a light that people write down holds it.
constexpr Vec3d kAnywhere{0.3701, 0.7851, 0.4967};
constexpr double kNear = 4 * kAside;  // a step aside must not lead through what is so near
// Two roundings of a position to single precision, in its length.
constexpr double kRounding = 0x1p-23;

using Corners = std::array<Vec3d, 3>;

// From p to the nearest point of the triangle's sides.
double distance_to_sides(const Corners& corners, const Vec3d& p) {
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    const Vec3d side = corners[(k + 1) % 3] - corners[k], to = p - corners[k];
    const double t = std::clamp(dot(to, side) / dot(side, side), 0.0, 1.0);
    least = std::min(least, length(to - side * t));
  }
  return least;
}

// Whether a point near the plane with the unit normal n lies on the face, or nearly so.
bool touches(const Corners& corners, const Vec3d& n, const Vec3d& p) {
  for (int k = 0; k < 3; ++k) {
    const Vec3d side = corners[(k + 1) % 3] - corners[k];
    const Vec3d to = p - corners[k];
    if (dot(cross(side, to), n) < -kNear * length(side) * length(to)) return false;
  }
  return true;
}

// The direction that leads to the front of planes that touch the viewpoint, behind most of the
// others, and at a good angle from all of them; the normals are unit. Of 128 all around; not tuned.
Vec3d direction_behind(const std::vector<Vec3d>& planes, const std::vector<Vec3d>& touching) {
  constexpr int kCount = 128;
  const double least = 0.05;
  Vec3d best{};
  double best_score = -1;
  for (int i = 0; i < kCount; ++i) {
    const double z = (2 * i + 1.0) / kCount - 1, phi = i * kPi * (3 - std::sqrt(5.0));
    const double r = std::sqrt(1 - z * z);
    const Vec3d u{r * std::cos(phi), r * std::sin(phi), z};
    double score = 0;
    for (const Vec3d& n : planes) {
      const double s = -dot(n, u);
      score += std::min(std::fabs(s), 0.25) * (s > 0 ? 2 : 1);
    }
    for (const Vec3d& n : touching) score += std::min(std::max(dot(n, u), 0.0), 0.25) * 2;
    for (const Vec3d& n : touching) {
      if (dot(n, u) < least) score *= 1e-3;
    }
    if (score <= best_score) continue;
    best_score = score;
    best = u;
  }
  return best;
}

// Whether a parameter moves the viewpoint out of the plane of the face that it lies in, or the
// plane away from it: by more than what rounding makes of a motion within the plane.
bool crosses(const Mesh& mesh, FaceId face, const LightOrigin& origin) {
  const auto corners = face_corners<Dual>(mesh, face);
  const Vec3<Dual> across = cross(corners[1] - corners[0], corners[2] - corners[0]);
  const Vec3<Dual> to = origin.through(corners[0]);
  const Vec3d n = value(across), w = value(to);
  for (int lane = 0; lane < kLanes; ++lane) {
    const auto rate = [&](const Vec3<Dual>& x) {
      return Vec3d{x.x.d[lane], x.y.d[lane], x.z.d[lane]};
    };
    const double speed = dot(rate(across), w) + dot(n, rate(to));
    const double turning = length(rate(across)) * length(w);
    const double moving = length(rate(origin.v)) + (origin.infinite ? 0 : length(rate(corners[0])));
    if (std::fabs(speed) > kEdgeOn * (turning + length(n) * moving)) return true;
  }
  return false;
}

// Each direction once, to a hundredth.
void add_direction(std::vector<Vec3d>& directions, const Vec3d& n) {
  const auto is_like = [&](const Vec3d& other) { return dot(other, n) > 1 - 0.5e-4; };
  if (std::none_of(directions.begin(), directions.end(), is_like)) directions.push_back(n);
}

Viewpoint viewpoint_of(const Scene& scene) {
  const Camera& camera = scene.camera;
  if (camera.has_lens()) return Viewpoint(value(camera.origin));
  return {scene, camera.is_orthographic() ? LightOrigin{camera.forward, true}
                                          : LightOrigin{camera.origin}};
}

}  // namespace

Viewpoint::Viewpoint(const Scene& scene, const LightOrigin& origin)
    : origin_{{origin.v.x.v, origin.v.y.v, origin.v.z.v}, origin.infinite},
      edge_on_(scene.shapes.size()) {
  const Vec3d v = value(origin.v);
  const auto farthest = [&](const Corners& corners) {
    double most = 0;
    for (const Vec3d& corner : corners) most = std::max(most, length(origin_.through(corner)));
    return most;
  };
  std::vector<Vec3d> planes, touching;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Mesh& mesh = scene.shapes[s].mesh;
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
      const Corners corners = face_corners<double>(mesh, FaceId(f));
      const Vec3d across = cross(corners[1] - corners[0], corners[2] - corners[0]);
      const double area = length(across);
      if (area == 0) continue;
      const Vec3d n = across / area, w = origin_.through(corners[0]);
      const double d = std::fabs(dot(n, w));
      if (d > kNear * farthest(corners)) continue;
      const bool touches_face = !origin.infinite && touches(corners, n, v);
      const double rounding = kRounding * (length(v) + length(corners[0]));
      const double near = origin.infinite ? 1 : distance_to_sides(corners, v);
      const bool edge_on = d <= kEdgeOn * near + (origin.infinite ? 0 : rounding);
      if (touches_face) {
        add_direction(touching, edge_on || dot(n, w) < 0 ? n : -n);
      } else if (edge_on) {
        add_direction(planes, n);
      }
      if (!edge_on) continue;
      if (mesh.normal_source == NormalSource::kFace) {
        if (flat_faces_++ == 0) first_shape_ = ShapeId(s);
        crosses_planes_ = crosses_planes_ || crosses(mesh, FaceId(f), origin);
      }
      if (edge_on_[s].empty()) edge_on_[s].resize(mesh.faces.size());
      edge_on_[s][f] = true;
      ++edge_on_count_;
    }
  }
  aside_ = edge_on_count_ > 0 ? direction_behind(planes, touching) : normalize(kAnywhere);
}

bool Viewpoint::sees_edge_on(const FacesAround& around) const {
  return edge_on_count_ > 0 && std::any_of(around.faces.begin(), around.faces.end(),
                                           [&](FaceRef face) { return is_edge_on(face); });
}

LightOrigin Viewpoint::seeing(const FacesAround& around, const Vec3d& y) const {
  return sees_edge_on(around) ? aside(y) : origin_;
}

LightOrigin Viewpoint::aside(const Vec3d& y) const { return aside(y, kAside); }

LightOrigin Viewpoint::hardly_aside(const Vec3d& y) const { return aside(y, kHardly); }

Vec3d Viewpoint::towards(const Vec3d& y) const { return -normalize(hardly_aside(y).through(y)); }

LightOrigin Viewpoint::aside(const Vec3d& y, double by) const {
  const Vec3d v = value(origin_.v);
  // Light from infinity travels along v: it comes from the other side.
  const Vec3d moved = v + aside_ * (by * (origin_.infinite ? -1 : length(y - v)));
  return {{moved.x, moved.y, moved.z}, origin_.infinite};
}

Facing Viewpoint::facing(const EdgeMesh& mesh, FaceId face) const {
  const Vec3d v = value(origin_.v), &n = mesh.plane(face).n;
  const bool edge_on = is_edge_on({mesh.shape, face});
  if (!edge_on && !origin_.infinite) return limn::facing(mesh, face, v);
  const bool front = edge_on ? dot(n, aside_) > 0 : dot(n, v) < 0;
  return {front, !front};
}

bool Viewpoint::is_candidate(const EdgeMesh& mesh, EdgeId id) const {
  const Edge& edge = mesh.edge(id);
  if (edge_on_count_ == 0 && !origin_.infinite) {
    return limn::is_candidate(mesh, id, value(origin_.v));
  }
  const Facing first = facing(mesh, edge.faces[0]);
  const FaceId second = edge.faces[1];
  return limn::is_candidate(mesh, id, first, second.valid() ? facing(mesh, second) : first);
}

Viewpoints::Viewpoints(const Scene& scene) : camera(viewpoint_of(scene)) {
  for (const auto& light : scene.delta_lights) {
    numbers.emplace(light.get(), lights.size());
    lights.emplace_back(scene, light->origin());
  }
}

bool Viewpoints::cross_planes() const {
  return camera.crosses_planes() ||
         std::any_of(lights.begin(), lights.end(),
                     [](const auto& light) { return light.crosses_planes(); });
}

void warn_of_faces_edge_on(const Scene& scene, const Viewpoints& viewpoints,
                           std::vector<std::string>& warnings) {
  const auto look = [&](const std::string& what, const Viewpoint& viewpoint) {
    if (viewpoint.flat_faces() == 0) return;
    warnings.push_back(fmt::format(
        "{} lies in the plane of faces ({} of them, the first of {}): there the image is not "
        "differentiable; the derivative is that of the side from which such a face is not seen; "
        "differences take the mean of both sides; move it a little off the plane",
        what, viewpoint.flat_faces(), quoted_name(scene, viewpoint.first_shape())));
  };
  look("the camera", viewpoints.camera);
  for (size_t i = 0; i < scene.delta_lights.size(); ++i) {
    look(scene.delta_lights[i]->describe(), viewpoints.lights[i]);
  }
}

}  // namespace limn
