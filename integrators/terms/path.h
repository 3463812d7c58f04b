#pragma once
// The path tracer, written once for any scalar: double gives radiance, Dual gives radiance and the
// interior term of its derivative, Var writes a tape of it. Sampled directions, their densities and
// MIS weights are constants while the parameters move (solid-angle measure, everywhere), but for
// directions that move on purpose (direction_field.h, warp_field.h) and the one direction of a
// light without extent, which follows the parameters.
#include <atomic>
#include <cstdint>

#include "integrators/terms/closed_light.h"
#include "integrators/terms/direction_field.h"
#include "integrators/terms/edge_sides.h"
#include "integrators/terms/near_faces.h"
#include "integrators/terms/warp_field.h"
#include "limn/core/lights.h"
#include "limn/core/ray_tracer.h"
#include "limn/core/reverse.h"
#include "limn/core/rng.h"
#include "limn/core/scene.h"
#include "limn/core/shading.h"
#include "limn/integrators/run.h"

namespace limn {

struct PathContext {
  const Scene& scene;
  const RayTracer& tracer;
  const Lights& lights;
  // Takes the place of all light that is scattered; null: paths are sampled.
  const ClosedLight* closed = nullptr;
};

// Does nothing at path vertices.
struct NoVisitor {
  template <class... A>
  void operator()(const A&...) const {}
};

inline double mis_weight(double pdf, double other) {
  // Power heuristic; written so that huge densities do not overflow.
  const double ratio = other / pdf;
  return 1 / (1 + ratio * ratio);
}

// How a path came to a vertex.
struct PathStep {
  Vec3d from;      // the vertex before
  double pdf = 0;  // of the direction from there [1/sr]; 0 for what the camera or an edge sees
};

// Visitor: called as visitor(surface, scattering, throughput, motion, step, bounces, key) at every
// vertex where the path scatters. motion: how directions move there, null where they are held.
template <class S, class Visitor>
class PathTracer {
 public:
  PathTracer(const PathContext& context, RayCount& rays, Visitor& visitor)
      : c_(context), rays_(rays), visitor_(visitor) {}

  // Directions at the first vertex of the path move from now on. Both must outlive the tracer. Only
  // where S carries derivatives.
  void move_directions(const MotionRates& rates, const DirectionField& field) {
    static_assert(std::is_same_v<S, Dual>);
    rates_ = &rates;
    field_ = &field;
  }
  // The directions of all vertices move from now on. Must outlive the tracer.
  void warp_directions(DirectionWarper& warper) {
    static_assert(std::is_same_v<S, Dual>);
    warper_ = &warper;
  }
  // Takes more light samples and directions at vertices that slide fast. It must outlive the
  // tracer.
  void split_by(const MotionRates* rates) { splitting_ = rates; }
  // How many light samples are averaged at every vertex but the first.
  void take_light_samples(int count) { light_samples_ = count; }
  // With an even number of them: half of what every first makes more than the second, at all
  // vertices of the paths so far. It has mean zero, and the variance of their mean.
  const Rgb<S>& light_difference() const { return light_difference_; }
  uint64_t later_lights() const { return later_lights_; }  // light samples behind it
  // Sum of the scores over the paths so far: has mean zero, and belongs to the interior term.
  const Rgb<Lanes>& score() const { return score_; }

  // Radiance that arrives at the origin of a ray against its direction. `ray` is the primal ray
  // with its skipped faces; bounces: how often the whole path has scattered before.
  Rgb<S> from_ray(const Ray& ray, const Vec3<S>& origin, const Vec3<S>& direction, int bounces,
                  const Rng& key) {
    Hit hit;
    ++rays_.closest;
    if (!c_.tracer.closest(ray, hit)) return escaped(direction, bounces);
    return from_surface(surface_on_ray<S>(c_.scene, hit.face, origin, direction), -direction,
                        bounces, key, nullptr);
  }

  Rgb<S> escaped(const Vec3<S>& direction, int bounces) const {
    const bool hidden = bounces == 0 && c_.scene.hide_emitters;
    if (!c_.scene.environment || hidden) return {};
    return environment_radiance<S>(*c_.scene.environment, direction);
  }

  // Radiance that leaves the surface along wi: emission and everything scattered within the scene's
  // depth. edge: where the surface lies, if the path starts on an edge; it follows the path while
  // that stays there. With x_0 the surface, w_i a direction drawn at x_i with density p_i, f_i the
  // scattering function times cosine there, and the throughput T_k = f_0 / p_0 ... f_(k-1) /
  // p_(k-1), one path estimates
  //   L = L_e(x_0) + sum over k of T_k (E_k + f_k / p_k m_k L_e(x_(k+1))),
  //   E_k = f_k(l) / q_k(l) n_k L_e(l),
  // l a direction that light sampling draws with density q_k, and m_k = p^2 / (p^2 + q^2) and
  // n_k = q^2 / (p^2 + q^2) the weights of the power heuristic at either's direction (n_k = 1 for a
  // delta light). w, l, p, q, m, n are constants when S carries derivatives.
  Rgb<S> from_surface(SurfacePoint<S> surface, Vec3<S> wi, int bounces, const Rng& key,
                      EdgeStart* edge) {
    Rgb<S> radiance = surface.emission(value(wi), c_.scene.shading);
    follow({surface, wi, grey(S(1.0)), {}, 1}, bounces, key, edge, false, radiance);
    return radiance;
  }

 private:
  // A vertex of a path and how it was reached.
  struct Arrival {
    SurfacePoint<S> surface;
    Vec3<S> wi;
    Rgb<S> throughput;
    PathStep step;
    int copies = 1;  // of paths that share the beginning, this one among them
  };
  // Adds what is scattered along the path. again: all but what further directions bring has been
  // added.
  void follow(Arrival at, int bounces, const Rng& key, EdgeStart* edge, bool again,
              Rgb<S>& radiance) {
    auto& [surface, wi, throughput, step, copies] = at;
    for (;; ++bounces, again = false) {
      if (is_complete(bounces)) return;
      const Scattering<S> scattering(surface, wi, c_.scene.shading);
      if (scattering.black()) return;
      const DirectionMotion* motion = motion_at(surface, bounces);
      if (!again) {
        visitor_(surface, scattering, throughput, motion, step, bounces, key);
        if constexpr (!std::is_same_v<S, Var>) {
          if (c_.closed) {
            radiance += c_.closed->scattered(c_.tracer, surface, scattering, edge);
            return;
          }
        }
        const int more = splits(surface, copies);
        add_lights(surface, scattering, motion, throughput, bounces, more, key, edge, radiance);
        if (more > 1) split(at, more, bounces, key, edge, radiance);
      }
      Rng rng = key.at(Purpose::kBsdf, bounces);
      const double u1 = rng.uniform();
      const double u2 = rng.uniform();
      const auto wo = scattering.sample(u1, u2);
      if (!wo) return;
      if constexpr (std::is_same_v<S, Dual>) {
        if (warper_) motion = warper_->motion(surface, *wo, rng.at(Purpose::kBsdf, 1));
      }
      const Vec3<S> direction = moving(*wo, motion);
      const auto [f, pdf] = evaluate(scattering, *wo, direction, motion);
      if (is_black(value(f))) return;
      add_score(scattering, *wo, motion, value(throughput) * (1 / pdf));
      const Rgb<S> before = throughput;
      throughput = throughput * stretched(f, *wo, motion) * (1 / pdf);
      step = {value(surface.p), pdf};
      // Behind the last scattering only what emits counts.
      const bool last = is_complete(bounces + 1), shapes_emit = c_.lights.on_shapes();
      if (last && !shapes_emit && !c_.scene.environment) return;
      Hit hit;
      const bool found = next_hit(surface, *wo, edge, last && !shapes_emit, hit);
      if (!found) {
        if (!c_.scene.environment) return;
        auto sight = c_.lights.template environment<S>(*wo);
        if (motion) sight.radiance = environment_radiance<S>(*c_.scene.environment, direction);
        radiance += throughput * sight.radiance * mis_weight(pdf, sight.pdf);
        return;
      }
      if (last && !(shapes_emit && c_.scene.shape(hit.face.shape).is_emitter)) return;
      if (hit.t > 0) {
        surface = surface_on_ray<S>(c_.scene, hit.face, surface.p, direction);
        edge = nullptr;
      } else {
        move_along_edge(surface, hit.face);
      }
      wi = -direction;
      const Rgb<S> lamp = emitted(surface, *wo, pdf, hit.t);
      if (motion && !motion->warp && !is_black(value(lamp))) {
        radiance += before * scattering.eval(*wo) * lamp * (1 / pdf);  // held
      } else {
        radiance += throughput * lamp;
      }
      if (!survives_roulette(throughput, bounces + 1, key)) return;
    }
  }

  // Whether a path that has scattered so often scatters no more.
  bool is_complete(int bounces) const {
    return c_.scene.max_depth >= 0 && bounces + 1 >= c_.scene.max_depth;
  }
  const DirectionMotion* motion_at(const SurfacePoint<S>& surface, int bounces) {
    if constexpr (std::is_same_v<S, Dual>) {
      if (bounces > 0 || !field_) return nullptr;
      motion_ = rates_->motion_at(value(surface.p), *field_);
      return &motion_;
    }
    return nullptr;
  }
  static Vec3<S> moving(const Vec3d& w, const DirectionMotion* motion) {
    if constexpr (std::is_same_v<S, Dual>) {
      if (motion) return motion->warp ? warped(w, *motion->warp) : turning(w, motion->turn);
    }
    return {w.x, w.y, w.z};
  }
  static typename Scattering<S>::Evaluation evaluate(const Scattering<S>& scattering,
                                                     const Vec3d& w, const Vec3<S>& direction,
                                                     const DirectionMotion* motion) {
    if (!motion) return scattering.eval_with_pdf(w);
    return {scattering.eval(direction), scattering.pdf_solid_angle(w)};
  }
  // Times the change of a solid angle around w.
  static Rgb<S> stretched(const Rgb<S>& f, const Vec3d& w, const DirectionMotion* motion) {
    if constexpr (std::is_same_v<S, Dual>) {
      if (motion && motion->warp) return f * Dual(1.0, motion->warp->divergence);
      if (motion && motion->turn.follows()) return f * Dual(1.0, divergence(w, motion->turn));
    }
    return f;
  }
  void add_score(const Scattering<S>& scattering, const Vec3d& w, const DirectionMotion* motion,
                 const Rgb<double>& weight) {
    if constexpr (std::is_same_v<S, Dual>) {
      if (!motion || !motion->scoring) return;
      Rgb<Lanes> f = scattering.eval_derivative(turning(w, motion->score));
      if (motion->score.follows()) {
        const Rgb<double> still = value(scattering.eval(w));
        const Lanes stretch = divergence(w, motion->score);
        for (int c = 0; c < 3; ++c) f[c] += stretch * still[c];
      }
      score_ = score_ + Rgb<Lanes>{f.r * weight.r, f.g * weight.g, f.b * weight.b};
    }
  }

  // Where a vertex slides fast, what further directions bring is as large: more of them in place of
  // one. Paths of one beginning are so many at most, however deep they go.
  int splits(const SurfacePoint<S>& surface, int copies) const {
    if constexpr (std::is_same_v<S, Dual>) {
      if (!splitting_) return 1;
      const int most = kMostSplits / copies;
      const double slides = splitting_->sliding({surface.p.x.d, surface.p.y.d, surface.p.z.d});
      return slides < most ? static_cast<int>(std::max(slides + 0.5, 1.0))
                           : most;  // also if not finite
    }
    return 1;
  }
  void split(Arrival& at, int more, int bounces, const Rng& key, EdgeStart* edge,
             Rgb<S>& radiance) {
    at.throughput = at.throughput * (1.0 / more);
    at.copies *= more;
    for (int i = 1; i < more; ++i) {
      // Beyond the indices of paths that share no vertex.
      const int index = kMostPaths * (bounces + 1) + i;
      follow(at, bounces, key.copy(Purpose::kPathCopy, index), edge, true, radiance);
    }
  }
  void add_lights(const SurfacePoint<S>& surface, const Scattering<S>& scattering,
                  const DirectionMotion* motion, const Rgb<S>& throughput, int bounces, int more,
                  const Rng& key, const EdgeStart* edge, Rgb<S>& radiance) {
    const int count = (bounces > 0 ? light_samples_ : 1) * more;
    if (bounces > 0) later_lights_ += count;
    if (count == 1) {
      radiance += throughput * direct_light(surface, scattering, motion, bounces, key, edge);
      return;
    }
    const Rgb<S> share = throughput * (1.0 / count);
    for (int i = 0; i < count; ++i) {
      const Rng copy = key.copy(Purpose::kLightCopy, i);
      const Rgb<S> light = share * direct_light(surface, scattering, motion, bounces, copy, edge);
      radiance += light;
      if (bounces == 0) continue;
      light_difference_ = i % 2 == 0 ? light_difference_ + light : light_difference_ - light;
    }
  }

  // The next surface from a path vertex; hit.t = 0 for a neighbour that blocks at the edge itself.
  // any: whether there is one suffices, and which is not said.
  bool next_hit(const SurfacePoint<S>& surface, const Vec3d& wo, EdgeStart* edge, bool any,
                Hit& hit) {
    Ray ray{value(surface.p), wo};
    ray.start = surface.face;
    if (edge) {
      if (const auto side = blocked_at_edge(c_.scene, c_.tracer, *edge, wo)) {
        edge->start = *side;
        hit = {side->face, 0};
        return true;
      }
      ray.skip_faces = edge->around.all;
      ++rays_.closest;
      return closest_at_edge(c_.tracer, c_.scene, edge->around, ray.origin, 0, ray, hit);
    }
    ++rays_.closest;
    return any ? c_.tracer.occluded(ray) : c_.tracer.closest(ray, hit);
  }

  void move_along_edge(SurfacePoint<S>& surface, FaceRef face) const {
    // Only primal paths start on edges, so the point itself does not change.
    const Vec3<S> p = surface.p;
    const auto corners = face_corners<double>(c_.scene.shape(face.shape).mesh, face.face);
    const Vec3d n = cross(corners[1] - corners[0], corners[2] - corners[0]);
    surface = surface_on_ray<S>(c_.scene, face, p, Vec3<S>{n.x, n.y, n.z});
  }

  Rgb<S> emitted(const SurfacePoint<S>& surface, const Vec3d& wo, double pdf,
                 double distance) const {
    const Rgb<S> radiance = surface.emission(-wo, c_.scene.shading);
    if (is_black(value(radiance))) return radiance;
    // A face around an edge that is met at distance 0 is never drawn by light sampling.
    const LightView view{wo, distance, surface.n_g};
    const double other = distance > 0 ? c_.lights.pdf(surface.face.shape, view) : 0;
    return radiance * mis_weight(pdf, other);
  }

  Rgb<S> direct_light(const SurfacePoint<S>& surface, const Scattering<S>& scattering,
                      const DirectionMotion* motion, int bounces, const Rng& key,
                      const EdgeStart* edge) {
    if (c_.lights.empty()) return {};
    Rng rng = key.at(Purpose::kEmitter, bounces);
    const Vec3d p = value(surface.p);
    const auto light = c_.lights.sample(p, rng);
    if (!light) return {};
    if (const DeltaLight* delta = light->light->delta()) {
      return delta_light(*delta, *light, surface, scattering, edge);
    }
    if constexpr (std::is_same_v<S, Dual>) {
      if (warper_) return warped_light(*light, surface, scattering, rng);
    }
    if (light->face) motion = nullptr;  // a lamp: held
    const Vec3<S> direction = moving(light->wo, motion);
    const auto [f, bsdf_pdf] = evaluate(scattering, light->wo, direction, motion);
    if (is_black(value(f)) || shadowed(p, surface.face, *light, edge)) return {};
    const double weight = mis_weight(light->pdf, bsdf_pdf) / light->pdf;
    if constexpr (std::is_same_v<S, Dual>) {
      if (motion) {
        return stretched(f, light->wo, motion) * light->light->radiance(direction) * weight;
      }
    }
    return f * light->light->template drawn_radiance<S>(*light) * weight;
  }

  // The same where directions are warped: auxiliary rays are traced for light that arrives.
  Rgb<S> warped_light(const LightSample& light, const SurfacePoint<S>& surface,
                      const Scattering<S>& scattering, const Rng& key) {
    if (is_black(scattering.eval_value(light.wo))) return {};
    if (shadowed(value(surface.p), surface.face, light, nullptr)) return {};
    const DirectionMotion* motion =
        warper_->motion(surface, light.wo, key.at(Purpose::kEmitter, 1));
    const Vec3<S> direction = moving(light.wo, motion);
    const auto [f, bsdf_pdf] = evaluate(scattering, light.wo, direction, motion);
    const double weight = mis_weight(light.pdf, bsdf_pdf) / light.pdf;
    const Rgb<S> radiance = motion && !light.face ? light.light->radiance(direction)
                                                  : light.light->template drawn_radiance<S>(light);
    return stretched(f, light.wo, motion) * radiance * weight;
  }

  // No ray meets a delta light by chance, so it has the whole weight. Its direction follows the
  // parameters, and f_s with it.
  Rgb<S> delta_light(const DeltaLight& light, const LightSample& sample,
                     const SurfacePoint<S>& surface, const Scattering<S>& scattering,
                     const EdgeStart* edge) {
    const auto arriving = arrival<S>(light, surface.p);
    if (!arriving) return {};
    const Rgb<S> f = scattering.eval(arriving->wo);
    if (is_black(value(f)) || shadowed(value(surface.p), surface.face, sample, edge)) return {};
    return f * arriving->irradiance * (1 / sample.pdf);
  }

  bool shadowed(const Vec3d& p, FaceRef start, const LightSample& light, const EdgeStart* edge) {
    if (light.face == start) return true;
    Ray ray{p, light.wo};
    ray.start = start;
    ray.end = light.face.value_or(FaceRef{});
    if (edge) {
      if (blocked_at_edge(c_.scene, c_.tracer, *edge, light.wo)) return true;
      ray.skip_faces = edge->around.all;
    }
    // Ends a float's rounding before the light, so that neighbours of the chosen face do not hide
    // the point.
    ray.t_max = light.distance * (1 - 0x1p-20);
    ++rays_.shadow;
    if (edge) return occluded_from_edge(c_.tracer, c_.scene, edge->around, ray);
    return c_.tracer.occluded(ray);
  }

  // As in Mitsuba: from rr_depth bounces on, survival with the largest throughput, at most 0.95.
  bool survives_roulette(Rgb<S>& throughput, int bounces, const Rng& key) const {
    if (bounces < c_.scene.rr_depth) return true;
    const double survival = std::min(max_channel(value(throughput)), 0.95);
    Rng rng = key.at(Purpose::kRoulette, bounces);
    if (rng.uniform() >= survival) return false;
    throughput = throughput * (1 / survival);
    return true;
  }

  // With 64, squared error times rays was 1.5 times as large under a moving camera, and the same
  // elsewhere.
  static constexpr int kMostSplits = 16;
  static constexpr int kMostPaths = 64;  // of a sample, see allocation.cpp
  const PathContext& c_;
  RayCount& rays_;
  Visitor& visitor_;
  const MotionRates* rates_ = nullptr;
  const DirectionField* field_ = nullptr;
  const MotionRates* splitting_ = nullptr;
  DirectionWarper* warper_ = nullptr;
  DirectionMotion motion_;
  Rgb<Lanes> score_;
  int light_samples_ = 1;
  Rgb<S> light_difference_;
  uint64_t later_lights_ = 0;
};

}  // namespace limn
