#pragma once
// The path tracer, written once for any scalar: double gives radiance, Dual gives radiance and the
// interior term of its derivative, Var writes a tape of it. Sampled directions, their densities and
// MIS weights are constants while the parameters move (solid-angle measure, everywhere), but for
// directions that move on purpose (direction_field.h, warp_field.h) and the one direction of a
// light without extent, which follows the parameters.
//
// Paths are followed side by side where there are several: each waits for its own divisions, roots
// and reads, and a processor fills such gaps with the work of the next. A path's own steps, and so
// its bits, do not depend on what goes beside it.
#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>

#include "integrators/terms/closed_light.h"
#include "integrators/terms/near_faces.h"
#include "integrators/terms/viewpoint.h"
#include "integrators/terms/walk.h"
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

// Visitor: called as visitor(surface, scattering, throughput, motion, step, bounces, key) at every
// vertex where the path scatters. motion: how directions move there, null where they are held.
template <class S, class Visitor>
class PathTracer {
 public:
  using Walk = limn::Walk<S, Visitor>;
  // Side by side. With derivatives 1, 3 and 8 took 1.05, 1.02 and 1.01 of the time that a gradient
  // of the demo had taken path by path; 16 is not tuned.
  static constexpr size_t kMostWalks = std::is_same_v<S, double> ? 16 : 8;

  PathTracer(const PathContext& context, RayCount& rays) : c_(context), rays_(rays) {}

  // By the fields of paths that have one. Must outlive the tracer. Only where S carries
  // derivatives.
  void move_directions(const MotionRates& rates) {
    static_assert(std::is_same_v<S, Dual>);
    rates_ = &rates;
  }
  // The directions of all vertices move from now on, on one path at a time. Must outlive the
  // tracer.
  void warp_directions(DirectionWarper& warper) {
    static_assert(std::is_same_v<S, Dual>);
    warper_ = &warper;
  }
  // Takes more light samples and directions at vertices that slide fast. It must outlive the
  // tracer.
  void split_by(const MotionRates* rates) { splitting_ = rates; }
  // How many light samples are averaged at every vertex but the first.
  void take_light_samples(int count) { light_samples_ = count; }

  // Radiance that arrives at the origins of rays against their directions; rays[i] belongs to
  // walks[i], at most kMostWalks of them. What cannot be traced has `failed`.
  void follow_rays(std::span<const StartRay<S>> rays, std::span<Walk> walks) {
    for (size_t i = 0; i < walks.size(); ++i) {
      Walk& walk = walks[i];
      guarded(walk, [&] {
        ++rays_.closest;
        walk.found = c_.tracer.closest(rays[i].ray, walk.hit);
        return true;
      });
      if (walk.found) fetch_face(walk.hit.face);
    }
    for (const Walk& walk : walks) fetch_corners(walk);
    follow_seen(rays, walks);
  }
  // The same where it is known what they meet: faces[i], or none.
  void follow_rays(std::span<const StartRay<S>> rays, std::span<const FaceRef> faces,
                   std::span<Walk> walks) {
    for (size_t i = 0; i < walks.size(); ++i) {
      walks[i].found = faces[i].shape.valid();
      walks[i].hit.face = faces[i];
    }
    follow_seen(rays, walks);
  }
  Rgb<S> escaped(const Vec3<S>& direction, int bounces) const {
    const bool hidden = bounces == 0 && c_.scene.hide_emitters;
    if (!c_.scene.environment || hidden) return {};
    return environment_radiance<S>(*c_.scene.environment, direction);
  }

  // A path that starts on a surface: the radiance that leaves it along wi, emission and everything
  // scattered within the scene's depth. With x_0 the surface, w_i a direction drawn at x_i with
  // density p_i, f_i the scattering function times cosine there, and the throughput T_k = f_0 / p_0
  // ... f_(k-1) / p_(k-1), one path estimates
  //   L = L_e(x_0) + sum over k of T_k (E_k + f_k / p_k m_k L_e(x_(k+1))),
  //   E_k = f_k(l) / q_k(l) n_k L_e(l),
  // l a direction that light sampling draws with density q_k, and m_k = p^2 / (p^2 + q^2) and
  // n_k = q^2 / (p^2 + q^2) the weights of the power heuristic at either's direction (n_k = 1 for a
  // delta light). w, l, p, q, m, n are constants when S carries derivatives.
  void place(Walk& walk, const SurfacePoint<S>& surface, const Vec3<S>& wi) const {
    walk.surface = surface;
    walk.wi = wi;
    walk.sums.radiance = surface.emission(value(wi), c_.scene.shading);
  }
  void follow_one(Walk& walk) {
    Walk* const one = &walk;
    follow({&one, 1});
  }
  // Adds all that is scattered along paths that have been placed, at most kMostWalks.
  void follow(std::span<Walk* const> walks) {
    Walk* going[kMostWalks];
    size_t count = walks.size();
    std::copy(walks.begin(), walks.end(), going);
    const auto keep = [&](const auto& step) {
      size_t kept = 0;
      for (size_t i = 0; i < count; ++i) {
        if (guarded(*going[i], [&] { return step(*going[i]); })) going[kept++] = going[i];
      }
      count = kept;
    };
    while (count > 0) {
      keep([&](Walk& walk) { return begin_vertex(walk); });
      for (size_t i = 0; i < count; ++i) draw_light(*going[i]);
      for (size_t i = 0; i < count; ++i) weigh_light(*going[i]);
      keep([&](Walk& walk) {
        if (walk.light && shadowed(walk)) walk.light.reset();
        return true;
      });
      for (size_t i = 0; i < count; ++i) add_light(*going[i]);
      keep([&](Walk& walk) { return choose_direction(walk); });
      keep([&](Walk& walk) { return scatter(walk); });
      keep([&](Walk& walk) {
        walk.found = next_hit(walk);
        return true;
      });
      for (size_t i = 0; i < count; ++i) fetch_corners(*going[i]);
      keep([&](Walk& walk) { return walk.found || escape(walk); });
      keep([&](Walk& walk) { return arrive(walk); });
    }
  }

 private:
  void follow_seen(std::span<const StartRay<S>> rays, std::span<Walk> walks) {
    Walk* going[kMostWalks];
    size_t count = 0;
    for (size_t i = 0; i < walks.size(); ++i) {
      Walk& walk = walks[i];
      if (walk.failed) continue;
      const auto& [ray, origin, direction] = rays[i];
      if (walk.found) {
        place(walk, surface_on_ray<S>(c_.scene, walk.hit.face, origin, direction), -direction);
        going[count++] = &walk;
      } else {
        walk.sums.radiance = escaped(direction, walk.bounces);
      }
    }
    follow({going, count});
  }
  template <class Step>
  static bool guarded(Walk& walk, const Step& step) {
    try {
      return step();
    } catch (const UntraceableRay&) {
      walk.failed = true;
      return false;
    }
  }
  // Brings what says where a face lies into the cache.
  void fetch_face(FaceRef face) const {
    const Mesh& mesh = c_.scene.shape(face.shape).mesh;
    __builtin_prefetch(&mesh.faces[face.face.index()]);
    if (!mesh.normal_ids.empty()) __builtin_prefetch(&mesh.normal_ids[face.face.index()]);
  }

  // The same of its corners; it is known then.
  void fetch_corners(const Walk& walk) const {
    if (!walk.found || (walk.last && !c_.lights.on_shapes())) return;
    const FaceRef face = walk.hit.face;
    const Mesh& mesh = c_.scene.shape(face.shape).mesh;
    for (const uint32_t vertex : mesh.face(face.face)) {
      __builtin_prefetch(&mesh.positions[vertex]);
      if constexpr (!std::is_same_v<S, double>) {
        if (!mesh.position_tangents.empty()) __builtin_prefetch(&mesh.position_tangents[vertex]);
      }
    }
    if (mesh.normal_source != NormalSource::kFace) detail::fetch_shading<S>(mesh, face.face);
  }

  // What comes first at a vertex, and lights where they are many; false where the path ends.
  bool begin_vertex(Walk& walk) {
    if (is_complete(walk.bounces)) return false;
    walk.scattering.emplace(walk.surface, walk.wi, c_.scene.shading);
    if (walk.scattering->black()) return false;
    set_motion(walk);
    walk.light.reset();
    walk.lit = walk.again;
    if (walk.again) {
      walk.again = false;
      return true;
    }
    if (walk.visitor) {
      (*walk.visitor)(walk.surface, *walk.scattering, walk.throughput, walk.motion, walk.step,
                      walk.bounces, walk.key);
    }
    if constexpr (!std::is_same_v<S, Var>) {
      if (c_.closed) {
        walk.sums.radiance +=
            c_.closed->scattered(c_.tracer, walk.surface, *walk.scattering, walk.edge);
        return false;
      }
    }
    const int more = splits(walk.surface, walk.copies);
    const int lights = (walk.bounces > 0 ? light_samples_ : 1) * more;
    if (walk.bounces > 0) walk.sums.later_lights += lights;
    walk.lit = lights > 1 || warper_;
    if (walk.lit) add_lights(walk, lights);
    if (more > 1) split(walk, more);
    return true;
  }
  // One light, where there have been no others.
  void draw_light(Walk& walk) const {
    if (!walk.lit) draw_light(walk, walk.key);
  }
  void add_light(Walk& walk) const {
    if (walk.light) walk.sums.radiance += walk.throughput * light_value(walk);
  }
  // Draws the next direction.
  bool choose_direction(Walk& walk) {
    Rng rng = walk.key.at(Purpose::kBsdf, walk.bounces);
    const double u1 = rng.uniform();
    const double u2 = rng.uniform();
    const auto wo = walk.scattering->sample(u1, u2);
    if (!wo) return false;
    walk.wo = *wo;
    if constexpr (std::is_same_v<S, Dual>) {
      if (warper_) walk.motion = warper_->motion(walk.surface, *wo, rng.at(Purpose::kBsdf, 1));
    }
    return true;
  }
  bool scatter(Walk& walk) {
    walk.direction = moving(walk.wo, walk.motion);
    const auto [f, pdf] = evaluate(*walk.scattering, walk.wo, walk.direction, walk.motion);
    if (is_black(value(f))) return false;
    walk.pdf = pdf;
    add_score(walk, value(walk.throughput) * (1 / pdf));
    walk.before = walk.throughput;
    walk.throughput = walk.throughput * stretched(f, walk.wo, walk.motion) * (1 / pdf);
    walk.step = {value(walk.surface.p), pdf};
    walk.last = is_complete(walk.bounces + 1);
    return !walk.last || c_.lights.on_shapes() || c_.scene.environment;
  }
  // Adds what a ray sees that leaves the scene; there the path ends.
  bool escape(Walk& walk) const {
    if (!c_.scene.environment) return false;
    auto sight = c_.lights.template environment<S>(walk.wo);
    if (walk.motion) {
      sight.radiance = environment_radiance<S>(*c_.scene.environment, walk.direction);
    }
    walk.sums.radiance += walk.throughput * sight.radiance * mis_weight(walk.pdf, sight.pdf);
    return false;
  }
  // Goes on to what the ray meets.
  bool arrive(Walk& walk) {
    const DirectionMotion* motion = walk.motion;
    Rgb<S>& radiance = walk.sums.radiance;
    const FaceRef face = walk.hit.face;
    if (walk.last && !(c_.lights.on_shapes() && c_.scene.shape(face.shape).is_emitter)) {
      return false;
    }
    if (walk.hit.t > 0) {
      walk.surface = surface_on_ray<S>(c_.scene, face, walk.surface.p, walk.direction);
      walk.edge = nullptr;
    } else {
      move_along_edge(walk.surface, face);
    }
    walk.wi = -walk.direction;
    const Rgb<S> lamp = emitted(walk.surface, walk.wo, walk.pdf, walk.hit.t);
    if (motion && !motion->warp && !is_black(value(lamp))) {
      radiance += walk.before * walk.scattering->eval(walk.wo) * lamp * (1 / walk.pdf);  // held
    } else {
      radiance += walk.throughput * lamp;
    }
    ++walk.bounces;
    return survives_roulette(walk);
  }

  // Whether a path that has scattered so often scatters no more.
  bool is_complete(int bounces) const {
    return c_.scene.max_depth >= 0 && bounces + 1 >= c_.scene.max_depth;
  }
  void set_motion(Walk& walk) const {
    walk.motion = nullptr;
    if constexpr (std::is_same_v<S, Dual>) {
      if (walk.bounces > 0 || !walk.field) return;
      walk.field_motion = rates_->motion_at(value(walk.surface.p), *walk.field);
      walk.motion = &walk.field_motion;
    }
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
  static void add_score(Walk& walk, const Rgb<double>& weight) {
    if constexpr (std::is_same_v<S, Dual>) {
      const DirectionMotion* motion = walk.motion;
      if (!motion || !motion->scoring) return;
      Rgb<Lanes> f = walk.scattering->eval_derivative(turning(walk.wo, motion->score));
      if (motion->score.follows()) {
        const Rgb<double> still = value(walk.scattering->eval(walk.wo));
        const Lanes stretch = divergence(walk.wo, motion->score);
        for (int c = 0; c < 3; ++c) f[c] += stretch * still[c];
      }
      walk.sums.score =
          walk.sums.score + Rgb<Lanes>{f.r * weight.r, f.g * weight.g, f.b * weight.b};
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
  void split(Walk& walk, int more) {
    walk.throughput = walk.throughput * (1.0 / more);
    walk.copies *= more;
    for (int i = 1; i < more; ++i) {
      // Beyond the indices of paths that share no vertex.
      const int index = kMostPaths * (walk.bounces + 1) + i;
      Walk copy = walk;
      copy.key = walk.key.copy(Purpose::kPathCopy, index);
      copy.again = true;
      follow_one(copy);
      if (copy.failed) throw UntraceableRay();
      walk.sums = copy.sums;
    }
  }
  void add_lights(Walk& walk, int count) {
    const Rgb<S> share = walk.throughput * (1.0 / count);
    PathSums<S>& sums = walk.sums;
    for (int i = 0; i < count; ++i) {
      const Rng copy = walk.key.copy(Purpose::kLightCopy, i);
      const Rgb<S> light = share * direct_light(walk, copy);
      sums.radiance += light;
      if (walk.bounces == 0) continue;
      sums.light_difference =
          i % 2 == 0 ? sums.light_difference + light : sums.light_difference - light;
    }
    walk.light.reset();
  }

  // The next surface from a path vertex; hit.t = 0 for a neighbour that blocks at the edge itself.
  bool next_hit(Walk& walk) {
    Ray ray{value(walk.surface.p), walk.wo};
    ray.start = walk.surface.face;
    if (EdgeStart* edge = walk.edge) {
      if (const auto side = blocked_at_edge(c_.scene, c_.tracer, *edge, walk.wo)) {
        edge->start = *side;
        walk.hit = {side->face, 0};
        return true;
      }
      ray.skip_faces = edge->around.all;
      ++rays_.closest;
      return closest_at_edge(c_.tracer, c_.scene, edge->around, ray.origin, 0, ray, walk.hit);
    }
    ++rays_.closest;
    // Where no shape emits, what hides the environment from the last scattering need not be known.
    const bool any = walk.last && !c_.lights.on_shapes();
    if (any) return c_.tracer.occluded(ray);
    const bool found = c_.tracer.closest(ray, walk.hit);
    if (found) fetch_face(walk.hit.face);
    return found;
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

  Rgb<S> direct_light(Walk& walk, const Rng& key) {
    draw_light(walk, key);
    if constexpr (std::is_same_v<S, Dual>) {
      if (warper_ && walk.light && !walk.light->light->delta()) {
        return warped_light(walk, key.at(Purpose::kEmitter, walk.bounces));
      }
    }
    weigh_light(walk);
    return !walk.light || shadowed(walk) ? Rgb<S>{} : light_value(walk);
  }

  // Draws a light, if there is any.
  void draw_light(Walk& walk, const Rng& key) const {
    walk.light.reset();
    if (c_.lights.empty()) return;
    Rng rng = key.at(Purpose::kEmitter, walk.bounces);
    walk.light = c_.lights.sample(value(walk.surface.p), rng);
  }
  // What the light that was drawn adds but for its radiance; none if that is black.
  void weigh_light(Walk& walk) const {
    if (!walk.light) return;
    const LightSample& light = *walk.light;
    if (const DeltaLight* delta = light.light->delta()) {
      draw_delta(walk, *delta);
      return;
    }
    walk.light_motion = light.face ? nullptr : walk.motion;  // a lamp: held
    const Vec3<S> direction = moving(light.wo, walk.light_motion);
    const auto [f, pdf] = evaluate(*walk.scattering, light.wo, direction, walk.light_motion);
    walk.light_share = stretched(f, light.wo, walk.light_motion);
    walk.light_weight = mis_weight(light.pdf, pdf) / light.pdf;
    if (is_black(value(f))) walk.light.reset();
  }
  // No ray meets a delta light by chance, so it has the whole weight. Its direction follows the
  // parameters, and f_s with it. A face that it sees edge-on is dark, as its edges have it: rounding
  // would tell which half of the face begins to be lit as the scene moves.
  void draw_delta(Walk& walk, const DeltaLight& delta) const {
    const auto arriving = limn::arrival<S>(delta, walk.surface.p);
    if (arriving && std::fabs(dot(walk.surface.n_g, value(arriving->wo))) > kEdgeOn) {
      const Rgb<S> f = walk.scattering->eval(arriving->wo);
      walk.light_share = f * arriving->irradiance * (1 / walk.light->pdf);
      if (!is_black(value(f))) return;
    }
    walk.light.reset();
  }
  Rgb<S> light_value(const Walk& walk) const {
    const LightSample& light = *walk.light;
    if (light.light->delta()) return walk.light_share;
    if constexpr (std::is_same_v<S, Dual>) {
      if (const DirectionMotion* motion = walk.light_motion) {
        return walk.light_share * light.light->radiance(moving(light.wo, motion)) *
               walk.light_weight;
      }
    }
    return walk.light_share * light.light->template drawn_radiance<S>(light) * walk.light_weight;
  }

  // What a light adds where directions are warped: auxiliary rays are traced for light that
  // arrives.
  Rgb<S> warped_light(const Walk& walk, const Rng& key) {
    const LightSample& light = *walk.light;
    const SurfacePoint<S>& surface = walk.surface;
    const Scattering<S>& scattering = *walk.scattering;
    if (is_black(scattering.eval_value(light.wo))) return {};
    if (shadowed(walk)) return {};
    const DirectionMotion* motion =
        warper_->motion(surface, light.wo, key.at(Purpose::kEmitter, 1));
    const Vec3<S> direction = moving(light.wo, motion);
    const auto [f, bsdf_pdf] = evaluate(scattering, light.wo, direction, motion);
    const double weight = mis_weight(light.pdf, bsdf_pdf) / light.pdf;
    const Rgb<S> radiance = motion && !light.face ? light.light->radiance(direction)
                                                  : light.light->template drawn_radiance<S>(light);
    return stretched(f, light.wo, motion) * radiance * weight;
  }

  bool shadowed(const Walk& walk) {
    const LightSample& light = *walk.light;
    const FaceRef start = walk.surface.face;
    const EdgeStart* edge = walk.edge;
    if (light.face == start) return true;
    Ray ray{value(walk.surface.p), light.wo};
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
  bool survives_roulette(Walk& walk) const {
    if (walk.bounces < c_.scene.rr_depth) return true;
    const double survival = std::min(max_channel(value(walk.throughput)), 0.95);
    Rng rng = walk.key.at(Purpose::kRoulette, walk.bounces);
    if (rng.uniform() >= survival) return false;
    walk.throughput = walk.throughput * (1 / survival);
    return true;
  }

  // With 64, squared error times rays was 1.5 times as large under a moving camera, and the same
  // elsewhere.
  static constexpr int kMostSplits = 16;
  static constexpr int kMostPaths = 64;  // of a sample, see allocation.cpp
  const PathContext& c_;
  RayCount& rays_;
  const MotionRates* rates_ = nullptr;
  const MotionRates* splitting_ = nullptr;
  DirectionWarper* warper_ = nullptr;
  int light_samples_ = 1;
};

}  // namespace limn
