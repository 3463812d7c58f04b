// Where flat glossy surfaces mirror the bright patches of an environment.
#include "integrators/terms/mirrored_light.h"

#include <algorithm>
#include <cmath>

#include "limn/core/bounds.h"

namespace limn {
namespace {

// None of these is tuned.
constexpr double kWidest = 0.35;       // of a lobe that is worth it [rad]
constexpr size_t kMostFaces = 256;     // of a mesh that is looked through for flat parts
constexpr double kFlat = 0x1p-16;      // how far a plane's points may lie off, over the mesh's size
constexpr double kLeastHeight = 1e-3;  // of the light over the plane: the sine of its elevation
// What is rounding of a point in the plane, over the flat part's radius.
constexpr double kInPlane = 0x1p-20;

// Any two unit vectors that are orthogonal to n and to each other.
std::array<Vec3d, 2> across(const Vec3d& n) {
  const Vec3d other = std::fabs(n.x) < 0.5 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  const Vec3d a = normalize(cross(n, other));
  return {a, cross(n, a)};
}

}  // namespace

// Faces in one plane.
struct MirroredLight::FlatPart {
  Vec3d point, normal;
  Bounds bounds;
};

std::vector<MirroredLight::FlatPart> MirroredLight::flat_parts(const Mesh& mesh) {
  std::vector<FlatPart> parts;
  if (mesh.faces.size() > kMostFaces) return parts;
  Bounds all;
  for (const Vec3f& p : mesh.positions) all.extend(cast<double>(p));
  const double off = kFlat * length(all.upper - all.lower);
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const auto corners = face_corners<double>(mesh, FaceId(f));
    const Vec3d n = cross(corners[1] - corners[0], corners[2] - corners[0]);
    const double twice = length(n);
    if (!(twice > 0)) continue;
    const auto lies_in = [&](const FlatPart& part) {
      return dot(part.normal, n) > 0 &&
             std::all_of(corners.begin(), corners.end(), [&](const Vec3d& p) {
               return std::fabs(dot(p - part.point, part.normal)) <= off;
             });
    };
    auto part = std::find_if(parts.begin(), parts.end(), lies_in);
    if (part == parts.end()) {
      parts.push_back({corners[0], n / twice, {}});
      part = parts.end() - 1;
    }
    for (const Vec3d& p : corners) part->bounds.extend(p);
  }
  return parts;
}

std::unique_ptr<MirroredLight> MirroredLight::make(const Scene& scene) {
  const auto narrow = [](const Bsdf* bsdf) {
    return bsdf && bsdf->lobe().model->width(bsdf->lobe()) < kWidest;
  };
  const auto may_mirror = [&](const Shape& shape) {
    return narrow(shape.bsdf->side(true)) || narrow(shape.bsdf->side(false));
  };
  if (!scene.environment || scene.max_depth == 1 || scene.max_depth == 2 ||
      std::none_of(scene.shapes.begin(), scene.shapes.end(), may_mirror)) {
    return nullptr;
  }
  const std::vector<BrightPatch> patches = find_bright_patches(*scene.environment);
  if (patches.empty()) return nullptr;
  std::unique_ptr<MirroredLight> result(new MirroredLight);
  result->mean_ = scene.environment->mean_luminance();
  for (const Shape& shape : scene.shapes) {
    if (!may_mirror(shape)) continue;
    for (const FlatPart& part : flat_parts(shape.mesh)) {
      for (const bool front : {true, false}) {
        const Bsdf* bsdf = shape.bsdf->side(front);
        if (!narrow(bsdf)) continue;
        for (const BrightPatch& patch : patches) {
          result->add(part, *bsdf, front ? part.normal : -part.normal, patch);
        }
      }
    }
  }
  if (result->images_.empty()) return nullptr;
  return result;
}

// Keeps those that mirror the most light.
void MirroredLight::add(const FlatPart& part, const Bsdf& bsdf, const Vec3d& normal,
                        const BrightPatch& patch) {
  const Vec3d light = patch.cap.axis;
  const double height = dot(light, normal);
  if (!(height > kLeastHeight)) return;
  const LobeSummary lobe = bsdf.lobe();
  const double patch_angle = std::asin(patch.cap.sine);
  const double half_width = lobe.model->width(lobe);
  // A half vector that turns turns what is mirrored twice as far.
  const double spread = std::min(2 * half_width + patch_angle, 0.5 * kPi);
  Image image{&bsdf, normal, light, light - normal * (2 * height), {}, {}, 0, 0, 2};
  image.center = part.bounds.center();
  image.radius = 0.5 * length(part.bounds.upper - part.bounds.lower);
  image.irradiance =
      patch.luminance * 2 * kPi * (1 - patch.cap.cosine) * std::min(lobe.albedo, 1.0);
  const double elevation = std::min(std::asin(std::min(height, 1.0)) + spread, 0.5 * kPi);
  const Vec3d along = image.toward + normal * height;
  const double length_along = length(along);
  image.nearest = length_along > 0
                      ? along * (std::cos(elevation) / length_along) - normal * std::sin(elevation)
                      : -normal;
  // Where the light is wider than the lobe, its image is about as wide as the light.
  if (half_width < patch_angle) image.cone = std::cos(spread);
  images_.push_back(image);
  const auto mirrors = [](const Image& i) {
    return i.irradiance * dot(i.light, i.normal) * i.radius * i.radius;
  };
  std::stable_sort(images_.begin(), images_.end(),
                   [&](const Image& a, const Image& b) { return mirrors(a) > mirrors(b); });
  if (images_.size() > kMostImages) images_.pop_back();
}

// Whether p may see the image within the flat part.
bool MirroredLight::reaches(const Image& image, const Vec3d& p) {
  const double height = dot(p - image.center, image.normal);
  if (!(height > kInPlane * image.radius)) return false;
  const auto meets = [&](const Vec3d& w) {
    const Vec3d hit = p + w * (height / -dot(w, image.normal));
    return length(hit - image.center) <= image.radius;
  };
  return meets(image.toward) || meets(image.nearest);
}

double MirroredLight::pdf(const Image& image, const Vec3d& w) {
  if (image.cone <= 1) {
    return dot(w, image.toward) >= image.cone ? 1 / (2 * kPi * (1 - image.cone)) : 0;
  }
  return dot(w, image.normal) < 0 ? image.bsdf->pdf_solid_angle(image.normal, image.light, -w) : 0;
}

double MirroredLight::pdf(const Mixture& mixture, const Vec3d& w, double scattered) const {
  if (mixture.share == 0) return scattered;
  double sum = 0;
  for (int i = 0; i < mixture.count; ++i) {
    sum += mixture.part[i] * pdf(images_[mixture.image[i]], w);
  }
  return mixture.share * sum + (1 - mixture.share) * scattered;
}

std::optional<Vec3d> MirroredLight::sample(const Mixture& mixture, double u, double u1,
                                           double u2) const {
  int i = 0;
  while (i + 1 < mixture.count && u >= mixture.part[i]) u -= mixture.part[i++];
  const Image& image = images_[mixture.image[i]];
  if (image.cone <= 1) {
    const double cosine = 1 - u1 * (1 - image.cone);
    const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
    const auto [a, b] = across(image.toward);
    return image.toward * cosine + a * (sine * std::cos(2 * kPi * u2)) +
           b * (sine * std::sin(2 * kPi * u2));
  }
  const auto scattered = image.bsdf->sample(image.normal, image.light, u1, u2);
  return scattered ? std::optional(-*scattered) : std::nullopt;
}

}  // namespace limn
