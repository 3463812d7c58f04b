// How paths choose among smooth rays and rough lobes.
#include <algorithm>

#include "limn/core/bsdf.h"

namespace limn {

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
  if (by == SmoothShares::By::kNone) {
    shares.rough = rough / static_cast<double>(shares.count + rough);
    std::fill_n(shares.ray.begin(), shares.count, 1.0 / (shares.count + rough));
    return shares;
  }
  double smooth = 0;
  for (int k = 0; k < shares.count; ++k) {
    // Without what refraction scales radiance by.
    shares.ray[k] = max_channel(rays[k].weight) * (rays[k].eta * rays[k].eta);
    smooth += shares.ray[k];
  }
  shares.rough = rough ? std::clamp(1 - smooth, 0.0, bsdf.lobe(at).albedo) : 0;
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
