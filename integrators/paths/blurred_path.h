#pragma once
// Paths among blurred faces, over any scalar. At every ray's end one of the surfaces that it meets
// is drawn by its weight w_k, or what is behind all of them, and the path goes on there. With
// Duals, the derivative of the sum over k of w_k S_k has two parts: that of S_k is the derivative
// of the path that was drawn; the other is
//   sum over k of (dw_k) S_k = sum over j of (dw_j) (S_j - S_k), k the drawn one,
// since all dw add up to 0. One j other than k is drawn in proportion to |dw_j|, and S_j is the
// radiance of a path of plain numbers by the same random numbers. Such a path starts no others.
//
// Directions of rough lobes are held, and densities and MIS weights are constants, as in path.h.
// MIS weighs pairs of a direction and a surface: what a light draws, and what a BSDF's direction
// meets.
#include <algorithm>
#include <optional>
#include <type_traits>
#include <vector>

#include "integrators/paths/blurred_hits.h"
#include "integrators/paths/path_colours.h"
#include "integrators/paths/path_context.h"
#include "integrators/paths/path_directions.h"
#include "limn/core/rng.h"
#include "limn/core/shading.h"
#include "limn/integrators/run.h"

namespace limn {

template <class S>
class BlurredPath {
 public:
  // lane_scale: natural steps of the lanes' parameters.
  BlurredPath(const BlurredScene& scene, const Rng& key, const Lanes& lane_scale, RayCount& rays)
      : s_(scene),
        scene_(scene.scene()),
        key_(key),
        lane_scale_(lane_scale),
        rays_(rays),
        hits_(scene, rays) {}

  // Radiance that arrives against the ray.
  Rgb<S> arriving(const BlurredRay<S>& ray) {
    ray_ = ray;
    return follow(draw());
  }
  // The same if the ray ends on this face, or meets nothing.
  Rgb<S> leaving(const BlurredRay<S>& ray, const std::optional<FaceRef>& face, double albedo) {
    ray_ = ray;
    albedo_ = albedo;
    return follow(face);
  }

 private:
  using Face = std::optional<FaceRef>;
  // dw_j over the density of j, and what has been found by then.
  struct Pair {
    Lanes weight;
    Rgb<double> other, before;
  };
  static constexpr bool kPlain = std::is_same_v<S, double>;
  bool ordered() const { return s_.blur().weights == BlurWeights::kOrdered; }

  // Draws one of the surfaces that the ray meets, and traces another, too.
  Face draw() {
    const size_t k = hits_.draw(ray_, key_.at(Purpose::kEdgeSide, ray_.bounces));
    if constexpr (!kPlain) pair_with(k);
    return hits_.face(k);
  }
  void pair_with(size_t k) {
    const auto drawn = hits_.draw_other(k, lane_scale_, key_.at(Purpose::kDirect, ray_.bounces));
    if (!drawn) return;
    const BlurredRay<double> ray{value(ray_.origin), value(ray_.direction), 0,        ray_.t_max,
                                 ray_.start,         ray_.bounces,          ray_.pdf, ray_.lights,
                                 ray_.caustic};
    BlurredPath<double> path(s_, key_, lane_scale_, rays_);
    const Rgb<double> other = path.leaving(ray, hits_.face(drawn->j), albedo_);
    pairs_.push_back({drawn->weight, value(throughput_) * other, value(sum_)});
  }

  // The path from the end of ray_.
  Rgb<S> follow(Face face) {
    while (face) {
      const SurfacePoint<S> surface = surface_on_ray<S>(scene_, *face, ray_.origin, ray_.direction);
      sum_ += throughput_ * emitted(surface);
      if (!scatter(surface)) break;
      face = draw();
    }
    if (!face) sum_ += throughput_ * sky();
    if constexpr (!kPlain) {
      const Rgb<double> end = value(sum_);
      for (const Pair& pair : pairs_) {
        for (int c = 0; c < 3; ++c) {
          sum_[c].d += pair.weight * (pair.other[c] - (end[c] - pair.before[c]));
        }
      }
    }
    return sum_;
  }

  // The share of what the ray sees that light sampling does not have.
  double share_seen(double light_pdf) const {
    if (ray_.pdf == 0) return 1;
    return ordered() ? mis_weight(ray_.pdf, light_pdf) : 0;
  }
  Rgb<S> emitted(const SurfacePoint<S>& surface) const {
    const Vec3d wo = value(ray_.direction);
    const Rgb<S> radiance = detail::emission<S>(surface, -wo, scene_.shading);
    if (detail::stays_black(radiance)) return {};
    // Particles bring this light instead (blurred_particles.h).
    if (ray_.pdf == 0) return s_.blur().particles && ray_.caustic ? Rgb<S>() : radiance;
    const double distance = length(value(surface.p) - value(ray_.origin));
    return radiance * share_seen(s_.lights().pdf(ray_.lights, surface.face.shape,
                                                 {wo, distance, surface.n_g}));
  }
  Rgb<S> sky() const {
    if (!scene_.environment || (ray_.bounces == 0 && scene_.hide_emitters)) return {};
    const Rgb<S> radiance = environment_radiance<S>(*scene_.environment, ray_.direction);
    if (ray_.pdf == 0) return radiance;
    return radiance * share_seen(s_.lights().pdf_environment(ray_.lights, value(ray_.direction)));
  }

  bool is_complete(int bounces) const {
    return scene_.max_depth >= 0 && bounces + 1 >= scene_.max_depth;
  }
  // Roulette by the materials of the unmoved scene, as of differences (path_arrive.h).
  bool survives(const SurfacePoint<S>& surface, bool front) {
    const Bsdf* bsdf = s_.unmoved().shape(surface.face.shape).bsdf->side(front);
    const double before = albedo_;
    // The rough lobe's leaves out what is reflected smoothly or passes.
    const bool rough = bsdf && !bsdf->lobes().smooth && !bsdf->lobes().through;
    albedo_ *= rough ? std::clamp(bsdf->lobe().albedo, 0.1, 1.0) : 1.0;  // not tuned
    if (ray_.bounces < scene_.rr_depth) return true;
    const double survival = std::min(before, 0.95);
    Rng rng = key_.at(Purpose::kRoulette, ray_.bounces);
    if (rng.uniform() >= survival) return false;
    throughput_ = throughput_ * (1 / survival);
    albedo_ /= survival;
    return true;
  }

  // Adds what lights send to a surface, and goes on from there; false where the path ends.
  bool scatter(const SurfacePoint<S>& surface) {
    if (is_complete(ray_.bounces)) return false;
    const Scattering<S> scattering(surface, -ray_.direction, scene_.shading);
    if (scattering.black() || !survives(surface, scattering.front())) return false;
    BlurredRay<S> next;
    next.origin = surface.p;
    next.start = surface.face;
    next.lights = s_.lights().at(value(surface.p));
    next.bounces = ray_.bounces + 1;
    if (scattering.is_rough()) sum_ += throughput_ * direct(next, scattering);
    Rng rng = key_.at(Purpose::kBsdf, ray_.bounces);
    const double u = rng.uniform(), v = rng.uniform();
    if (const auto smooth = draw_smooth(scattering, rng)) {
      next.direction = smooth->wo;
      next.caustic = ray_.caustic;
      throughput_ = throughput_ * smooth->weight;
      ray_ = next;
      return !detail::stays_black(smooth->weight);
    }
    const auto wo = scattering.sample(u, v);
    if (!wo) return false;
    const auto [f, pdf] = scattering.eval_with_pdf(*wo);
    if (!(pdf > 0) || detail::stays_black(f)) return false;
    throughput_ = throughput_ * f * (1 / pdf);
    next.direction = detail::moving<S>(*wo, nullptr);
    next.pdf = pdf;
    next.caustic = ray_.bounces == 0;
    const bool last = is_complete(next.bounces);
    ray_ = next;
    return !last || (ordered() && (s_.lights().on_shapes() || scene_.environment));
  }

  // A smooth ray, its weight over its probability; none for the rough lobes. It moves with the
  // surface, and no light that is drawn comes its way.
  static std::optional<SmoothRay<S>> draw_smooth(const Scattering<S>& scattering, Rng& rng) {
    if (!scattering.is_smooth()) return {};
    const SmoothShares shares = scattering.shares();
    double u = rng.uniform();
    const std::optional<int> k = detail::choose_smooth(shares, u);
    if (!k) return {};
    SmoothRay<S> ray = scattering.smooth_ray(*k);
    ray.weight = shares.ray[*k] > 0 ? ray.weight * (1 / shares.ray[*k]) : Rgb<S>();
    return ray;
  }

  // Light that is scattered once from a light that is drawn. ray: from the surface.
  Rgb<S> direct(BlurredRay<S> ray, const Scattering<S>& scattering) {
    if (s_.lights().empty()) return {};
    Rng rng = key_.at(Purpose::kEmitter, ray_.bounces);
    const auto light = s_.lights().sample(ray.lights, rng);
    if (!light) return {};
    if (const DeltaLight* delta = light->light->delta()) {
      const auto arriving = limn::arrival<S>(*delta, ray.origin);
      if (!arriving) return {};
      const Rgb<S> f = scattering.eval(arriving->wo);
      if (detail::stays_black(f)) return {};
      ray.direction = arriving->wo;
      ray.t_max = light->distance;
      return f * arriving->irradiance * hits_.unhidden(ray, {}) * (1 / light->pdf);
    }
    const auto [f, pdf] = scattering.eval_with_pdf(light->wo);
    if (detail::stays_black(f)) return {};
    ray.direction = detail::moving<S>(light->wo, nullptr);
    const Face face = light->face ? Face(s_.emitters().face(*light->face)) : Face();
    const S seen = hits_.unhidden(ray, face);
    const double weight = ordered() ? mis_weight_over_pdf(light->pdf, pdf) : 1 / light->pdf;
    return f * light->light->template drawn_radiance<S>(*light) * seen * weight;
  }

  const BlurredScene& s_;
  const Scene& scene_;
  const Rng& key_;
  const Lanes& lane_scale_;
  RayCount& rays_;
  BlurredRay<S> ray_;
  Rgb<S> throughput_ = grey(S(1.0)), sum_;
  double albedo_ = 1;
  BlurredHits<S> hits_;
  std::vector<Pair> pairs_;
};

}  // namespace limn
