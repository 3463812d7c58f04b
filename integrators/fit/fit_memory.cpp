// The loss of a step, from images that are new or carried on from the last one.
#include <algorithm>
#include <cmath>
#include <utility>

#include "integrators/fit/fit_impl.h"
#include "limn/core/error.h"
#include "limn/core/rng.h"
#include "limn/integrators/methods.h"

namespace limn {
namespace {

constexpr int kCheckBlock = 8;     // pixels
constexpr int kCheckSamples = 16;  // times those of the step

// Of the sum of a weighted image: its blocks are independent, but for samples that pixels share, so
// that the root of the sum of their squares is its standard error where the mean is 0.
double z_of(const std::vector<double>& image, int width, int height) {
  double sum = 0, squares = 0;
  for (const double x : sum_blocks(image, width, height, kCheckBlock)) {
    sum += x;
    squares += x * x;
  }
  return squares > 0 ? sum / std::sqrt(squares) : 0;
}

}  // namespace

void Fit::Impl::begin_memory() {
  for (size_t v = 0; v < views.size(); ++v) {
    const std::string& sky = views[v].scene.environment_id;
    const auto moves_sky = [&](const FitParameter& p) {
      return p.in_view(v) && !sky.empty() && p.name().starts_with(sky + ".");
    };
    kept_.emplace_back().keep_environment(std::ranges::none_of(parameters_, moves_sky));
  }
  if (!options_.carry_images) {
    if (options_.check_steps == 0) return;
    throw InputError(
        "check_steps is for images that are carried on: add --memory images (Python: "
        "carry_images=True)");
  }
  if (is_exact() || over_faces()) {
    throw InputError(
        "the optimiser lbfgs and points over faces take one image, whose noise no step has to "
        "carry: leave out --memory images (Python: carry_images)");
  }
  const LossOptions loss = loss_options();
  running_.assign(views.size(), RunningImages({.method = loss.method, .points = loss.points}));
}

LossOptions Fit::Impl::loss_options() const {
  return {options_.loss, options_.pyramid,
          options_.blur.particles ? Method("light-traced") : loss_method(options_.backward.method),
          options_.backward.points, is_exact()};
}

RunSettings Fit::Impl::loss_settings(size_t view) const {
  RunSettings own = view_settings(view);
  own.spp = samples_of(options_.loss_spp > 0 ? options_.loss_spp : settings_.spp);
  return own;
}

LossResult Fit::Impl::loss_of(size_t view, const RunSettings& settings) {
  const FitView& v = views[view];
  if (running_.empty()) return image_loss(v.scene, v.target, loss_options(), settings, v.mask);
  const ImagePair* pair = running_[view].pair(v.scene, settings);
  if (!pair) return {};
  LossResult loss = pair_loss(v.scene, v.target, loss_options(), *pair, v.mask);
  loss.spp = settings.spp;
  return loss;
}

bool Fit::Impl::add_check(size_t view, const RunSettings& settings, FitRecord& record) {
  const FitView& v = views[view];
  RunSettings own = settings;
  own.spp *= kCheckSamples;
  const std::optional<ImagePair> fresh = running_[view].fresh(own);
  if (!fresh) return false;
  const ImagePair& pair = *running_[view].pair(v.scene, settings);
  // Weights from one of the images, differences from the other: their noise is independent.
  const ImagePair one{fresh->a, fresh->a, std::vector<double>(fresh->a.size())};
  const Image slopes = pair_loss(v.scene, v.target, loss_options(), one, v.mask).adjoint;
  std::vector<double> off(fresh->b.size()), weighted(off.size());
  for (size_t i = 0; i < off.size(); ++i) {
    off[i] = 0.5 * (pair.a[i] + pair.b[i]) - fresh->b[i];
    weighted[i] = off[i] * static_cast<double>(slopes.data[i]);
  }
  if (!record.check) record.check.emplace();
  const double share = 1 / std::sqrt(static_cast<double>(views.size()));
  record.check->brightness += share * z_of(off, slopes.width, slopes.height);
  record.check->target += share * z_of(weighted, slopes.width, slopes.height);
  return true;
}

bool Fit::Impl::carry_images(const FitState& before) {
  bool done = true;
  try {
    for (size_t v = 0; v < views.size() && done; ++v) {
      done = running_[v].carry(views[v].scene, loss_settings(v));
    }
  } catch (...) {
    put(before);
    throw;
  }
  if (!done) put(before);
  return done;
}

}  // namespace limn
