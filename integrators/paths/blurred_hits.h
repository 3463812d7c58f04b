#pragma once
// What a ray meets among blurred faces, with weights, over any scalar.
#include <algorithm>
#include <optional>
#include <type_traits>
#include <vector>

#include "integrators/paths/blurred_scene.h"
#include "integrators/paths/path_context.h"
#include "limn/core/rng.h"
#include "limn/integrators/run.h"

namespace limn {

template <class S>
struct BlurredRay {
  Vec3<S> origin, direction;
  double t_min = 0, t_max = std::numeric_limits<double>::infinity();
  FaceRef start = {};
  int bounces = 0;         // before it
  double pdf = 0;          // of its direction [1/sr]; 0 of the camera's and of smooth rays
  Lights::Point lights{};  // where it starts
  // The first vertex was rough, and all others were smooth.
  bool caustic = false;
};

template <class S>
class BlurredHits {
 public:
  using Face = std::optional<FaceRef>;  // none: what is behind all faces

  BlurredHits(const BlurredScene& scene, RayCount& rays)
      : s_(scene), scene_(scene.scene()), rays_(rays) {}

  // Draws one of the surfaces that the ray meets by its weight; rng: its next number chooses.
  size_t draw(const BlurredRay<S>& ray, Rng rng) {
    ++rays_.closest;
    const size_t met = look(ray);
    size_t k = 0;
    if (value(weights_[0]) == 1) return k;
    double u = rng.uniform();
    while (k + 1 < met && u >= value(weights_[k])) u -= value(weights_[k++]);
    return k;
  }
  const S& weight(size_t k) const { return weights_[k]; }
  Face face(size_t k) const { return k < hits_.size() ? Face(hits_[k].face) : Face(); }

  // Another surface j than k, by the size of dw_j. weight: dw_j over its density.
  struct Other {
    size_t j;
    Lanes weight;
  };
  // Of Duals, after draw(); nothing where no weight changes, or roulette ends it. lane_scale:
  // natural steps of the lanes' parameters.
  std::optional<Other> draw_other(size_t k, const Lanes& lane_scale, Rng rng) const {
    constexpr double kSmall = 0.05;  // changes of weight below it are left to roulette; not tuned
    std::vector<double> shares(weights_.size());
    double sum = 0;
    for (size_t j = 0; j < weights_.size(); ++j) {
      for (int l = 0; j != k && l < kLanes; ++l) {
        shares[j] += std::fabs(weights_[j].d[l] * lane_scale[l]);
      }
      sum += shares[j];
    }
    if (!(sum > 0)) return {};
    const double survival = std::min(1.0, sum / kSmall);
    if (rng.uniform() >= survival) return {};
    double u = rng.uniform() * sum;
    size_t j = 0;
    while (j + 1 < shares.size() && (u >= shares[j] || shares[j] == 0)) u -= shares[j++];
    if (shares[j] == 0) return {};  // rounding
    return Other{j, weights_[j].d * (sum / (shares[j] * survival))};
  }

  // What is not hidden of a face, or of what is behind the ray's end if there is none.
  S unhidden(const BlurredRay<S>& ray, const Face& face) {
    ++rays_.shadow;
    const size_t met = look(ray);
    if (s_.blur().weights == BlurWeights::kOrdered) {
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

 private:
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
    if constexpr (!std::is_same_v<S, double>) {
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

  const BlurredScene& s_;
  const Scene& scene_;
  RayCount& rays_;
  std::vector<BlurHit> found_;
  std::vector<BlurredFace<S>> hits_;
  std::vector<S> weights_;
};

}  // namespace limn
