// The first steps of a fit, by derivatives of a scene whose faces are blurred. They are not 0 where
// an object is only near its target, so that it moves towards what it does not overlap yet. The
// adjoint is that of the sharp image: with that of a blurred one, which is brighter than the
// target, objects leave the view (scenes/regularised). So a step is no gradient of a loss, but its
// mean is 0 where the image meets the target, whatever sigma is.
// The step is the product of derivative images and adjoint, and four numbers take a pass: arrays
// must be small.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <utility>

#include "integrators/estimates/batches.h"
#include "integrators/fit/fit_impl.h"
#include "integrators/methods/blurred_estimator.h"
#include "limn/core/blur_tracer.h"
#include "limn/core/error.h"
#include "limn/core/exposure.h"

namespace limn {
namespace {

constexpr size_t kMostNumbers = 1024;  // of an array; not tuned

// Blurred faces have no interpolated normals.
Scene flat(const Scene& scene) {
  Scene copy = deep_copy(scene);
  for (Shape& shape : copy.shapes) {
    shape.mesh.normal_source = NormalSource::kFace;
    shape.mesh.normals.clear();
    shape.mesh.normal_ids.clear();
  }
  return copy;
}

}  // namespace

void Fit::Impl::check_blur() const {
  const Blur& first = options_.blur;
  if ((options_.blur_steps > 0) != (first.sigma > 0)) {
    throw InputError(
        "a fit that begins blurred needs both `sigma`, of the first step, and `blur_steps`");
  }
  if (options_.blur_steps == 0) {
    if (first.gamma == 0 && options_.sigma_end == 0) return;
    throw InputError("gamma and sigma_end are for fits that begin blurred: give sigma, too");
  }
  if (options_.sigma_end > first.sigma) {
    throw InputError("sigma_end must be at most sigma: faces get sharper from step to step");
  }
  if (!options_.backward.terms.empty()) {
    throw InputError("a fit that begins blurred takes all terms: leave out `terms`");
  }
  if (is_exact() || over_faces()) {
    throw InputError("fits that begin blurred need random points and another optimiser than lbfgs");
  }
  for (const FitParameter& p : parameters_) {
    if (p.size() <= kMostNumbers) continue;
    throw InputError(fmt::format(
        "\"{}\" is an array of {} numbers: a fit that begins blurred takes at most {}, as it "
        "derives image after image",
        p.name(), p.size(), kMostNumbers));
  }
  for (const FitView& view : views) check_blurred(flat(view.scene));
}

Blur Fit::Impl::blur() const {
  if (steps >= options_.blur_steps) return {};
  const Blur& first = options_.blur;
  const double last = options_.sigma_end > 0 ? options_.sigma_end : first.sigma / 100;
  const double part = static_cast<double>(steps) / std::max(1, options_.blur_steps - 1);
  const double factor = std::pow(last / first.sigma, part);
  return {first.sigma * factor, first.gamma * std::sqrt(factor), first.weights, first.particles};
}

bool Fit::Impl::add_blurred(size_t view, const Image& adjoint, const RunSettings& settings,
                            std::vector<std::vector<double>>& gradients) const {
  std::vector<BlurredNumber> list;            // channels of colours one by one
  std::vector<std::pair<size_t, size_t>> of;  // which parameter of the fit, which of its numbers
  std::vector<Parameter> own;
  for (size_t i = 0; i < parameters_.size(); ++i) {
    const Parameter* const found = parameters_[i].in_view(view);
    if (!found) continue;
    own.push_back(*found);
    gradients[i].resize(found->numbers());
    for (size_t c = 0; c < found->numbers(); ++c) {
      of.emplace_back(i, c);
      if (!found->colour) {
        list.push_back({*found, c});
        continue;
      }
      const std::string channel = fmt::format("{}.{}", found->name, "rgb"[c]);
      list.push_back({find_parameter(views[view].scene, channel)});
    }
  }
  if (list.empty()) return true;
  const Scene scene = flat(views[view].scene);
  const Blur blur = resolved(this->blur(), scene);
  const auto passes = blurred_passes(scene, blur, list, settings.threads);
  const EstimatorsAt at = [&](double u) {
    return EstimatorsAtTime{{}, blurred_passes(scene, blur, list, settings.threads, u)};
  };
  int64_t spp = 0;
  NonFinite non_finite;
  std::vector<double> sums(list.size());
  const auto take = [&](const Batch& batch, const auto& done) {
    for (size_t k = 0; k < list.size(); ++k) {
      const std::vector<double>& image = done[k / kLanes].images[k % kLanes];
      for (size_t j = 0; j < image.size(); ++j) {
        sums[k] += image[j] * static_cast<double>(adjoint.data[j]);
      }
    }
    for (const BatchSums& pass : done) non_finite.merge(pass.non_finite);
    spp += batch.count();
  };
  run_batches(passes, settings, Stopwatch(), take, needs_times(scene, own) ? at : EstimatorsAt());
  if (non_finite.count > 0) throw InputError("gradient: " + non_finite.message());
  if (spp < settings.spp) return false;
  for (size_t k = 0; k < list.size(); ++k) {
    gradients[of[k].first][of[k].second] += sums[k] / static_cast<double>(spp);
  }
  return true;
}

}  // namespace limn
