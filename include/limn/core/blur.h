#pragma once
// Blurred triangles (Quinn 2021, after Liu et al. 2019): a face is a plane whose opacity fades over
// the face's sides. Many faces may be met by one ray, and weights say how much is seen of each, so
// that images are smooth functions of the scene. Opacities and weights over any scalar; which faces
// a ray meets: blur_tracer.h.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "limn/core/dual.h"
#include "limn/core/mesh.h"

namespace limn {

// kOrdered: neighbours share opacity, others hide each other front to back, softly with gamma > 0.
// kPublished: opacities times exp(-depth / gamma), normalised (Quinn 2021, 4.3).
enum class BlurWeights { kOrdered, kPublished };

struct Blur {
  double sigma = 0;  // square of the width over which sides fade [scene units squared]
  double gamma = 0;  // depth over which surfaces mix [scene units]
  BlurWeights weights = BlurWeights::kOrdered;
  bool particles = false;  // caustics of area lights by particles (blurred_particles.h)

  // How far faces extend beyond their sides [scene units]; as far inside they are opaque.
  double reach() const;
  // Behind an opaque face by this, surfaces have no weight [scene units].
  double depth() const;
};

// Opacities below this are 0, those above 1 minus this are 1; not tuned.
inline constexpr double kLeastOpacity = 1e-7;

// alpha(d) = sigmoid(d |d| / sigma) (Quinn 2021, 4.1), shifted and scaled so that it is continuous
// where it is cut. d: distance to the nearest side, positive inside. alpha(d) + alpha(-d) = 1.
template <class S>
S blur_opacity(const S& d, double sigma) {
  using std::exp;
  static const double most = std::log((1 - kLeastOpacity) / kLeastOpacity);
  const double u = value(d) * std::fabs(value(d)) / sigma;
  if (u >= most) return 1.0;
  if (u <= -most) return 0.0;
  const S alpha = 1.0 / (1.0 + exp(d * d * (u > 0 ? -1 / sigma : 1 / sigma)));
  return (alpha - kLeastOpacity) * (1 / (1 - 2 * kLeastOpacity));
}

// Signed distance of x, a point of the face's plane, to the nearest of its sides; positive inside.
template <class S>
S distance_to_sides(const std::array<Vec3<S>, 3>& corners, const Vec3<S>& x) {
  int side = 0;
  double foot = 0, least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    const Vec3d a = value(corners[k]), u = value(corners[(k + 1) % 3]) - a, q = value(x) - a;
    const double s = std::clamp(dot(q, u) / dot(u, u), 0.0, 1.0);
    const double squared = length_squared(q - u * s);
    if (squared >= least) continue;
    least = squared;
    side = k;
    foot = s;
  }
  const Vec3<S>&a = corners[side], &b = corners[(side + 1) % 3];
  if (foot == 0) return -length(x - a);
  if (foot == 1) return -length(x - b);
  const Vec3<S> n = cross(corners[1] - corners[0], corners[2] - corners[0]);
  return dot(cross(n, b - a), x - a) / (length(n) * length(b - a));
}

// A face that a ray meets.
template <class S>
struct BlurredFace {
  FaceRef face;
  S depth;    // along the ray
  S opacity;  // in [0, 1]
  bool front;
};

namespace detail {

template <class S>
S not_negative(const S& a) {
  return value(a) > 0 ? a : S(0.0);
}

// Solves the system by elimination. rows: n by n + 1, row-major; destroyed.
template <class S>
void solve(std::vector<S>& rows, std::vector<S>& x) {
  const size_t n = x.size();
  const auto at = [&](size_t i, size_t j) -> S& { return rows[i * (n + 1) + j]; };
  for (size_t i = 0; i < n; ++i) {
    size_t pivot = i;
    for (size_t k = i + 1; k < n; ++k) {
      if (std::fabs(value(at(k, i))) > std::fabs(value(at(pivot, i)))) pivot = k;
    }
    for (size_t j = i; pivot != i && j <= n; ++j) std::swap(at(i, j), at(pivot, j));
    for (size_t k = i + 1; k < n; ++k) {
      const S factor = at(k, i) / at(i, i);
      for (size_t j = i; j <= n; ++j) at(k, j) = at(k, j) - factor * at(i, j);
    }
  }
  for (size_t i = n; i-- > 0;) {
    S sum = at(i, n);
    for (size_t j = i + 1; j < n; ++j) sum = sum - at(i, j) * x[j];
    x[i] = sum / at(i, i);
  }
}

// w_k = s_k (1 - sum of o_kj w_j over j that are no neighbours), where s_k = alpha_k over the
// opacities of k and its neighbours, if those are more than 1. o_kj = [z_j < z_k], softly.
template <class S, class Neighbours>
void ordered_weights(std::span<const BlurredFace<S>> hits, double gamma,
                     const Neighbours& neighbours, std::vector<S>& weights) {
  using std::exp;
  const size_t n = hits.size();
  std::vector<S> rows(gamma > 0 ? n * (n + 1) : 0);
  for (size_t k = 0; k < n; ++k) {
    S shared = hits[k].opacity, hidden = 0.0;
    for (size_t j = 0; j < n; ++j) {
      if (j == k) continue;
      if (neighbours(hits[k], hits[j])) {
        shared = shared + hits[j].opacity;
      } else if (gamma > 0) {
        rows[k * (n + 1) + j] = 1.0 / (1.0 + exp((hits[j].depth - hits[k].depth) * (1 / gamma)));
      } else if (j < k) {
        hidden = hidden + weights[j];
      }
    }
    const S opacity = value(shared) > 1 ? hits[k].opacity / shared : hits[k].opacity;
    weights[k] = opacity * not_negative(1.0 - hidden);
    if (gamma == 0) continue;
    for (size_t j = 0; j < n; ++j) rows[k * (n + 1) + j] = rows[k * (n + 1) + j] * opacity;
    rows[k * (n + 1) + k] = 1.0;
    rows[k * (n + 1) + n] = opacity;
  }
  if (gamma > 0) solve(rows, weights);
  S sum = 0.0;
  for (S& w : weights) sum = sum + (w = not_negative(w));
  if (!(value(sum) > 1)) return;
  for (S& w : weights) w = w / sum;
}

}  // namespace detail

// How much is seen of each hit, in the order of their depths; the rest of 1 is what is behind all
// of them. neighbours(a, b): whether the hits share opacity. far: depth of what is behind
// (kPublished).
template <class S, class Neighbours>
void blur_weights(std::span<const BlurredFace<S>> hits, const Blur& blur, double far,
                  const Neighbours& neighbours, std::vector<S>& weights) {
  using std::exp;
  weights.assign(hits.size(), S(0.0));
  if (hits.empty()) return;
  if (blur.weights == BlurWeights::kOrdered) {
    detail::ordered_weights(hits, blur.gamma, neighbours, weights);
    return;
  }
  const S first = hits[0].depth;
  S sum = exp((first - far) * (1 / blur.gamma));
  for (size_t k = 0; k < hits.size(); ++k) {
    weights[k] = hits[k].opacity * exp((first - hits[k].depth) * (1 / blur.gamma));
    sum = sum + weights[k];
  }
  for (S& w : weights) w = w / sum;
}

}  // namespace limn
