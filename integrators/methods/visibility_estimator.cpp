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

// By lines alone: points of the film for emitters for one for the sky, where there are both. Lines
// through the sky take the time of some tens of those through emitters, while most of what is left
// to the film is the rims of shadows of emitters. Not tuned.
constexpr int kEmitterPoints = 16;
// What a pilot counts, in units of a ray (0.17 us): a point of the film besides its ray, and
// LineWork, as fitted to the times of the points of cad.xml, plant.xml, sun.xml, soft_shadow.xml
// and soft_lamp.xml; means over each of these come out within a quarter.
constexpr double kPointCost = 1.5, kListCost = 12, kArcCost = 0.7, kCrossingCost = 1.8,
                 kEvaluationCost = 0.45;
constexpr uint64_t kPilotSeed = 0x9170;

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
  const bool chooses = method.chooses && options.tolerance == 0;
  std::shared_ptr<const Environment> sky = scene.environment;
  if (chooses && direct && sky) split_ = split_environment(*sky, settings.threads);
  if (split_) sky = split_->rest;
  if (method.by_lines) {
    const LineOptions lines{options.lines, options.tolerance, method.uniform_lines,
                            options.method.name()};
    lines_ = std::make_unique<LineLight>(scene, *tracer_, settings.threads, lines, direct, sky);
  } else if (direct) {
    check_direct_light(scene, options.method.name());
  }
  if (direct) add_emitters();
  if (!chooses) {
    plan_ = fixed_plan(method.by_lines);
    return;
  }
  const std::vector<VisibilityPart> all = parts();
  plan_ = plan_visibility(
      scene.film, all, settings.threads, settings.interrupted,
      [&](const PixelSample& at, VisibilityPart part, int rays, uint64_t number, uint64_t replicate,
          double reach) {
        const uint64_t seed = mix_bits(seed_ + kPilotSeed);
        return probe({at, part, number, rays, part == all[0], seed, seed + replicate, reach});
      });
}

std::vector<VisibilityPart> VisibilityEstimator::parts() const {
  if (options_.what != RenderWhat::kImage) return {VisibilityPart::kSky};
  std::vector<VisibilityPart> parts;
  if (!emitters_.empty() || !scene_.environment) parts.push_back(VisibilityPart::kEmitters);
  if (split_) parts.push_back(VisibilityPart::kPatches);
  if (scene_.environment) parts.push_back(VisibilityPart::kSky);
  return parts;
}

VisibilityPlan VisibilityEstimator::fixed_plan(bool by_lines) const {
  VisibilityPlan plan;
  const Film& film = scene_.film;
  plan.grid.x0 = film.crop_x, plan.grid.y0 = film.crop_y;
  plan.grid.cell = std::max(film.crop_width, film.crop_height);
  if (!by_lines) {
    plan.parts = {VisibilityPart::kAll};
    plan.looks = {{options_.rays, 1}};
    return plan;
  }
  plan.parts = parts();
  plan.looks.assign(plan.parts.size(), {});
  if (plan.parts.size() > 1) plan.looks[0].points = kEmitterPoints;
  return plan;
}

std::vector<double> VisibilityEstimator::choice() const {
  std::vector<double> numbers;
  for (const VisibilityLook& look : plan_.looks) {
    numbers.insert(numbers.end(), {double(look.rays), double(look.points)});
  }
  return numbers;
}

VisibilityProbe VisibilityEstimator::probe(const Point& point) const {
  const LineWork before = LineLight::work();
  RayCount rays;
  VisibilityProbe result;
  const FilmPosition film = place(point);
  result.x = film.x, result.y = film.y;
  try {
    result.value = film_point(point, nullptr, rays);
  } catch (const UntraceableRay&) {
    // The run itself reports it.
  }
  const LineWork& after = LineLight::work();
  result.point_cost = kPointCost + static_cast<double>(rays.closest);
  result.cost = result.point_cost + static_cast<double>(rays.shadow) +
                kListCost * static_cast<double>(after.lists - before.lists) +
                kArcCost * static_cast<double>(after.arcs - before.arcs) +
                kCrossingCost * static_cast<double>(after.crossings - before.crossings) +
                kEvaluationCost * static_cast<double>(after.evaluations - before.evaluations);
  return result;
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

Rgb<double> VisibilityEstimator::sample(const PixelSample& at, SampleLog* log,
                                        RayCount& rays) const {
  Rgb<double> all;
  for (size_t i = 0; i < plan_.parts.size(); ++i) {
    const VisibilityLook& look = plan_.look(at.x, at.y, i);
    Rgb<double> sum;
    for (int k = 0; k < look.points; ++k) {
      const uint64_t number = at.s * look.points + k;
      sum += film_point({at, plan_.parts[i], number, look.rays, i == 0, seed_, seed_}, log, rays);
    }
    all += sum * (1.0 / look.points);
  }
  return all;
}

Rgb<double> VisibilityEstimator::record(const PixelSample& at, double weight,
                                        SkyRecord& record) const {
  RayCount rays;
  Rgb<double> all;
  for (size_t i = 0; i < plan_.parts.size(); ++i) {
    const double share = 1.0 / plan_.looks[i].points;
    for (int k = 0; k < plan_.looks[i].points; ++k) {
      const uint64_t number = at.s * plan_.looks[i].points + k;
      all += film_point(
                 {at, plan_.parts[i], number, 0, i == 0, seed_, seed_, 1, &record, weight * share},
                 nullptr, rays) *
             share;
    }
  }
  return all;
}

Rng VisibilityEstimator::even(const Point& point, uint64_t seed, uint64_t number) {
  const PixelSample& at = point.at;
  const uint64_t pixel = static_cast<uint64_t>(at.y) << 32 | static_cast<uint32_t>(at.x);
  // Beyond 2^32 points another scrambling starts.
  const uint64_t stream = (number >> 32) * 4 + static_cast<uint64_t>(point.part);
  return Rng::even(mix_bits(seed) + stream, pixel, static_cast<uint32_t>(number));
}

FilmPosition VisibilityEstimator::place(const Point& point) const {
  const double x = point.at.x + 0.5, y = point.at.y + 0.5;
  const FilmPosition whole = sample_pixel_filter(scene_.film, filter_, point.at.x, point.at.y,
                                                 even(point, point.seed, point.number));
  if (point.reach == 1) return whole;
  return {x + point.reach * (whole.x - x), y + point.reach * (whole.y - y)};
}

Rgb<double> VisibilityEstimator::film_point(const Point& point, SampleLog* log,
                                            RayCount& rays) const {
  const FilmPosition film = place(point);
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
                               point.rays > 0 ? "by rays" : "by lines"));
  }
  Rgb<double> sum;
  if (image) {
    if (point.shows) sum = surface.emission(-direction, scene_.shading);
    if (scattering.black()) return sum;
  }
  return sum + (point.rays > 0 ? by_rays(seen) : by_lines(seen));
}

Rgb<double> VisibilityEstimator::by_lines(const Seen& seen) const {
  const Point& point = seen.point;
  const double offset =
      even(point, point.seed_of_look, point.number).at(Purpose::kDirect, 0).uniform();
  if (options_.what == RenderWhat::kImage) {
    Rgb<double> sum;
    if (point.has(VisibilityPart::kEmitters)) {
      sum = lines_->emitters(seen.surface, seen.scattering, offset);
    }
    if (point.has(VisibilityPart::kSky)) {
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
  const Point& point = seen.point;
  const int count = point.rays;
  const Environment* sky = scene_.environment.get();
  if (split_) {
    const bool patches = point.part == VisibilityPart::kPatches;
    sky = patches ? split_->patches.get() : split_->rest.get();
  }
  const bool looks_up = point.part != VisibilityPart::kEmitters &&
                        (options_.what != RenderWhat::kImage || sky != nullptr);
  const size_t end = point.has(VisibilityPart::kEmitters) ? emitters_.size() + 1 : 1;
  Rgb<double> sum;
  for (int k = 0; k < count; ++k) {
    const Rng key = even(point, point.seed_of_look, point.number * count + k);
    // The sky and every emitter have points of their own.
    for (size_t i = looks_up ? 0 : 1; i < end; ++i) {
      Rng rng = key.at(Purpose::kEmitter, i);
      const double u1 = rng.uniform(), u2 = rng.uniform();
      sum += i == 0 ? sky_ray(sky, seen, u1, u2) : emitter_ray(emitters_[i - 1], seen, u1, u2);
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
Rgb<double> VisibilityEstimator::sky_ray(const Environment* sky, const Seen& seen, double u1,
                                         double u2) const {
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
  Vec3d direction;
  double pdf;
  if (sky->is_uniform()) {
    const double z = std::sqrt(u1);
    direction = around(seen.scattering.normal(), z);
    pdf = z / kPi;
  } else {
    const auto drawn = sky->sample_direction(u1, u2);
    direction = drawn.direction;
    pdf = drawn.pdf;
  }
  if (!(pdf > 0)) return {};
  const Rgb<double> f = seen.scattering.eval(direction);
  if (is_black(f) || !is_open(seen, direction)) return {};
  return f * sky->radiance(direction) * (1 / pdf);
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
