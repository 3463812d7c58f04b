// Losses of an image, with the derivative for every pixel.
#include <fmt/format.h>

#include <cmath>

#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/render.h"

namespace limn {

namespace {

struct LossName {
  const char* name;
  LossKind kind;
};
constexpr LossName kLosses[] = {
    {"l2", LossKind::kL2}, {"relative-l2", LossKind::kRelativeL2}, {"l1", LossKind::kL1}};

// Of one value: the loss of two independent estimates, and the derivative of what their mean makes.
struct ValueLoss {
  double loss, adjoint;
};
ValueLoss value_loss(LossKind kind, double a, double b, double target) {
  const double mean = 0.5 * (a + b) - target;
  if (kind == LossKind::kL1) return {std::fabs(mean), mean > 0 ? 1.0 : mean < 0 ? -1.0 : 0.0};
  // The constant keeps dark pixels from ruling the sum; not tuned.
  const double weight = kind == LossKind::kL2 ? 1 : 1 / (target * target + 0.01);
  return {weight * (a - target) * (b - target), 2 * weight * mean};
}

void check_size(const Scene& scene, const Image& image, const char* what,
                const std::string& place) {
  const Film& film = scene.film;
  if (image.width == film.crop_width && image.height == film.crop_height &&
      (image.channels == 3 || image.channels == 1)) {
    return;
  }
  throw InputError(
      {place},
      fmt::format("the {} has {} x {} pixels of {} channels, but the film {} x {}: it must be of "
                  "the film's size, with three channels or one",
                  what, image.width, image.height, image.channels, film.crop_width,
                  film.crop_height));
}

// Of each pixel; they add up to one over all values of the image.
std::vector<double> pixel_weights(const Scene& scene, const Image& mask) {
  const size_t pixels = static_cast<size_t>(scene.film.crop_width) * scene.film.crop_height;
  std::vector<double> weights(pixels, 1);
  double sum = 0;
  for (size_t i = 0; i < pixels; ++i) {
    if (!mask.data.empty()) weights[i] = mask.data[i * mask.channels];
    sum += 3 * weights[i];
  }
  for (double& w : weights) w /= sum;
  return weights;
}

}  // namespace

LossKind loss_kind(const std::string& name) {
  for (const LossName& loss : kLosses)
    if (name == loss.name) return loss.kind;
  throw InputError(unknown_name("loss", name, names_of(kLosses)));
}

void check_loss_images(const Scene& scene, const Image& target, const Image& mask,
                       const std::string& target_place, const std::string& mask_place) {
  check_size(scene, target, "target", target_place);
  const auto place = [&](size_t pixel) {
    return fmt::format("in column {}, row {}", pixel % target.width, pixel / target.width);
  };
  double sum = 0;
  if (!mask.data.empty()) {
    check_size(scene, mask, "mask", mask_place);
    for (size_t i = 0; i < mask.data.size(); i += mask.channels) {
      const size_t pixel = i / mask.channels;
      if (!(mask.data[i] >= 0 && std::isfinite(mask.data[i]))) {
        throw InputError({mask_place}, "the mask is negative or not finite " + place(pixel));
      }
      for (int c = 1; c < mask.channels; ++c) {
        if (mask.data[i + c] == mask.data[i]) continue;
        throw InputError({mask_place}, "the mask's channels differ " + place(pixel) +
                                           ": it must have one channel, or three that are alike");
      }
      sum += mask.data[i];
    }
    if (sum == 0) {
      throw InputError({mask_place}, "the mask is zero everywhere: no pixel is left for the loss");
    }
  }
  for (size_t i = 0; i < target.data.size(); ++i) {
    const size_t pixel = i / target.channels;
    const bool seen = mask.data.empty() || mask.data[pixel * mask.channels] > 0;
    if (std::isfinite(target.data[i]) || !seen) continue;
    throw InputError({target_place}, "the target is not finite " + place(pixel) +
                                         ": a mask that is zero there leaves it out");
  }
}

LossResult image_loss(const Scene& scene, const Image& target, LossKind kind,
                      const RunSettings& settings, const Image& mask) {
  check_loss_images(scene, target, mask);
  RenderResult images[2];
  for (int i = 0; i < 2; ++i) {
    RunSettings own = settings;
    own.store = nullptr;                                   // of what the loss is for
    own.seed = mix_bits(mix_bits(settings.seed) + 1 + i);  // of streams that no other seed has
    images[i] = render(scene, own);
  }
  LossResult result;
  result.spp = std::min(images[0].spp, images[1].spp);
  if (images[0].non_finite.count + images[1].non_finite.count > 0) {
    throw InputError("loss: " + images[images[0].non_finite.count == 0].non_finite.message());
  }
  if (result.spp == 0) return result;
  result.adjoint = Image(target.width, target.height, 3);
  const size_t values = images[0].radiance.size();
  const std::vector<double> weights = pixel_weights(scene, mask);
  double variance = 0;
  for (size_t i = 0; i < values; ++i) {
    const double weight = weights[i / 3];
    if (weight == 0) continue;
    const double t = target.channels == 3 ? target.data[i] : target.data[i / 3];
    const double a = images[0].radiance.mean(i), b = images[1].radiance.mean(i);
    const ValueLoss loss = value_loss(kind, a, b, t);
    result.value += weight * loss.loss;
    result.adjoint.data[i] = static_cast<float>(weight * loss.adjoint);
    // To first order, with half of the adjoint for each image.
    const double slope = 0.5 * weight * loss.adjoint;
    variance += slope * slope * (images[0].radiance.variance(i) + images[1].radiance.variance(i));
  }
  result.error = std::sqrt(variance);
  return result;
}

}  // namespace limn
