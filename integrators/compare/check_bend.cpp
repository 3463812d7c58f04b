// Slopes of the image on both sides of a parameter's value.
#include "integrators/compare/check_bend.h"

#include <cmath>

#include "limn/core/parameter.h"
#include "limn/integrators/differences.h"
#include "limn/integrators/statistics.h"

namespace limn {
namespace {

// (I(reach) - I(0)) / reach in batches, with negative reach on the side before: a central
// difference around half the way. No batches if the run was interrupted.
std::vector<Moments::Batch> slope_of_blocks(const Scene& scene, const std::string& name,
                                            double reach, int block, const RunSettings& settings,
                                            const std::optional<Blur>& blur) {
  const DifferenceJob job{name, {0.5 * std::fabs(reach)}, {{1}}};
  const CentralDifferences run = central_differences(
      find_parameter(scene, name).moved(scene, 0.5 * reach), {job}, block, settings, false, blur);
  if (run.spp < settings.spp) return {};
  return run.estimates[0][0].blocks.kept();
}

// With X(r) the slope over the way r after the value minus that over r before it, X is K + c r for
// small r where the image bends by K, and 2 X(r) - X(2 r) = K. All from the same samples. No
// batches if the run was interrupted.
std::vector<Moments::Batch> bend_of_blocks(const Scene& scene, const std::string& name, double step,
                                           int block, const RunSettings& settings,
                                           const std::optional<Blur>& blur) {
  std::vector<Moments::Batch> batches;
  RunSettings own = settings;
  int done = 0;
  if (settings.progress) {
    own.progress = [&](double part) { settings.progress(0.25 * (done + part)); };
  }
  for (const auto& [reach, factor] : {std::pair{step, 2.0}, {2 * step, -1.0}}) {
    for (const double side : {1.0, -1.0}) {
      auto more = slope_of_blocks(scene, name, side * reach, block, own, blur);
      if (more.empty() || (done > 0 && batches.size() != more.size())) return {};
      if (done++ == 0) {
        batches = more;
        for (Moments::Batch& batch : batches) batch.sums.assign(batch.sums.size(), 0.0);
      }
      for (size_t b = 0; b < batches.size(); ++b)
        for (size_t i = 0; i < batches[b].sums.size(); ++i)
          batches[b].sums[i] += side * factor * more[b].sums[i];
    }
  }
  return batches;
}

}  // namespace

std::optional<Bend> find_bend(const Scene& scene, const std::string& name, double step,
                              const Windows& windows, const std::vector<double>& weights,
                              const RunSettings& settings, const std::optional<Blur>& blur) {
  const auto batches = bend_of_blocks(scene, name, step, windows.fine(), settings, blur);
  const std::vector<double> of_blocks = windows.spread(weights);
  Moments moments(1), single(windows.size());
  for (const Moments::Batch& batch : batches) {
    double sum = 0;
    for (size_t i = 0; i < of_blocks.size(); ++i) sum += of_blocks[i] * batch.sums[i];
    moments.add_batch({sum}, batch.samples);
    single.add_batch(windows.gather(batch.sums), batch.samples);
  }
  if (moments.batches() < 2) return std::nullopt;
  Bend bend;
  bend.sum.value = moments.mean(0);
  bend.sum.error = std::sqrt(moments.variance(0));
  if (bend.sum.value != 0)
    bend.sum.z = normal_from_student(bend.sum.value / bend.sum.error, moments.degrees());
  double variance = 0;
  for (size_t k = 0; k < weights.size(); ++k) {
    const double error = std::sqrt(single.variance(k));
    bend.most += std::fabs(weights[k]) * magnitude_without_noise(single.mean(k), error);
    variance += weights[k] * weights[k] * error * error;
  }
  bend.most_error = std::sqrt(variance);
  return bend;
}

}  // namespace limn
