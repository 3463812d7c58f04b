// Paths x_1 ... x_k from the camera's first surface to a light. Three ways draw them: from the
// camera, by the BSDF up to the light; the same, but that the light draws its point; and from the
// light, up to a connection of x_1 with the camera. With the densities of directions p_i towards
// the light and q_i towards the camera, the third over the first is
//   R = (particles per sample) p(x_k) / pi * c_1 / (p(x_1) p_1) * prod over 1 < i < k of
//         q_i c_i / (p_i c'_i),
// where c_i and c'_i are the geometric cosines towards the light and the camera, and p(x_1) is the
// density of x_1 on the film. Of a smooth ray both densities are deltas, whose ratio is that of
// probabilities over the square of eta. Roulette is left out of all of them.
#include "integrators/methods/light_traced_estimator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "integrators/paths/camera_path.h"
#include "integrators/paths/path_directions.h"
#include "integrators/paths/path_log.h"
#include "integrators/paths/straight_way.h"
#include "limn/core/error.h"
#include "limn/core/reverse.h"

namespace limn {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

// A drawn direction from a surface.
struct Drawn {
  Vec3d wo;
  Rgb<double> weight;  // value times cosine over the density
  double pdf = 0;      // [1/sr]; infinite of a smooth ray
  int ray = 0;         // which smooth ray
  double share = 0;    // the probability of it
};

std::optional<Drawn> draw(const Scattering<double>& scattering, Rng rng) {
  const double u = rng.uniform(), v = rng.uniform();
  if (scattering.is_smooth()) {
    const SmoothShares shares = scattering.shares();
    double w = rng.uniform();
    if (const std::optional<int> k = detail::choose_smooth(shares, w)) {
      const double share = shares.ray[*k];
      if (!(share > 0)) return {};
      const SmoothRay<double> ray = scattering.smooth_ray(*k);
      return Drawn{ray.wo, ray.weight * (1 / share), kInfinite, *k, share};
    }
  }
  const auto wo = scattering.sample(u, v);
  if (!wo) return {};
  const auto [f, pdf] = scattering.eval_with_pdf(*wo);
  if (!(pdf > 0)) return {};
  return Drawn{*wo, f * (1 / pdf), pdf};
}

// Where a ray along wo starts.
SurfacePoint<double> side_of(const Scene& scene, const SurfacePoint<double>& surface,
                             const Scattering<double>& scattering, const Vec3d& wo) {
  return scattering.passes(wo) ? beyond(scene, surface, scattering.wi()) : surface;
}

double cosine(const SurfacePoint<double>& surface, const Vec3d& w) {
  return std::fabs(dot(surface.n_g, w));
}

// q c / (p c') of a vertex seen from the camera's side by `front`, from the light's by `back`.
double backward_over_forward(const SurfacePoint<double>& surface, const Scattering<double>& front,
                             const Scattering<double>& back) {
  const Vec3d &w = front.wi(), &l = back.wi();
  const double p = front.pdf_solid_angle(l);
  return p > 0 ? back.pdf_solid_angle(w) * cosine(surface, l) / (p * cosine(surface, w)) : 0;
}
// The same where both go along their k-th smooth rays: densities are deltas, whose ratio is that of
// probabilities over the square of eta, here the one of `front`'s ray.
double backward_over_forward(const SurfacePoint<double>& surface, const Scattering<double>& front,
                             const Scattering<double>& back, int k, double eta) {
  const Vec3d &w = front.wi(), &l = back.wi();
  const double p = front.shares().ray[k], q = back.shares().ray[k];
  const double bent = std::fabs(dot(front.normal(), w)) * cosine(surface, l) /
                      (std::fabs(dot(back.normal(), l)) * cosine(surface, w));
  return p > 0 ? q / (p * eta * eta) * bent : 0;
}

// Whether the k-th smooth ray leads towards w: not where an interpolated normal is bent for one of
// its viewers alone. Ways by light and by camera that do not meet are no ways of one path.
bool leads_towards(const Scattering<double>& scattering, int k, const Vec3d& w) {
  return dot(scattering.smooth_ray(k).wo, w) >= 0.999;
}

}  // namespace

void check_light_traced(const Scene& scene) {
  if (scene.camera.is_orthographic()) {
    throw InputError({scene.file}, "light-traced needs a perspective or thinlens sensor");
  }
  if (has_straight_ways(scene)) {
    throw InputError({scene.file}, "light-traced does not support masks and thin panes");
  }
}

LightTracedEstimator::LightTracedEstimator(const Scene& scene, int threads, Numbers numbers)
    : scene_((check_light_traced(scene), scene)),
      tracer_(make_embree_tracer(scene, threads)),
      lights_(scene, nullptr, DrawFaces::kByArea),
      view_(scene.camera),
      filter_(scene.film.filter),
      numbers_(numbers),
      per_sample_(static_cast<double>(scene.film.crop_width) * scene.film.crop_height),
      densities_(scene.shapes.size()) {
  const auto plane = view_.plane(0, 0);
  pixel_area_ = length(cross(plane.u, plane.v));
  double sum = 0;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    if (!shape.is_emitter) continue;
    densities_[s] =
        shape.radiance_texture ? 1 : luminance(detail::emitter_radiance<double>(shape, ShapeId(s)));
    for (uint32_t f = 0; f < shape.mesh.faces.size(); ++f) {
      const auto c = face_corners<double>(shape.mesh, FaceId(f));
      const double area = 0.5 * length(cross(c[1] - c[0], c[2] - c[0]));
      if (!(area * densities_[s] > 0)) continue;
      sum += area * densities_[s];
      faces_.push_back({{ShapeId(s), FaceId(f)}, 0, sum});
    }
  }
  for (double& d : densities_) d = sum > 0 ? d / sum : 0;
  for (EmittingFace& f : faces_) {
    f.density = densities_[f.face.shape.index()];
    f.upto /= sum;
  }
}

double LightTracedEstimator::emitted_from(const Surface& surface) const {
  return densities_[surface.face.shape.index()];
}

double LightTracedEstimator::on_film(const Surface& surface, const Vec3d& origin,
                                     const Vec3d& direction, const Vec3d& forward) const {
  const double depth = dot(direction, forward);
  return cosine(surface, direction) /
         (pixel_area_ * depth * depth * depth * length_squared(surface.p - origin));
}

void LightTracedEstimator::add_pixels(std::span<const KeyedSample> samples,
                                      SampleSink& sink) const {
  for (const KeyedSample& sample : samples) {
    const PixelSample& at = sample.at;
    const FilmPosition place = sample_pixel_filter(scene_.film, filter_, at.x, at.y, sample.key);
    const CameraRay<double> camera = sample_ray(view_, place, sample.key);
    if (sink.log()) {
      log_camera_ray(*sink.log(), place.x, place.y, camera.origin, camera.direction);
    }
    RayCount rays;
    Rgb<double> radiance;
    bool traced = true;
    try {
      radiance = trace(camera, view_.forward(), sample.key, rays, sink.log());
    } catch (const UntraceableRay&) {
      traced = false;
    }
    sink.cost(0).add(rays);
    ++sink.cost(0).samples;
    if (!traced || !is_finite(radiance)) {
      sink.reject(at, slot_name(0));
      continue;
    }
    sink.add_radiance(at, radiance, pixel_filter_weight(scene_.film, filter_, at.x, at.y, place));
  }
}

// Radiance against a camera's ray.
Rgb<double> LightTracedEstimator::trace(const CameraRay<double>& camera, const Vec3d& forward,
                                        const Rng& key, RayCount& rays, SampleLog* log) const {
  Ray ray = camera_ray(scene_, camera);
  Rgb<double> sum, throughput = grey(1.0);
  double pdf = kInfinite, eta = 1;
  double reached = 0;  // R so far, without p(x_k)
  Lights::Point place;
  for (int bounces = 0;; ++bounces) {
    Hit hit;
    ++rays.closest;
    if (!tracer_->closest(ray, hit)) {
      if (!scene_.environment || (bounces == 0 && scene_.hide_emitters)) return sum;
      const auto sky = environment_radiance<double>(*scene_.environment, ray.direction);
      const double other =
          std::isinf(pdf) ? 0 : lights_.pdf_environment(place, ray.direction) / pdf;
      return sum + throughput * sky * (1 / (1 + other));
    }
    const Surface surface = surface_on_ray<double>(scene_, hit.face, ray.origin, ray.direction);
    const Rgb<double> emitted = surface.emission(-ray.direction, scene_.shading);
    if (!is_black(emitted)) {
      const LightView seen{ray.direction, hit.t, surface.n_g, hit.face.face};
      const double other = std::isinf(pdf) ? 0 : lights_.pdf(place, hit.face.shape, seen) / pdf;
      sum += throughput * emitted * (1 / (1 + other + reached * emitted_from(surface)));
    }
    if (is_complete(bounces)) return sum;
    if (bounces >= scene_.rr_depth) {
      const double survival = std::min(max_channel(throughput) * eta * eta, 0.95);
      if (key.at(Purpose::kRoulette, bounces).uniform() >= survival) return sum;
      throughput = throughput * (1 / survival);
    }
    const Scattering<double> scattering(surface, -ray.direction, scene_.shading);
    if (scattering.black()) return sum;
    if (log) log_vertex(*log, surface, scattering, throughput, bounces);
    place = lights_.at(surface.p);
    // R without p_1 and the cosine of the first direction.
    const double first =
        bounces > 0 ? 0
                    : per_sample_ / (kPi * on_film(surface, camera.origin, ray.direction, forward));
    if (scattering.is_rough()) {
      sum += throughput *
             direct(surface, scattering, place, bounces > 0 ? reached : first, bounces, key, rays);
    }
    const auto drawn = draw(scattering, key.at(Purpose::kBsdf, bounces));
    if (!drawn || is_black(drawn->weight)) return sum;
    const Vec3d& wo = drawn->wo;
    const Scattering<double> back(surface, wo, scene_.shading);
    if (std::isinf(drawn->pdf)) {
      const double bend = scattering.smooth_ray(drawn->ray).eta;
      const Vec3d& wi = scattering.wi();
      reached = bounces == 0 || back.black() || !leads_towards(back, drawn->ray, wi)
                    ? 0
                    : reached * backward_over_forward(surface, scattering, back, drawn->ray, bend);
      if (scattering.passes(wo)) eta *= bend;
    } else if (bounces == 0) {
      reached = first * cosine(surface, wo) / drawn->pdf;
    } else {
      reached = back.black() ? 0 : reached * backward_over_forward(surface, scattering, back);
    }
    throughput = throughput * drawn->weight;
    pdf = drawn->pdf;
    const Surface from = side_of(scene_, surface, scattering, wo);
    ray = Ray{from.p, wo};
    ray.start = from.start();
  }
}

// Light that is scattered once from a light that is drawn. reached: R up to here, without p(x_k);
// at the first vertex without its direction.
Rgb<double> LightTracedEstimator::direct(const Surface& surface,
                                         const Scattering<double>& scattering,
                                         const Lights::Point& place, double reached, int bounces,
                                         const Rng& key, RayCount& rays) const {
  if (lights_.empty()) return {};
  Rng rng = key.at(Purpose::kEmitter, bounces);
  const auto light = lights_.sample(place, rng);
  if (!light) return {};
  Rgb<double> radiance;
  const DeltaLight* delta = light->light->delta();
  if (delta) {
    const auto arriving = delta->arriving(surface.p);
    if (!arriving) return {};
    radiance = arriving->irradiance;
  } else {
    radiance = light->light->drawn_radiance<double>(*light);
  }
  const auto [f, pdf] = scattering.eval_with_pdf(light->wo);
  if (is_black(f) || is_black(radiance)) return {};
  const Surface from = side_of(scene_, surface, scattering, light->wo);
  Ray ray{from.p, light->wo, 0, light->distance, from.start(), light->face.value_or(FaceRef{})};
  if (light->face == ray.start) return {};
  ++rays.shadow;
  if (tracer_->occluded(ray)) return {};
  if (delta) return f * radiance * (1 / light->pdf);
  double particles = 0;  // R times the BSDF's density
  if (light->face && reached > 0) {
    const Scattering<double> back(surface, light->wo, scene_.shading);
    const double share = densities_[light->face->shape.index()];
    if (bounces == 0) {
      particles = reached * share * cosine(surface, light->wo);
    } else if (!back.black()) {
      particles = reached * share * back.pdf_solid_angle(scattering.wi()) *
                  cosine(surface, light->wo) / cosine(surface, scattering.wi());
    }
  }
  return f * radiance * (1 / (pdf + light->pdf + particles));
}

bool LightTracedEstimator::sample_film(size_t, double u, const Rng& key, RayCount& rays,
                                       FilmSample& sample) const {
  try {
    return follow_particle(u, key, rays, sample);
  } catch (const UntraceableRay&) {
    sample.value[0][0] = std::numeric_limits<double>::quiet_NaN();
    return true;
  }
}

bool LightTracedEstimator::follow_particle(double u, const Rng& key, RayCount& rays,
                                           FilmSample& sample) const {
  const auto face = std::lower_bound(faces_.begin(), faces_.end() - 1, u,
                                     [](const EmittingFace& f, double x) { return f.upto < x; });
  const Mesh& mesh = scene_.shape(face->face.shape).mesh;
  const auto c = face_corners<double>(mesh, face->face.face);
  Rng rng = key.at(Purpose::kEmitter, 0);
  const double s = std::sqrt(rng.uniform()), t = rng.uniform();
  const Vec3d point = c[0] * (1 - s) + c[1] * (s * (1 - t)) + c[2] * (s * t);
  const Vec3d n = normalize(cross(c[1] - c[0], c[2] - c[0]));
  const double squared = rng.uniform(), radius = std::sqrt(squared);
  const double angle = 2 * kPi * rng.uniform();
  const Vec3d local{radius * std::cos(angle), radius * std::sin(angle), std::sqrt(1 - squared)};
  const Vec3d emitted = Frame(n).to_world(local);
  const Surface light = surface_on_ray<double>(scene_, face->face, point + n, -n);
  Rgb<double> flux = light.emission(emitted, scene_.shading) * (kPi / face->density);
  if (is_black(flux)) return false;
  Ray ray{point, emitted};
  ray.start = face->face;
  double reached = 1;    // prod of q c / (p c') so far
  double direct = 0;     // density of the light's own draw at the first vertex [1/sr]
  double first_pdf = 0;  // p there; infinite where it turned smoothly
  for (int bounces = 0;; ++bounces) {
    Hit hit;
    ++rays.closest;
    if (is_complete(bounces) || !tracer_->closest(ray, hit)) return false;
    const Surface surface = surface_on_ray<double>(scene_, hit.face, ray.origin, ray.direction);
    const Vec3d l = -ray.direction;
    const Scattering<double> back(surface, l, scene_.shading);
    if (back.black()) return false;
    if (bounces == 0) {
      direct = lights_.pdf(lights_.at(surface.p), face->face.shape, {l, hit.t, n, face->face.face});
    }
    Rng own = key.at(Purpose::kRoulette, bounces);
    // Not tuned.
    const double ends = !back.is_rough() ? 0 : back.bsdf().is_lambertian() ? 0.75 : 0.25;
    if (own.uniform() < ends) {
      const CameraView<double> view = view_.at(sample_lens(scene_.camera, key));
      const Vec3d to = view.origin() - surface.p;
      const double distance = length(to);
      const Vec3d w = to * (1 / distance);
      const double depth = view.depth(surface.p);
      if (depth < scene_.camera.near_clip || depth > scene_.camera.far_clip) return false;
      const auto place = view.project(surface.p);
      const Scattering<double> front(surface, w, scene_.shading);
      if (front.black()) return false;
      const auto [f, pdf] = front.eval_with_pdf(l);
      if (is_black(f)) return false;
      const Surface from = side_of(scene_, surface, back, w);
      // Up to the near plane: what is before it is not seen.
      const double end = distance * (1 - scene_.camera.near_clip / depth);
      Ray shadow{from.p, w, 0, end, from.start()};
      shadow.skip_emitters = scene_.hide_emitters;
      if (shadow.skip_emitters && surface.shape->is_emitter) return false;
      ++rays.shadow;
      if (tracer_->occluded(shadow)) return false;
      const double on = on_film(surface, view.origin(), -w, view.forward());
      // Densities over that of the first way times p_1.
      const double particles =
          per_sample_ * face->density / kPi * cosine(surface, l) / on * reached;
      const double drawn = bounces == 0            ? direct
                           : std::isinf(first_pdf) ? 0
                           : first_pdf > 0         ? direct / first_pdf * pdf
                                                   : kInfinite;
      const double weight = particles / (pdf + drawn + particles);
      const Rgb<double> value =
          flux * f * (on / (cosine(surface, l) * ends) * (weight > 0 ? weight : 0));
      sample.x = place.x;
      sample.y = place.y;
      for (int k = 0; k < 3; ++k) sample.value[k][0] = value[k];
      return true;
    }
    flux = flux * (1 / (1 - ends));
    const auto drawn = draw(back, key.at(Purpose::kBsdf, bounces));
    if (!drawn) return false;
    const Vec3d& w = drawn->wo;
    const Scattering<double> front(surface, w, scene_.shading);
    if (front.black()) return false;
    if (std::isinf(drawn->pdf)) {
      const SmoothRay<double> there = front.smooth_ray(drawn->ray);
      if (is_black(there.weight) || !leads_towards(front, drawn->ray, l)) return false;
      const double over = backward_over_forward(surface, front, back, drawn->ray, there.eta);
      reached *= over;
      // The weight over q times the ratio of both deltas, without probabilities.
      const double bent = over * front.shares().ray[drawn->ray] / back.shares().ray[drawn->ray];
      flux = flux * there.weight * (1 / (bent * drawn->share));
    } else {
      flux = flux * front.eval(l) * (cosine(surface, w) / (cosine(surface, l) * drawn->pdf));
      reached *= backward_over_forward(surface, front, back);
    }
    if (bounces == 0) first_pdf = std::isinf(drawn->pdf) ? kInfinite : front.pdf_solid_angle(l);
    if (is_black(flux)) return false;
    if (bounces >= scene_.rr_depth) {
      if (own.uniform() >= 0.8) return false;
      flux = flux * (1 / 0.8);
    }
    const Surface from = side_of(scene_, surface, back, w);
    ray = Ray{from.p, w};
    ray.start = from.start();
  }
}

}  // namespace limn
