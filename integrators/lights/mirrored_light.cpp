// Where flat glossy surfaces mirror emitters and the bright patches of an environment.
#include "integrators/lights/mirrored_light.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "limn/core/bounds.h"

namespace limn {
namespace {

// None of these is tuned.
constexpr double kWidest = 0.35;   // of a lobe that is worth it [rad]
constexpr double kFlat = 0x1p-16;  // how far a plane's points may lie off, over the mesh's size
// Of the light over the plane: the sine of its elevation, or its height over the flat part's
// radius.
constexpr double kLeastHeight = 1e-3;
// What is seen of surfaces in the light of emitters, over what these send to the mean one without
// what hides them. What stands in the light is more in view than the mean: with 0.5 edges of a
// teapot under two emitters on gloss were listed where it does not pay, and the squared error times
// time was 9 times as large (5 seeds; without the noisiest hundredth 1.6 times).
constexpr double kLit = 1.5;
// Of a shape, where what emitters send there is estimated; of few faces each has several.
constexpr size_t kPairs = 32;
constexpr double kApart = 0.1;  // two of a pair, over an edge
// What is rounding of a point in the plane, over the flat part's radius.
constexpr double kInPlane = 0x1p-20;
// Flat parts that get this share of the light of another are as bright as it.
constexpr double kAlike = 0.9;
// A flank's middle rises at most this far over the horizon [rad], the highlight's middle is at most
// so many times as far from it, and fainter flanks than this part of a highlight are not drawn.
constexpr double kMostRise = 0.5;
constexpr double kFarthest = 4;
constexpr double kLeastSeen = 1e-3;
// The least angle of a cone of directions [rad]: those within narrower ones are lost by rounding.
constexpr double kLeastCone = 1e-6;

// The least noise() of highlights that images draw. Fainter ones cost 10 to 50 % more time and made
// no image less noisy; those with twice as much are drawn in full, those between in part. It was up
// to .041 in six furnished rooms, .017 in the demo and .16 in scenes/sharp_shadow.xml, where
// drawing them takes away two thirds of the variance.
constexpr double kLeastNoise = 0.042;

// Any two unit vectors that are orthogonal to n and to each other.
std::array<Vec3d, 2> across(const Vec3d& n) {
  const Vec3d other = std::fabs(n.x) < 0.5 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  const Vec3d a = normalize(cross(n, other));
  return {a, cross(n, a)};
}

// Where a far light's highlight looks the same from, over the height of the point, the origin.
Vec3d start_of(const MirroredLight::Highlight& highlight) {
  return highlight.toward * ((1 - highlight.nearness) / -dot(highlight.toward, highlight.normal));
}

// The place in a flat part, a ball around this center, that a point sees brightest, about. shown:
// where a perfect mirror in its plane would show the light; foot: of the point on the plane. Half
// vectors of what lies between them are tilted towards or away from the light alone.
Vec3d place_in(const Vec3d& center, double radius, const Vec3d& shown, const Vec3d& foot) {
  if (length(shown - center) <= radius) return shown;
  const Vec3d line = shown - foot;
  const double square = length_squared(line);
  const double along = square > 0 ? dot(center - foot, line) / square : 0;
  const Vec3d x = foot + line * std::clamp(along, 0.0, 1.0), off = x - center;
  return length(off) <= radius ? x : center + normalize(off) * radius;
}

// As wide as the lobe of a mirror that shows light as wide as both sides of a plate do that passes
// it.
double passed_width(const Bsdf* bsdf) {
  if (!bsdf || !bsdf->lobes().below) return 1;
  const Vec3d n{0, 0, 1};
  const LobeSummary lobe = bsdf->passed_lobe(n, n, nullptr).lobe;
  return std::numbers::sqrt2 * bsdf->eta() * lobe.model->width(lobe);
}

// 1 - cos(angle).
double versine(double angle) {
  const double sine = std::sin(0.5 * angle);
  return 2 * sine * sine;
}

// Within which a light of that size is bright in a lobe: angles from its perfect mirror image
// [rad].
double spread_of(double lobe, double size) { return std::min(lobe + size, 0.5 * kPi); }

// The point k of the additive recurrence of the plastic number, in [0, 1)^2.
std::array<double, 2> spread_point(size_t k) {
  const auto n = static_cast<double>(k);
  return {std::fmod(0.5 + 0.7548776662466927 * n, 1), std::fmod(0.5 + 0.5698402909980532 * n, 1)};
}

// The share of light from that direction that a BSDF scatters to within the half-angle of the
// mirror direction. LobeSummary::albedo counts what a dielectric lets through, too.
double share_in_highlight(const Bsdf& bsdf, const Vec3d& n, const Vec3d& light, double half_angle) {
  const Vec3d mirrored = n * (2 * dot(light, n)) - light;
  double sum = 0;
  for (size_t k = 0; k < kPairs; ++k) {
    const auto [u1, u2] = spread_point(k);
    const std::optional<Vec3d> w = bsdf.sample(n, light, u1, u2);
    if (!w || dot(*w, mirrored) < std::cos(half_angle)) continue;
    const BsdfValue f = bsdf.eval_with_pdf(n, light, *w);
    if (f.pdf > 0) sum += luminance(f.value) / f.pdf;
  }
  return std::min(sum / kPairs, 1.0);
}

// For each shape that does not emit calls take() with the mean of a number for places on it, which
// gets two near places of a face: an emitter may hang just over one. Places move with the faces, so
// that the means are continuous in what moves these.
template <class Number, class Take>
void find_means(const Scene& scene, const Number& number, const Take& take) {
  for (const Shape& shape : scene.shapes) {
    const size_t faces = shape.mesh.faces.size();
    if (shape.is_emitter || faces == 0) continue;
    const size_t step = (faces + kPairs - 1) / kPairs, pairs = std::max<size_t>(1, kPairs / faces);
    double sum = 0;
    for (size_t f = 0; f < faces; f += step) {
      const auto corners = face_corners<double>(shape.mesh, FaceId(static_cast<uint32_t>(f)));
      const Vec3d edge = corners[1] - corners[0];
      for (size_t pair = 0; pair < pairs; ++pair) {
        auto [u, v] = spread_point(pair);
        if (u + v > 1) {
          u = 1 - u;
          v = 1 - v;
        }
        const Vec3d p = corners[0] + edge * u + (corners[2] - corners[0]) * v;
        sum += number(p, p + edge * kApart);
      }
    }
    take(sum / static_cast<double>((faces + step - 1) / step * pairs));
  }
}

}  // namespace

// Faces in one plane.
struct MirroredLight::FlatPart {
  ShapeId shape;
  Vec3d point, normal;
  Bounds bounds;
  std::bitset<kMostFaces> faces;
};

std::vector<MirroredLight::FlatPart> MirroredLight::flat_parts(const Mesh& mesh, ShapeId shape) {
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
      parts.push_back({shape, corners[0], n / twice, {}, {}});
      part = parts.end() - 1;
    }
    part->faces.set(f);
    for (const Vec3d& p : corners) part->bounds.extend(p);
  }
  return parts;
}

std::unique_ptr<MirroredLight> MirroredLight::make(const Scene& scene, const Lights& lights,
                                                   Use use) {
  const auto narrow = [](const Bsdf* bsdf) {
    return bsdf && bsdf->lobe().model->width(bsdf->lobe()) < kWidest;
  };
  const auto may_show = [&](const Shape& shape) {
    return shape.mesh.faces.size() <= kMostFaces &&  // others have no flat_parts()
           (narrow(shape.bsdf->side(true)) || narrow(shape.bsdf->side(false)) ||
            passed_width(shape.bsdf->side(true)) < kWidest);
  };
  if (scene.max_depth == 1 || scene.max_depth == 2 ||
      std::none_of(scene.shapes.begin(), scene.shapes.end(), may_show)) {
    return nullptr;
  }
  std::unique_ptr<MirroredLight> result(new MirroredLight(scene, lights));
  const std::vector<Image> sources = result->find_lights(scene);
  if (sources.empty()) return nullptr;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    if (!may_show(shape)) continue;
    const std::vector<FlatPart> parts = flat_parts(shape.mesh, ShapeId(s));
    for (const FlatPart& part : parts) {
      for (const bool front : {true, false}) {
        const Bsdf* bsdf = shape.bsdf->side(front);
        if (!narrow(bsdf)) continue;
        for (const Image& source : sources) {
          result->add(part, *bsdf, front ? part.normal : -part.normal, source);
        }
      }
      const auto is_opposite = [&](const FlatPart& other) {
        return dot(other.normal, part.normal) < kFlat - 1;
      };
      const Bsdf* bsdf = shape.bsdf->side(true);
      if (passed_width(bsdf) < kWidest && std::ranges::any_of(parts, is_opposite)) {
        for (Image source : sources) {  // where a mirror would show its mirror image
          const Vec3d& n = part.normal;
          const Vec3d to = source.infinite ? source.light : source.light - part.bounds.center();
          source.light = source.light - n * (2 * dot(to, n));
          source.width = passed_width(bsdf);
          source.passed_cone = 4 * source.width;
          result->add(part, *bsdf, n, source);
        }
      }
    }
  }
  if (use == Use::kImage) {
    for (Image& image : result->images_) {
      image.weight = std::clamp(result->noise(image) / kLeastNoise - 1, 0.0, 1.0);
    }
    std::erase_if(result->images_, [](const Image& image) { return image.weight == 0; });
  }
  if (result->images_.empty()) return nullptr;
  return result;
}

// All that is small and bright, in no surface yet; sets what else is seen.
std::vector<MirroredLight::Image> MirroredLight::find_lights(const Scene& scene) {
  std::vector<Image> found;
  std::vector<size_t> emitters;
  const auto add_emitter = [&](size_t number, bool infinite, const Vec3d& light, double size) {
    Image& image = found.emplace_back();
    image.infinite = infinite;
    image.light = light;
    image.size = size;
    image.emitter = number;
    emitters.push_back(number);
  };
  size_t number = 0;
  for (const Shape& shape : scene.shapes) {
    if (!shape.is_emitter) continue;
    Bounds bounds;
    double squared = 0;
    for (const Vec3f& x : shape.mesh.positions) bounds.extend(cast<double>(x));
    for (const Vec3f& x : shape.mesh.positions) {
      squared = std::max(squared, length_squared(cast<double>(x) - bounds.center()));
    }
    add_emitter(number++, false, bounds.center(), std::sqrt(squared));
  }
  if (scene.environment) ++number;
  for (const auto& delta : scene.delta_lights) {
    const LightOrigin origin = delta->origin();
    add_emitter(number++, origin.infinite, origin.infinite ? -value(origin.v) : value(origin.v), 0);
  }
  const auto irradiance = [&](const Vec3d& p, const Vec3d& q) {
    double sum = 0;
    for (const size_t e : emitters) sum += std::min(lights_.estimate(e, p), lights_.estimate(e, q));
    return sum;
  };
  double sum = 0;
  size_t shapes = 0;  // a wide ground counts no more than what stands on it
  find_means(scene, irradiance, [&](double mean) {
    sum += mean;
    ++shapes;
  });
  lit_ = shapes > 0 ? kLit / kPi * sum / static_cast<double>(shapes) : 0;
  if (!scene.environment) return found;
  environment_ = scene.environment->mean_luminance();
  for (const BrightPatch& patch : find_bright_patches(*scene.environment)) {
    if (patch.is_ring()) continue;  // its middle is dark
    Image& image = found.emplace_back();
    image.infinite = true;
    image.light = patch.cap.axis;
    image.size = patch.cap.sine;
    const double rise = patch.cap.sine * patch.cap.sine / (1 + patch.cap.cosine);
    image.irradiance = patch.luminance * 2 * kPi * rise;
  }
  return found;
}

// The variance with which paths find the highlight by the scattering of diffuse surfaces alone,
// over the square of what else these see: of the shape with the most, hidden or not.
double MirroredLight::noise(const Image& image) const {
  const auto at = [&](const Vec3d& p, const Vec3d&) {
    Highlight highlight;
    if (!sees(image, p, highlight)) return 0.0;
    const double of_emitter = image.emitter ? kScattered / kPi * highlight.irradiance : 0;
    const double elsewhere = environment_ + std::max(lit_, of_emitter);
    const double ratio = highlight.irradiance / (kPi * elsewhere);
    const double cone = highlight.cone > 0 ? highlight.cone : versine(highlight.half_angle);
    return ratio * ratio / (2 * cone);
  };
  double most = 0;
  find_means(scene_, at, [&](double mean) { most = std::max(most, mean); });
  return most;
}

// Keeps those that mirror the most light; of what is about alike the first. Neither the choice nor
// the order may hang on small differences: with the same numbers images of nearly the same scene
// are to draw directions of the same emitters.
void MirroredLight::add(const FlatPart& part, const Bsdf& bsdf, const Vec3d& normal,
                        const Image& source) {
  Image image = source;
  image.shape = part.shape;
  image.faces = part.faces;
  image.bsdf = &bsdf;
  image.normal = normal;
  image.center = part.bounds.center();
  image.radius = 0.5 * part.bounds.diagonal();
  const Vec3d to = image.infinite ? image.light : image.light - image.center;
  const double height = dot(to, normal);
  if (!(height > kLeastHeight * (image.infinite ? 1 : image.radius))) return;
  if (image.passed_cone > 0) {
    image.albedo = std::min(bsdf.lobe().albedo, 1.0);
  } else {
    image.width = bsdf.lobe().model->width(bsdf.lobe());
    image.albedo =
        share_in_highlight(bsdf, normal, normalize(to), std::min(4 * image.width, 0.5 * kPi));
  }
  if (image.infinite) image.least_cosine = std::cos(spread_of(image.width, 0.5 * image.size));
  if (image.emitter) image.irradiance = lights_.estimate(*image.emitter, image.center);
  image.light_in_part = image.irradiance * height / length(to) * image.radius * image.radius;
  images_.push_back(image);
  if (images_.size() <= kMostImages) return;
  size_t least = images_.size() - 1;
  for (size_t i = least; i-- > 0;) {
    if (images_[i].light_in_part < kAlike * images_[least].light_in_part) least = i;
  }
  images_.erase(images_.begin() + static_cast<std::ptrdiff_t>(least));
}

// Whether p may see the image within the flat part. A near emitter's is that of a far one from a
// nearer point: where w meets the plane, the half vector turns with w as seen from p and as seen
// from the emitter, at the distances a and b, together as for a far light at the distance
// a b / (a + b).
bool MirroredLight::sees(const Image& image, const Vec3d& p, Highlight& highlight) const {
  const Vec3d& n = image.normal;
  const double height = dot(p - image.center, n);
  if (!(height > kInPlane * image.radius)) return false;
  const Vec3d foot = p - n * height;
  const Vec3d to = image.infinite ? image.light : image.light - foot;
  const double fall = image.infinite ? height / dot(to, n) : height / (height + dot(to, n));
  const Vec3d shown = foot + (to - n * dot(to, n)) * fall;
  const Vec3d x = place_in(image.center, image.radius, shown, foot);
  const double a = length(x - p), b = image.infinite ? 0 : length(image.light - x);
  highlight.toward = (x - p) / a;
  highlight.light = image.infinite ? image.light : (image.light - x) / b;
  highlight.nearness = image.infinite ? 1 : b / (a + b);
  // Of the light, as the angle that its mirror image has from p.
  const double size = image.infinite ? image.size : image.size / (a + b);
  // Nothing of it is bright where the half vector is tilted by more.
  const Vec3d half = highlight.light - highlight.toward;
  const double least = image.infinite
                           ? image.least_cosine
                           : std::cos(spread_of(image.width, 0.5 * size / highlight.nearness));
  if (dot(half, n) < least * length(half)) return false;
  // A half vector that turns turns what is mirrored twice as far.
  const double lobe = 2 * image.width * highlight.nearness;
  highlight.bsdf = image.bsdf;
  highlight.normal = n;
  highlight.depth = height + kFlat * image.radius;
  highlight.half_angle = 2 * lobe + size;
  // Where the light is wider than the lobe, its image is about as wide as the light.
  const double cone = spread_of(std::max(lobe, image.passed_cone * highlight.nearness), size);
  const bool even = image.passed_cone > 0 || lobe < 2 * size;
  highlight.cone = even ? versine(std::max(cone, kLeastCone)) : 0;
  if (highlight.cone > 0) highlight.toward = normalize(shown - p);
  highlight.irradiance = image.albedo * highlight.nearness * highlight.nearness *
                         (image.emitter ? lights_.estimate(*image.emitter, x) : image.irradiance);
  return true;
}

bool MirroredLight::turn_to_flank(Highlight& highlight, const Vec3d& n) {
  const double angle = std::min(0.5 * highlight.half_angle, kMostRise);
  const double sine = std::sin(angle), rise = sine - dot(n, highlight.toward);
  if (!(rise > 0 && rise < kFarthest * sine)) return false;
  const Vec3d toward = normalize(highlight.toward + n * rise);
  const double cone = versine(angle), seen = 2 * kPi * cone * pdf(highlight, toward);
  highlight.irradiance *= seen > kLeastSeen ? std::min(seen, 1.0) : 0;
  highlight.toward = toward;
  highlight.cone = cone;
  return true;
}

// The cosine of the half vector, as the microfacets have it that mirror the light, see pdf().
double MirroredLight::alignment(const Highlight& highlight, const Vec3d& w) {
  if (highlight.cone > 0) return dot(w, highlight.toward);
  const double cosine = -dot(w, highlight.normal);
  if (!(cosine > 0)) return -1;
  const Vec3d half = highlight.light + normalize(start_of(highlight) - w / cosine);
  return dot(half, highlight.normal) / length(half);
}

// From a point over the plane by `nearness` in place of 1 in the same line of sight, the light is
// scattered as that of a far one; then the solid angle is that at the point itself.
double MirroredLight::pdf(const Highlight& highlight, const Vec3d& w) {
  if (highlight.cone > 0) {
    return length_squared(w - highlight.toward) <= 2 * highlight.cone
               ? 1 / (2 * kPi * highlight.cone)
               : 0;
  }
  const double cosine = -dot(w, highlight.normal);
  if (!(cosine > 0)) return 0;
  const Vec3d x = w / cosine, from = start_of(highlight), d = x - from;
  const double l = length(d), ratio = 1 / (cosine * l);
  return highlight.nearness * ratio * ratio * ratio *
         highlight.bsdf->pdf_solid_angle(highlight.normal, highlight.light, d / -l);
}

double MirroredLight::pdf(const Mixture& mixture, const Vec3d& w, double scattered) {
  if (mixture.share == 0) return scattered;
  double sum = 0;
  for (int i = 0; i < mixture.count; ++i) sum += mixture.part[i] * pdf(mixture.highlight(i), w);
  return mixture.rough * mixture.share * sum + (1 - mixture.share) * scattered;
}

std::optional<Vec3d> MirroredLight::sample(const Mixture& mixture, double u, double u1, double u2) {
  int i = 0;
  while (i + 1 < mixture.count && u >= mixture.part[i]) u -= mixture.part[i++];
  const Highlight& highlight = mixture.highlight(i);
  if (highlight.cone > 0) {
    const double rise = u1 * highlight.cone, sine = std::sqrt(rise * (2 - rise));
    const auto [a, b] = across(highlight.toward);
    return highlight.toward * (1 - rise) + a * (sine * std::cos(2 * kPi * u2)) +
           b * (sine * std::sin(2 * kPi * u2));
  }
  const auto scattered = highlight.bsdf->sample(highlight.normal, highlight.light, u1, u2);
  if (!scattered) return {};
  const double height = dot(*scattered, highlight.normal);
  if (!(height > 0)) return {};
  return normalize(start_of(highlight) - *scattered * (highlight.nearness / height));
}

}  // namespace limn
