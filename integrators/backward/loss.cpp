// Losses of an image, with the derivative for every pixel.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "integrators/methods/render_seeds.h"
#include "limn/core/error.h"
#include "limn/core/image.h"
#include "limn/core/names.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/methods.h"

namespace limn {

namespace {

// The derivative of srgb_encode().
double srgb_slope(double linear) {
  return linear <= kSrgbLinear ? 12.92 : 1.055 / 2.4 * std::pow(linear, 1 / 2.4 - 1);
}

// Of one value: the loss of two independent estimates, and the derivative of what their mean makes.
struct ValueLoss {
  double loss, adjoint;
};
ValueLoss value_loss(LossKind kind, double a, double b, double target) {
  constexpr double kDark = 0.01;  // keeps dark pixels from ruling the sum; not tuned
  const double image = 0.5 * (a + b), off = image - target;
  const double distance = std::fabs(off);
  const double sign = off > 0 ? 1.0 : off < 0 ? -1.0 : 0.0;
  switch (kind) {
    case LossKind::kL2:
      return {(a - target) * (b - target), 2 * off};
    case LossKind::kRelativeL2: {
      const double weight = 1 / (target * target + kDark);
      return {weight * (a - target) * (b - target), 2 * weight * off};
    }
    case LossKind::kL1:
      return {distance, sign};
    case LossKind::kL1Srgb:
      return {std::fabs(srgb_encode(image) - srgb_encode(target)), sign * srgb_slope(image)};
    case LossKind::kSmape: {
      const double sum = std::fabs(image) + std::fabs(target) + kDark;
      return {distance / sum, (sign - distance / sum * (image < 0 ? -1 : 1)) / sum};
    }
  }
  return {};
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

// An image pair and its target at one size, and what each pixel weighs.
struct Level {
  int width, height;
  std::vector<double> weights;       // height by width
  std::vector<double> a, b, target;  // of 3 channels
};

// At half the size: weighted means of blocks of two by two pixels; a last row or column that is odd
// makes blocks of its own.
Level halved(const Level& level) {
  Level half{(level.width + 1) / 2, (level.height + 1) / 2, {}, {}, {}, {}};
  const size_t pixels = static_cast<size_t>(half.width) * half.height;
  half.weights.resize(pixels);
  for (auto* image : {&half.a, &half.b, &half.target}) image->resize(3 * pixels);
  const std::pair<const std::vector<double>*, std::vector<double>*> images[] = {
      {&level.a, &half.a}, {&level.b, &half.b}, {&level.target, &half.target}};
  for (int y = 0; y < level.height; ++y) {
    for (int x = 0; x < level.width; ++x) {
      const size_t from = static_cast<size_t>(y) * level.width + x;
      const size_t to = static_cast<size_t>(y / 2) * half.width + x / 2;
      const double weight = level.weights[from];
      if (weight == 0) continue;  // its target may be anything
      half.weights[to] += weight;
      for (const auto& [fine, coarse] : images) {
        for (size_t c = 0; c < 3; ++c) (*coarse)[3 * to + c] += weight * (*fine)[3 * from + c];
      }
    }
  }
  for (size_t i = 0; i < 3 * pixels; ++i) {
    if (half.weights[i / 3] == 0) continue;
    for (auto* image : {&half.a, &half.b, &half.target}) (*image)[i] /= half.weights[i / 3];
  }
  return half;
}

// Adds the share of a level to `loss`, and its derivative with respect to the pixels of
// the finest level, `finest` and twice as wide `doublings` times, to `adjoint`.
void add_level(const Level& level, const Level& finest, int doublings, const LossOptions& options,
               double& loss, std::vector<double>& adjoint) {
  const double share = 1.0 / options.levels;
  std::vector<double> slopes(level.a.size());
  for (size_t i = 0; i < slopes.size(); ++i) {
    const double weight = level.weights[i / 3];
    if (weight == 0) continue;
    const ValueLoss value = value_loss(options.kind, level.a[i], level.b[i], level.target[i]);
    loss += share * weight * value.loss;
    slopes[i] = share * value.adjoint;
  }
  for (size_t i = 0; i < adjoint.size(); ++i) {
    const size_t x = i / 3 % finest.width >> doublings, y = i / 3 / finest.width >> doublings;
    // A pixel's share of its block's mean, times what the block weighs.
    adjoint[i] += finest.weights[i / 3] * slopes[3 * (y * level.width + x) + i % 3];
  }
}

void check_method(const Method& method) {
  if (method->image && !method->image->looks_around) return;
  std::vector<std::string> known;
  for (const MethodType& type : method_types())
    if (type.image && !type.image->looks_around) known.push_back(type.name);
  throw InputError(unknown_name("method for the images of a loss", method.name(), known));
}

}  // namespace

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

Method loss_method(const Method& backward) {
  return backward->closed_light ? backward : Method(Task::kImage);
}

int most_pyramid_levels(const Scene& scene) {
  int levels = 1;
  for (int size = std::max(scene.film.crop_width, scene.film.crop_height); size > 1;
       size = (size + 1) / 2) {
    ++levels;
  }
  return levels;
}

std::string bias_warning(LossKind kind) {
  return fmt::format(
      "the gradient of {} is biased where the image's noise is not small beside its difference "
      "from the target",
      kLosses[static_cast<int>(kind)]);
}

LossResult image_loss(const Scene& scene, const Image& target, const LossOptions& options,
                      const RunSettings& settings, const Image& mask) {
  check_loss_images(scene, target, mask);
  if (options.levels < 1 || options.levels > most_pyramid_levels(scene)) {
    throw InputError(fmt::format("a pyramid of {} levels: the film has 1 to {}", options.levels,
                                 most_pyramid_levels(scene)));
  }
  check_method(options.method);
  std::vector<uint64_t> seeds{settings.seed};
  // Of streams that no other seed has.
  const uint64_t stream = mix_bits(settings.seed);
  if (!options.one_image()) seeds = {mix_bits(stream + 1), mix_bits(stream + 2)};
  const auto rendered =
      render_seeds(scene, settings, seeds, {.method = options.method, .points = options.points});
  const RenderResult &a = rendered.front(), &b = rendered.back();
  LossResult result;
  result.spp = std::min(a.spp, b.spp);
  if (a.non_finite.count + b.non_finite.count > 0) {
    throw InputError("loss: " + (a.non_finite.count > 0 ? a : b).non_finite.message());
  }
  if (result.spp == 0) return result;
  const size_t values = a.radiance.size();
  Level finest{target.width, target.height, pixel_weights(scene, mask), {}, {}, {}};
  for (size_t i = 0; i < values; ++i) {
    finest.a.push_back(a.radiance.mean(i));
    finest.b.push_back(b.radiance.mean(i));
    finest.target.push_back(target.channels == 3 ? target.data[i] : target.data[i / 3]);
  }
  std::vector<double> adjoint(values);
  Level level = finest;
  for (int k = 0; k < options.levels; ++k) {
    if (k > 0) level = halved(level);
    add_level(level, finest, k, options, result.value, adjoint);
  }
  result.adjoint = Image(target.width, target.height, 3);
  double variance = 0;
  for (size_t i = 0; i < values; ++i) {
    result.adjoint.data[i] = static_cast<float>(adjoint[i]);
    // To first order, with half of the adjoint for each image.
    const double slope = 0.5 * adjoint[i];
    const double both = a.radiance.variance(i) + b.radiance.variance(i);
    variance += slope * slope * (options.one_image() ? 2 * both : both);
  }
  result.error = std::sqrt(variance);
  return result;
}

}  // namespace limn
