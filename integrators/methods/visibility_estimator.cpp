// The points of a pixel and what is seen from there, by lines or by rays.
#include "integrators/methods/visibility_estimator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "integrators/lights/direct_light_check.h"
#include "integrators/paths/camera_path.h"
#include "limn/core/error.h"
#include "limn/integrators/methods.h"

namespace limn {
namespace {

// By lines: points of the film for emitters for one for the sky, where there are both. Lines
// through the sky take the time of some tens of those through emitters, while most of what is left
// to the film is the rims of shadows of emitters. Not tuned.
constexpr int kEmitterPoints = 16;

// The scene, if its camera is one that this looks through: InputError for others.
const Scene& with_pinhole(const Scene& scene, const RenderOptions& options) {
  if (!scene.camera.is_pinhole()) {
    throw InputError({scene.file},
                     fmt::format("the method \"{}\" needs a pinhole, a sensor of type "
                                 "\"perspective\" (\"path\" takes every sensor)",
                                 options.method.name()));
  }
  return scene;
}

void check_doubling(const RenderOptions& options) {
  if (options.tolerance > 0 && 2 * options.lines > kMostLines) {
    throw InputError(
        fmt::format("tolerance: {} lines can not be doubled (there are {} at most): "
                    "start with fewer",
                    options.lines, kMostLines));
  }
}

}  // namespace

VisibilityEstimator::VisibilityEstimator(const Scene& scene, const RunSettings& settings,
                                         const RenderOptions& options)
    : scene_(with_pinhole(scene, options)),
      tracer_(make_embree_tracer(scene, settings.threads)),
      seed_(settings.seed),
      options_(options),
      camera_(scene.camera),
      filter_(scene.film.filter) {
  const bool direct = options.what == RenderWhat::kImage;
  const ImageMethod& method = *options.method->image;
  if (method.by_lines) check_doubling(options);
  if (method.by_lines) {
    const LineOptions lines{options.lines, options.tolerance, method.uniform_lines,
                            options.method.name()};
    lines_ = std::make_unique<LineLight>(scene, *tracer_, settings.threads, lines, direct);
  } else if (direct) {
    check_direct_light(scene, options.method.name());
  }
  if (direct) add_emitters();
  looks_ = looks();
}

std::vector<VisibilityEstimator::Look> VisibilityEstimator::looks() const {
  if (!lines_) return {{Source::kAll, 1}};
  if (options_.what != RenderWhat::kImage || emitters_.empty()) return {{Source::kSky, 1}};
  if (!scene_.environment) return {{Source::kEmitters, 1}};
  return {{Source::kEmitters, kEmitterPoints}, {Source::kSky, 1}};
}

void VisibilityEstimator::add_emitters() {
  for (uint32_t s = 0; s < scene_.shapes.size(); ++s) {
    const Shape& shape = scene_.shapes[s];
    if (!shape.is_emitter) continue;
    RayEmitter& emitter = emitters_.emplace_back();
    emitter.shape = ShapeId(s);
    double sum = 0;
    for (uint32_t f = 0; f < shape.mesh.faces.size(); ++f) {
      const auto c = face_corners<double>(shape.mesh, FaceId(f));
      sum += 0.5 * length(cross(c[1] - c[0], c[2] - c[0]));
      emitter.areas.push_back(sum);
    }
  }
}

void VisibilityEstimator::add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const {
  RayCount rays;
  for (const KeyedSample& one : samples) {
    Rgb<double> radiance;
    bool failed = false;
    try {
      radiance = sample(one.at, sink.log(), rays);
    } catch (const UntraceableRay&) {
      failed = true;
    }
    if (!failed && is_finite(radiance)) {
      sink.add_radiance(one.at, radiance, 1);
    } else {
      sink.reject(one.at, slot_name(0));
    }
  }
  sink.cost(0).add(rays);
  sink.cost(0).samples += samples.size();
}

Rgb<double> VisibilityEstimator::sample(const PixelSample& at, SampleLog* log, RayCount& rays,
                                        SkyRecord* record, double weight) const {
  Rgb<double> all;
  for (size_t i = 0; i < looks_.size(); ++i) {
    const auto& [source, points] = looks_[i];
    const double share = 1.0 / points;
    Rgb<double> sum;
    for (int k = 0; k < points; ++k) {
      const uint64_t number = at.s * points + k;
      Point point{at, source, number, i == 0, record, share};
      const double own = pixel_filter_weight(scene_.film, filter_, at.x, at.y, even(point, number));
      point.weight *= own * weight;
      sum += film_point(point, log, rays) * own;
    }
    all += sum * share;
  }
  return all;
}

Rgb<double> VisibilityEstimator::record(const PixelSample& at, double weight,
                                        SkyRecord& record) const {
  RayCount rays;
  return sample(at, nullptr, rays, &record, weight);
}

Rng VisibilityEstimator::even(const Point& point, uint64_t number) const {
  const PixelSample& at = point.at;
  const uint64_t pixel = static_cast<uint64_t>(at.y) << 32 | static_cast<uint32_t>(at.x);
  // Beyond 2^32 points another scrambling starts.
  const uint64_t stream = (number >> 32) * 4 + static_cast<uint64_t>(point.source);
  return Rng::even(mix_bits(seed_) + stream, pixel, static_cast<uint32_t>(number));
}

Rgb<double> VisibilityEstimator::film_point(const Point& point, SampleLog* log,
                                            RayCount& rays) const {
  const FilmPosition film =
      sample_pixel_filter(scene_.film, filter_, point.at.x, point.at.y, even(point, point.number));
  const auto start = camera_.ray(film.x, film.y);
  const Vec3d origin = start.origin, direction = start.direction;
  const bool image = options_.what == RenderWhat::kImage;
  Hit hit;
  ++rays.closest;
  if (!tracer_->closest(camera_ray(scene_, start), hit)) {
    if (!image) return grey(1.0);
    const bool sky = scene_.environment && !scene_.hide_emitters && point.shows;
    if (sky && point.record) point.record->add_view(direction, point.weight);
    return sky && !point.record ? scene_.environment->radiance(direction) : Rgb<double>{};
  }
  const auto surface = surface_on_ray<double>(scene_, hit.face, origin, direction);
  const Scattering<double> scattering(surface, -direction, scene_.shading);
  const bool front = dot(surface.n_g, direction) < 0;
  const Vec3d n_s = front ? surface.n_s : -surface.n_s;
  const Vec3d n_g = front ? surface.n_g : -surface.n_g;
  const Seen seen{point, surface, surface.lifted ? n_s : n_g, n_s, scattering, rays};
  if (log) {
    log->push_back(fmt::format("film {:.6f} {:.6f}: a point at ({:.9g}, {:.9g}, {:.9g}), {}",
                               film.x, film.y, surface.p.x, surface.p.y, surface.p.z,
                               lines_ ? "by lines" : "by rays"));
  }
  Rgb<double> sum;
  if (image) {
    if (point.shows) sum = surface.emission(-direction, scene_.shading);
    if (scattering.black()) return sum;
  }
  return sum + (lines_ ? by_lines(seen) : by_rays(seen));
}

Rgb<double> VisibilityEstimator::by_lines(const Seen& seen) const {
  const Point& point = seen.point;
  const double offset = even(point, point.number).at(Purpose::kDirect, 0).uniform();
  if (options_.what == RenderWhat::kImage) {
    Rgb<double> sum;
    if (point.has(Source::kEmitters)) {
      sum = lines_->emitters(seen.surface, seen.scattering, offset);
    }
    if (point.has(Source::kSky)) {
      if (point.record) {
        lines_->record(seen.surface, seen.scattering, offset, point.weight, *point.record);
      } else {
        sum += lines_->environment(seen.surface, seen.scattering, offset);
      }
    }
    return sum;
  }
  const ContourPoint at = lines_->at(seen.surface, seen.up);
  return grey(options_.what == RenderWhat::kOpenness
                  ? lines_->openness(at, offset)
                  : lines_->ambient_occlusion(at, seen.n, offset));
}

Rgb<double> VisibilityEstimator::by_rays(const Seen& seen) const {
  const int count = options_.rays;
  const bool looks_up = options_.what != RenderWhat::kImage || scene_.environment;
  Rgb<double> sum;
  for (int k = 0; k < count; ++k) {
    const Rng key = even(seen.point, seen.point.number * count + k);
    // The sky and every emitter have points of their own.
    for (size_t i = looks_up ? 0 : 1; i <= emitters_.size(); ++i) {
      Rng rng = key.at(Purpose::kEmitter, i);
      const double u1 = rng.uniform(), u2 = rng.uniform();
      sum += i == 0 ? sky_ray(seen, u1, u2) : emitter_ray(emitters_[i - 1], seen, u1, u2);
    }
  }
  return sum * (1.0 / count);
}

bool VisibilityEstimator::is_open(const Seen& seen, const Vec3d& direction) const {
  if (!(dot(seen.up, direction) > 0)) return false;
  Ray ray{seen.surface.p, direction};
  ray.start = seen.surface.start();
  ++seen.rays.shadow;
  return !tracer_->occluded(ray);
}

// Uniform over the half sphere for openness, by the cosine for the rest, but for maps, by which
// they go themselves.
Rgb<double> VisibilityEstimator::sky_ray(const Seen& seen, double u1, double u2) const {
  const double phi = 2 * kPi * u2;
  const auto around = [&](const Vec3d& n, double z) {
    const double r = std::sqrt(std::fmax(0.0, 1 - z * z));
    return Frame(n).to_world({r * std::cos(phi), r * std::sin(phi), z});
  };
  if (options_.what == RenderWhat::kOpenness) {
    return grey(is_open(seen, around(seen.up, u1)) ? 1.0 : 0.0);
  }
  if (options_.what == RenderWhat::kAmbientOcclusion) {
    return grey(is_open(seen, around(seen.n, std::sqrt(u1))) ? 1.0 : 0.0);
  }
  const Environment& sky = *scene_.environment;
  Vec3d direction;
  double pdf;
  if (sky.is_uniform()) {
    const double z = std::sqrt(u1);
    direction = around(seen.scattering.normal(), z);
    pdf = z / kPi;
  } else {
    const auto drawn = sky.sample_direction(u1, u2);
    direction = drawn.direction;
    pdf = drawn.pdf;
  }
  if (!(pdf > 0)) return {};
  const Rgb<double> f = seen.scattering.eval(direction);
  if (is_black(f) || !is_open(seen, direction)) return {};
  return f * sky.radiance(direction) * (1 / pdf);
}

// Uniform over the emitter's area.
Rgb<double> VisibilityEstimator::emitter_ray(const RayEmitter& emitter, const Seen& seen, double u1,
                                             double u2) const {
  const Shape& shape = scene_.shape(emitter.shape);
  const double total = emitter.areas.back(), place = u1 * total;
  const auto above = std::upper_bound(emitter.areas.begin(), emitter.areas.end() - 1, place);
  const auto index = static_cast<uint32_t>(above - emitter.areas.begin());
  const double first = index > 0 ? emitter.areas[index - 1] : 0;
  const double u = (place - first) / (emitter.areas[index] - first);
  const FaceId face(index);
  const auto c = face_corners<double>(shape.mesh, face);
  const double root = std::sqrt(u);
  const Vec3d y = c[0] + (c[1] - c[0]) * (1 - root) + (c[2] - c[0]) * (root * u2);
  const Vec3d to = y - seen.surface.p;
  const double distance = length(to);
  if (distance == 0) return {};
  const Vec3d direction = to / distance;
  const double cosine = -dot(normalize(cross(c[1] - c[0], c[2] - c[0])), direction);
  if (!(cosine > 0) || !(dot(seen.up, direction) > 0)) return {};
  const Rgb<double> f = seen.scattering.eval(direction);
  if (is_black(f)) return {};
  Ray ray{seen.surface.p, direction};
  ray.start = seen.surface.start();
  ray.end = {emitter.shape, face};
  ray.t_max = distance * (1 - 0x1p-20);
  ++seen.rays.shadow;
  if (tracer_->occluded(ray)) return {};
  return f * value(shape.radiance) * (cosine * total / (distance * distance));
}

}  // namespace limn
