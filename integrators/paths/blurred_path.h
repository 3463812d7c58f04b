#pragma once
// Paths among blurred faces, over any scalar. At every ray's end one of the surfaces that it meets
// is drawn by its weight w_k, or what is behind all of them, and the path goes on there. With
// Duals, the derivative of the sum over k of w_k S_k has two parts: that of S_k is the derivative
// of the path that was drawn; the other is
//   sum over k of (dw_k) S_k = sum over j of (dw_j) (S_j - S_k), k the drawn one,
// since all dw add up to 0. One j other than k is drawn in proportion to |dw_j|, and S_j is the
// radiance of a path of plain numbers by the same random numbers. Such a path starts no others.
//
// Directions are held, and densities and MIS weights are constants, as in path.h. MIS weighs pairs
// of a direction and a surface: what a light draws, and what a BSDF's direction meets.
#include <algorithm>
#include <optional>
#include <type_traits>
#include <vector>

#include "integrators/paths/blurred_scene.h"
#include "integrators/paths/path_colours.h"
#include "integrators/paths/path_context.h"
#include "integrators/paths/path_directions.h"
#include "limn/core/rng.h"
#include "limn/core/shading.h"
#include "limn/integrators/run.h"

namespace limn {

template <class S>
struct BlurredRay {
  Vec3<S> origin, direction;
  double t_min = 0, t_max = std::numeric_limits<double>::infinity();
  FaceRef start = {};
  int bounces = 0;         // before it
  double pdf = 0;          // of its direction [1/sr]; 0 of the camera's
  Lights::Point lights{};  // where it starts
};

template <class S>
class BlurredPath {
 public:
  // lane_scale: natural steps of the lanes' parameters.
  BlurredPath(const BlurredScene& scene, const Rng& key, const Lanes& lane_scale, RayCount& rays)
      : s_(scene), scene_(scene.scene()), key_(key), lane_scale_(lane_scale), rays_(rays) {}

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

  // Sets hits_ and weights_; the last weight is that of what is behind. Returns their number.
  size_t look(const BlurredRay<S>& ray) {
    Ray primal{value(ray.origin), value(ray.direction), ray.t_min, ray.t_max, ray.start};
    primal.skip_emitters = scene_.hide_emitters && ray.bounces == 0;
    s_.tracer().hits(primal, found_);
    if (found_.size() == 1 && found_[0].opacity == 1) {
      weights_.assign({S(1.0), S(0.0)});
      hits_.assign({{found_[0].face, found_[0].t, 1.0, found_[0].front}});
      return 2;
    }
    hits_.clear();
    for (const BlurHit& hit : found_) hits_.push_back(lifted(ray, hit));
    blur_weights<S>(hits_, s_.blur(), s_.far(ray.bounces), neighbours(), weights_);
    S rest = 1.0;
    for (const S& w : weights_) rest = rest - w;
    weights_.push_back(detail::not_negative(rest));
    return weights_.size();
  }
  auto neighbours() const {
    return [this](const BlurredFace<S>& a, const BlurredFace<S>& b) {
      return a.front == b.front && s_.faces().touch(a.face, b.face);
    };
  }
  // The hit as it moves.
  BlurredFace<S> lifted(const BlurredRay<S>& ray, const BlurHit& hit) const {
    if constexpr (!kPlain) {
      const Mesh& mesh = scene_.shape(hit.face.shape).mesh;
      const bool held = is_constant(ray.origin) && is_constant(ray.direction);
      if (!held || !mesh.position_tangents.empty()) {
        const auto corners = face_corners<S>(mesh, hit.face.face);
        const Vec3<S> n = cross(corners[1] - corners[0], corners[2] - corners[0]);
        const S t = dot(corners[0] - ray.origin, n) / dot(n, ray.direction);
        const S d = distance_to_sides(corners, ray.origin + ray.direction * t);
        return {hit.face, t, blur_opacity(d, s_.blur().sigma), hit.front};
      }
    }
    return {hit.face, hit.t, hit.opacity, hit.front};
  }

  // Draws one of the surfaces that the ray meets by its weight.
  Face draw() {
    ++rays_.closest;
    const size_t met = look(ray_);
    Rng rng = key_.at(Purpose::kEdgeSide, ray_.bounces);
    double u = rng.uniform();
    size_t k = 0;
    while (k + 1 < met && u >= value(weights_[k])) u -= value(weights_[k++]);
    if constexpr (!kPlain) pair_with(k);
    return k < hits_.size() ? Face(hits_[k].face) : Face();
  }

  // Traces another surface that the ray met than the drawn one, k.
  void pair_with(size_t k) {
    constexpr double kSmall = 0.05;  // changes of weight below it are left to roulette; not tuned
    std::vector<double> shares(weights_.size());
    double sum = 0;
    for (size_t j = 0; j < weights_.size(); ++j) {
      for (int l = 0; j != k && l < kLanes; ++l) {
        shares[j] += std::fabs(weights_[j].d[l] * lane_scale_[l]);
      }
      sum += shares[j];
    }
    if (!(sum > 0)) return;
    Rng rng = key_.at(Purpose::kDirect, ray_.bounces);
    const double survival = std::min(1.0, sum / kSmall);
    if (rng.uniform() >= survival) return;
    double u = rng.uniform() * sum;
    size_t j = 0;
    while (j + 1 < shares.size() && (u >= shares[j] || shares[j] == 0)) u -= shares[j++];
    if (shares[j] == 0) return;  // rounding
    const BlurredRay<double> ray{value(ray_.origin), value(ray_.direction), 0,        ray_.t_max,
                                 ray_.start,         ray_.bounces,          ray_.pdf, ray_.lights};
    BlurredPath<double> path(s_, key_, lane_scale_, rays_);
    const Rgb<double> other =
        path.leaving(ray, j < hits_.size() ? Face(hits_[j].face) : Face(), albedo_);
    pairs_.push_back(
        {weights_[j].d * (sum / (shares[j] * survival)), value(throughput_) * other, value(sum_)});
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
    if (ray_.pdf == 0) return radiance;
    const double distance = length(value(surface.p) - value(ray_.origin));
    return radiance * share_seen(s_.lights().pdf(ray_.lights, surface.face.shape,
                                                 {wo, distance, surface.n_g}));
  }
  Rgb<S> sky() const {
    if (!scene_.environment || (ray_.pdf == 0 && scene_.hide_emitters)) return {};
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
    albedo_ *= bsdf ? std::clamp(bsdf->lobe().albedo, 0.1, 1.0) : 1.0;  // not tuned
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
    sum_ += throughput_ * direct(next, scattering);
    Rng rng = key_.at(Purpose::kBsdf, ray_.bounces);
    const double u = rng.uniform();
    const auto wo = scattering.sample(u, rng.uniform());
    if (!wo) return false;
    const auto [f, pdf] = scattering.eval_with_pdf(*wo);
    if (!(pdf > 0) || detail::stays_black(f)) return false;
    throughput_ = throughput_ * f * (1 / pdf);
    next.direction = detail::moving<S>(*wo, nullptr);
    next.pdf = pdf;
    const bool last = is_complete(next.bounces);
    ray_ = next;
    return !last || (ordered() && (s_.lights().on_shapes() || scene_.environment));
  }

  // What is not hidden of a face, or of what is behind the ray's end if there is none.
  S unhidden(const BlurredRay<S>& ray, const Face& face) {
    ++rays_.shadow;
    const size_t met = look(ray);
    if (ordered()) {
      if (!face) return weights_[met - 1];
      for (size_t k = 0; k < hits_.size(); ++k) {
        if (hits_[k].face == *face) return weights_[k];
      }
      return 0.0;
    }
    // Quinn 2021, 4.4, but that lamps fade, too: where directions are held, ends would be missing.
    S result = 1.0;
    for (const BlurredFace<S>& hit : hits_) {
      if (face && hit.face == *face) return result * hit.opacity;
      if (!face || !s_.faces().touch(hit.face, *face)) result = result * (1.0 - hit.opacity);
    }
    return face ? S(0.0) : result;
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
      return f * arriving->irradiance * unhidden(ray, {}) * (1 / light->pdf);
    }
    const auto [f, pdf] = scattering.eval_with_pdf(light->wo);
    if (detail::stays_black(f)) return {};
    ray.direction = detail::moving<S>(light->wo, nullptr);
    const Face face = light->face ? Face(s_.emitters().face(*light->face)) : Face();
    const S seen = unhidden(ray, face);
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
  std::vector<BlurHit> found_;
  std::vector<BlurredFace<S>> hits_;
  std::vector<S> weights_;
  std::vector<Pair> pairs_;
};

}  // namespace limn
