// Which flat parts of surfaces are mirrors.
#include "integrators/edges/flat_mirrors.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "limn/core/bounds.h"
#include "limn/core/surface_point.h"

namespace limn {
namespace {

// How far a plane's points may lie off it, over the size of the mesh, their speeds, over the
// largest there, and unit vectors. Not tuned.
constexpr double kFlat = 0x1p-16;

Rgb<double> reflectance(const Shape& shape, bool front) {
  const Bsdf* side = shape.bsdf->side(front);
  if (!side || !side->lobes().smooth || shape.bsdf->maps_normals()) return {};
  const Vec3d n{0, 0, 1};
  SmoothRays<double> rays;
  const int count = side->smooth_rays(n, n, rays);
  return mirrored_share({rays.data(), static_cast<size_t>(count)}, n, n);
}

// Of what a side refracts along its normal: the share of light, and the index beyond.
struct Refraction {
  double share = 0, index = 0;
};
Refraction refraction_of(const Shape& shape, bool front) {
  const Bsdf* side = shape.bsdf->side(front);
  Refraction result;
  if (!side || !side->lobes().smooth || !side->lobes().through) return result;
  if (shape.bsdf->maps_normals()) return result;
  const Vec3d n{0, 0, 1}, wi = normalize(Vec3d{0x1p-8, 0, 1});  // straight on is another direction
  SmoothRays<double> rays;
  const auto count = static_cast<size_t>(side->smooth_rays(n, wi, rays));
  for (const auto& ray : std::span(rays).first(count)) {
    if (dot(ray.wo, n) >= 0 || ray.wo == -wi) continue;
    result.share += luminance(ray.weight);
    result.index = ray.eta;
  }
  return result.share > 0 ? result : Refraction{};
}

// Whether shading normals are those of the face.
bool is_flat(const Mesh& mesh, FaceId face, const Vec3d& n) {
  if (mesh.normal_source == NormalSource::kFace) return true;
  const auto normals = detail::corner_normals<double>(mesh, face);
  return std::all_of(normals.begin(), normals.end(), [&](const Vec3d& corner) {
    return length(cross(corner, n)) <= kFlat * length(corner);
  });
}

// What lengths and speeds of a mesh are compared with.
struct Scale {
  double length = 0;
  Lanes speed{};

  explicit Scale(const Mesh& mesh) {
    Bounds bounds;
    for (const Vec3f& p : mesh.positions) bounds.extend(cast<double>(p));
    length = bounds.diagonal();
    for (const Vec3<Lanes> v : mesh.position_tangents) {
      for (int k = 0; k < kLanes; ++k) {
        speed[k] = std::max(speed[k], std::hypot(v.x[k], v.y[k], v.z[k]));
      }
    }
  }
  // Whether the point lies in the plane, and moves with it.
  bool holds(const MirrorPlane<Dual>& plane, const Vec3<Dual>& x) const {
    const Dual d = plane.distance(x);
    bool together = std::fabs(d.v) <= kFlat * length;
    for (int k = 0; k < kLanes; ++k) together &= std::fabs(d.d[k]) <= kFlat * speed[k];
    return together;
  }
};

}  // namespace

bool is_mirrored(const Vec3d& n, const Vec3d& wi, const Vec3d& wo) {
  return length(wo + wi - n * (2 * dot(n, wi))) <= 2 * kFlat;
}

Rgb<double> mirrored_share(std::span<const SmoothRay<double>> rays, const Vec3d& n,
                           const Vec3d& wi) {
  Rgb<double> sum;
  for (const SmoothRay<double>& ray : rays) {
    if (!(dot(ray.wo, n) > 0)) continue;
    if (!is_mirrored(n, wi, ray.wo)) return {};
    sum = sum + ray.weight;
  }
  return sum;
}

std::unique_ptr<const FlatMirrors> FlatMirrors::make(const Scene& scene) {
  std::unique_ptr<FlatMirrors> result(new FlatMirrors(scene));
  std::vector<Mirror>& mirrors = result->mirrors_;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) result->add_shape(ShapeId(s), mirrors);
  if (mirrors.empty()) return nullptr;
  std::stable_sort(mirrors.begin(), mirrors.end(), [](const Mirror& a, const Mirror& b) {
    return a.area * std::max(a.share, a.passes) > b.area * std::max(b.share, b.passes);
  });
  if (mirrors.size() > kMost) {
    result->left_out_ = mirrors.size() - kMost;
    mirrors.erase(mirrors.begin() + kMost, mirrors.end());
  }
  const auto count = static_cast<uint32_t>(mirrors.size());
  for (uint32_t a = 0; a < count; ++a) result->chains_.push_back({{a, 0}, 1});
  for (uint32_t a = 0; a < count; ++a) {
    for (uint32_t b = 0; b < count; ++b) {
      if (a != b) result->chains_.push_back({{a, b}, 2});
    }
  }
  for (uint32_t a = 0; a < count; ++a) {
    if (mirrors[a].passes > 0) result->panes_.push_back({{a, 0}, 1, true});
  }
  for (uint32_t a = 0; a < count; ++a) {
    for (uint32_t b = 0; b < count; ++b) {
      const bool parallel =
          length(cross(value(mirrors[a].plane.n), value(mirrors[b].plane.n))) <= kFlat;
      if (a != b && parallel && mirrors[a].passes > 0 && mirrors[b].passes > 0)
        result->panes_.push_back({{a, b}, 2, true});
    }
  }
  return result;
}

bool FlatMirrors::has(const Chain& chain) const {
  const auto& of = chain.through ? panes_ : chains_;
  return std::find(of.begin(), of.end(), chain) != of.end();
}

double FlatMirrors::refraction(uint32_t mirror, bool front) const {
  return refraction_of(scene_.shape(mirrors_[mirror].faces[0].shape), front).index;
}

void FlatMirrors::add_shape(ShapeId id, std::vector<Mirror>& found) const {
  const Shape& shape = scene_.shape(id);
  const double share =
      std::max(luminance(reflectance(shape, true)), luminance(reflectance(shape, false)));
  const double passes =
      std::max(refraction_of(shape, true).share, refraction_of(shape, false).share);
  if (!(share > 0 || passes > 0)) return;
  const Scale scale(shape.mesh);
  const size_t first = found.size();
  for (uint32_t f = 0; f < shape.mesh.faces.size(); ++f) {
    const auto corners = face_corners<Dual>(shape.mesh, FaceId(f));
    const Vec3d area = value(cross(corners[1] - corners[0], corners[2] - corners[0]));
    if (!(length(area) > 0) || !is_flat(shape.mesh, FaceId(f), normalize(area))) continue;
    const auto lies_in = [&](const Mirror& mirror) {
      return dot(value(mirror.plane.n), area) > 0 &&
             std::all_of(corners.begin(), corners.end(),
                         [&](const auto& x) { return scale.holds(mirror.plane, x); });
    };
    auto mirror =
        std::find_if(found.begin() + static_cast<std::ptrdiff_t>(first), found.end(), lies_in);
    if (mirror == found.end())
      mirror =
          found.insert(mirror, {MirrorPlane<Dual>::through(corners), {}, {}, 0, share, passes});
    mirror->faces.push_back({id, FaceId(f)});
    const Vec3d middle = value(corners[0] + corners[1] + corners[2]) / 3.0;
    const double size = 0.5 * length(area);
    mirror->center = mirror->center + (middle - mirror->center) * (size / (mirror->area + size));
    mirror->area += size;
  }
}

uint32_t FlatMirrors::of(FaceRef face) const {
  for (uint32_t m = 0; m < mirrors_.size(); ++m) {
    const std::vector<FaceRef>& faces = mirrors_[m].faces;
    if (faces[0].shape != face.shape) continue;
    const auto at = std::lower_bound(faces.begin(), faces.end(), face, [](FaceRef a, FaceRef b) {
      return a.face.index() < b.face.index();
    });
    if (at != faces.end() && *at == face) return m;
  }
  return kNone;
}

MirrorPlane<double> FlatMirrors::plane(uint32_t mirror) const {
  const FaceRef face = mirrors_[mirror].faces[0];
  return MirrorPlane<double>::through(
      face_corners<double>(scene_.shape(face.shape).mesh, face.face));
}

bool FlatMirrors::reflects_to(uint32_t mirror, const Vec3d& p) const {
  const Shape& shape = scene_.shape(mirrors_[mirror].faces[0].shape);
  return luminance(reflectance(shape, plane(mirror).distance(p) > 0)) > 0;
}

Camera image_of(const Camera& camera, const MirrorPlane<Dual>& plane) {
  Camera image = camera;
  image.origin = plane.image(camera.origin);
  image.left = plane.turned(camera.left);
  image.up = plane.turned(camera.up);
  image.forward = plane.turned(camera.forward);
  image.near_clip = 0;
  image.far_clip = std::numeric_limits<double>::infinity();
  return image;
}

Vec3d direction_through(std::span<const FlatLayer> layers, const Vec3d& n, const Vec3d& way) {
  const Vec3d across = way - n * dot(n, way);
  const double distance = length(across);
  if (distance == 0) return n;
  double least = layers[0].index;
  for (const FlatLayer& layer : layers) least = std::min(least, layer.index);
  // tan(theta_j) is k u / root, k = least / n_j and root^2 = 1 + (1 - k^2) u^2.
  const auto root = [](double k, double u) { return std::sqrt(1 + (1 - k * k) * u * u); };
  double u = 0;
  constexpr int kMostSteps = 200;  // some ten are taken
  for (int i = 0; i < kMostSteps; ++i) {
    double missing = distance, slope = 0;
    for (const FlatLayer& layer : layers) {
      const double k = least / layer.index, r = root(k, u);
      missing -= layer.height * k * u / r;
      slope += layer.height * k / (r * r * r);
    }
    const double next = u + missing / slope;
    if (!(next > u)) break;  // to rounding
    u = next;
  }
  const double k = least / layers[0].index;
  return normalize(n + across * (k * u / (root(k, u) * distance)));
}

}  // namespace limn
