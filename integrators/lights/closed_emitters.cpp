// Which scenes have their light in closed form, and the planes of their emitters.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>

#include "integrators/lights/closed_light.h"
#include "integrators/lights/direct_light_check.h"

namespace limn {
namespace {

// Planes of an emitter count as different beyond so many roundings of its coordinates to floats.
// Not tuned.
constexpr double kRoundings = 8 * 0x1p-24;
constexpr const char* kInstead = "use another method (render: path)";

[[noreturn]] void refuse(const SourceLocation& where, const std::string& what) {
  refuse_light("analytic", where, what);
}

uint64_t next_number() {
  static std::atomic<uint64_t> last = 0;
  return ++last;
}

// Whether two faces of one plane stay in one, to first order and rounding.
bool move_alike(const Mesh& mesh, FaceRef first, FaceRef second) {
  if (mesh.position_tangents.empty()) return true;
  const auto x = face_corners<Dual>(mesh, first.face), y = face_corners<Dual>(mesh, second.face);
  const Vec3<Dual> n = normalize(cross(x[1] - x[0], x[2] - x[0]));
  double speed = 0, apart = 0;
  for (int k = 0; k < 3; ++k) {
    const Lanes distance = dot(n, y[k] - x[0]).d;
    for (int lane = 0; lane < kLanes; ++lane) {
      apart = std::max(apart, std::fabs(distance[lane]));
      for (int c = 0; c < 3; ++c) {
        speed = std::max({speed, std::fabs(x[k][c].d[lane]), std::fabs(y[k][c].d[lane])});
      }
    }
  }
  return apart <= 1e-5 * speed;
}

}  // namespace

void check_closed_light(const Scene& scene) {
  check_plain_emitters(scene, "analytic");
  if (scene.max_depth == 1) return;
  const SourceLocation whole{scene.file};
  if (scene.max_depth != 2) {
    refuse(whole, fmt::format("only light that is scattered once has a closed form: set the "
                              "integrator's max_depth to 2 (it is {}), or {}",
                              scene.max_depth, kInstead));
  }
  if (scene.environment) {
    refuse(whole, fmt::format("{}: light from all around has no closed form here: {}",
                              quoted_name("emitter", scene.environment_id), kInstead));
  }
  for (const auto& light : scene.delta_lights) {
    refuse(whole, fmt::format("{}: only area lights are integrated: {}",
                              quoted_name("emitter", light->id), kInstead));
  }
  for (const Shape& shape : scene.shapes) {
    for (const bool front : {true, false}) {
      const Bsdf* side = shape.bsdf->side(front);
      if (!side || side->is_lambertian()) continue;
      refuse(shape.where,
             fmt::format("{}: only diffuse surfaces without textures have a closed form, this is "
                         "{}: {}",
                         shape_in_text(shape), side->describe(), kInstead));
    }
    const bool interpolates = shape.mesh.normal_source != NormalSource::kFace;
    if (scene.shading == ShadingModel::kMitsuba && interpolates) {
      refuse(shape.where,
             fmt::format("{}: its interpolated normals need the shading \"continuous\"",
                         shape_in_text(shape)));
    }
  }
}

ClosedLight::SharedGeometry::SharedGeometry(const Scene& scene, int threads)
    : number(next_number()), copies(scene), overlaps(scene, copies, threads), tree(scene) {
  tree.find_neighbours();
}

ClosedLight::ClosedLight(const Scene& scene, int threads, By by)
    : scene_((check_closed_light(scene), scene)),
      places_(std::make_shared<SharedGeometry>(scene, threads)),
      copies_(places_->copies),
      overlaps_(places_->overlaps),
      tree_(places_->tree),
      by_(by) {
  add_emitters();
}

ClosedLight::ClosedLight(const Scene& scene, const ClosedLight& same)
    : scene_(scene),
      places_(same.places_),
      copies_(places_->copies),
      overlaps_(places_->overlaps),
      tree_(places_->tree),
      by_(same.by_) {
  add_emitters();
}

void ClosedLight::add_emitters() {
  for (uint32_t s = 0; s < scene_.shapes.size(); ++s) {
    if (scene_.shapes[s].is_emitter && scene_.max_depth == 2) add_emitter(ShapeId(s));
  }
}

void ClosedLight::add_emitter(ShapeId id) {
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
  const size_t before = emitters_.size();
  for (const Face& face : faces) {
    const auto fits = [&](const EmitterPlane& emitter) {
      return dot(emitter.plane.n, face.normal) > 0.5 &&
             move_alike(mesh, emitter.faces[0], face.ref) &&
             std::all_of(face.corners.begin(), face.corners.end(), [&](const Vec3d& x) {
               return std::fabs(emitter.plane.distance(x)) <= kRoundings * size;
             });
    };
    auto emitter =
        std::find_if(emitters_.begin() + static_cast<ptrdiff_t>(before), emitters_.end(), fits);
    if (emitter == emitters_.end()) {
      EmitterPlane& added = emitters_.emplace_back();
      added.shape = id;
      added.plane = {face.normal, -dot(face.normal, face.corners[0])};
      added.deviation = 2 * kRoundings * size;
      emitter = emitters_.end() - 1;
    }
    emitter->faces.push_back(face.ref);
    emitter->hull.insert(emitter->hull.end(), face.corners.begin(), face.corners.end());
  }
  if (emitters_.size() - before > kMostPlanes) {
    refuse(shape.where,
           fmt::format("{} has {} planes, at most {} are integrated: {}", shape_in_text(shape),
                       emitters_.size() - before, kMostPlanes, kInstead));
  }
  for (size_t i = before; i < emitters_.size(); ++i) finish(emitters_[i]);
}

// The axes along which the emitter's box is smallest, and what lies in its plane before it.
void ClosedLight::finish(EmitterPlane& emitter) const {
  double least = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < emitter.hull.size(); ++i) {
    const size_t next = i % 3 == 2 ? i - 2 : i + 1;
    const Vec3d side = emitter.hull[next] - emitter.hull[i];
    const Vec3d u = normalize(side - emitter.plane.n * dot(side, emitter.plane.n));
    const Vec3d v = cross(u, emitter.plane.n);  // (u x v) . (-n) = 1
    double x0 = 1e300, x1 = -1e300, y0 = 1e300, y1 = -1e300;
    for (const Vec3d& x : emitter.hull) {
      x0 = std::min(x0, dot(u, x)), x1 = std::max(x1, dot(u, x));
      y0 = std::min(y0, dot(v, x)), y1 = std::max(y1, dot(v, x));
    }
    if (!((x1 - x0) * (y1 - y0) < least)) continue;
    least = (x1 - x0) * (y1 - y0);
    emitter.u = u, emitter.v = v;
    emitter.x0 = x0, emitter.x1 = x1, emitter.y0 = y0, emitter.y1 = y1;
  }
  emitter.in_place = overlaps_.in_place_of(emitter.faces);
  for (const FaceRef face : emitter.faces) {
    for (const FaceRef other : overlaps_.of(face)) {
      const FaceRef met = copies_.met(other, -emitter.plane.n, false).value_or(other);
      if (is_hit_first(scene_, met, face, -emitter.plane.n)) emitter.before.push_back(met);
    }
  }
}

}  // namespace limn
