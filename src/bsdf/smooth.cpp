// How paths choose among smooth rays and rough lobes.
#include <algorithm>

#include "limn/core/bsdf.h"

namespace limn {

namespace {

// Shares in proportion to .1, .5 or .9, by the weights of the choices. Equal shares would let the
// weight of a path double at each total reflection that it takes by chance, and again at each
// surface that it passes: inside of glass no number of samples would do.
SmoothShares in_steps(const SmoothRays<double>& rays, const SmoothShares& weights, bool rough,
                      double sum) {
  const auto step = [&](double weight) {
    return weight < 0.25 * sum ? 0.1 : weight < 0.75 * sum ? 0.5 : 0.9;
  };
  SmoothShares shares = weights;
  double total = rough ? step(shares.rough) : 0;
  shares.rough = total;
  for (int k = 0; k < shares.count; ++k) {
    shares.ray[k] = rays[k].total ? 0 : step(weights.ray[k]);
    total += shares.ray[k];
  }
  if (!(total > 0)) return shares;
  shares.rough /= total;
  for (double& share : shares.ray) share /= total;
  return shares;
}

}  // namespace

SmoothShares smooth_shares(const Bsdf& bsdf, const Vec3d& n, const Vec3d& wi, const Rgb<double>* at,
                           SmoothShares::By by) {
  // Where light passes a surface less and less, up to the critical angle, its derivative grows
  // without bound: chosen with the share 1 - F that passes, its square would have no mean. With a
  // least share it has one. Not tuned.
  constexpr double kLeast = 0.1;
  SmoothRays<double> rays;
  SmoothShares shares;
  shares.count = bsdf.smooth_rays(n, wi, rays, at);
  const int rough = bsdf.is_rough() ? 1 : 0;
  double smooth = 0;
  for (int k = 0; k < shares.count; ++k) {
    // Without what refraction scales radiance by.
    shares.ray[k] = max_channel(rays[k].weight) * (rays[k].eta * rays[k].eta);
    smooth += shares.ray[k];
  }
  shares.rough = rough ? std::clamp(1 - smooth, 0.0, bsdf.lobe(at).albedo) : 0;
  if (by == SmoothShares::By::kSteps) return in_steps(rays, shares, rough, smooth + shares.rough);
  const double sum = smooth + shares.rough;
  int choices = rough;
  for (int k = 0; k < shares.count; ++k) choices += !rays[k].total;
  if (choices == 0) return shares;
  const double least = by == SmoothShares::By::kSlope ? kLeast : 0;
  const auto share = [&](double weight) {
    return sum > 0 ? least + (1 - choices * least) * (weight / sum) : 1.0 / choices;
  };
  for (int k = 0; k < shares.count; ++k) {
    shares.ray[k] = rays[k].total ? 0 : share(shares.ray[k]);
  }
  if (rough) shares.rough = share(shares.rough);
  return shares;
}

}  // namespace limn
