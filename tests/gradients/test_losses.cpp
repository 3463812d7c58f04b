// Losses: without bias however noisy images are, pyramids, and what does not fit.
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/error.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/render.h"
#include "support/scenes.h"

namespace limn {
namespace {

Scene gloss_scene(const TempFiles& files) {
  SceneParts parts;
  parts.origin = {0, 3, 4};
  parts.body = ball_over_gloss(files, 0.4);
  return make_scene(files, parts);
}

// At the target itself both the loss and its gradient have mean zero, however noisy the images are.
TEST(Losses, AreUnbiasedAtTheirTarget) {
  const TempFiles files;
  const Scene scene = gloss_scene(files);
  RunSettings settings;
  settings.spp = 2048;
  settings.threads = 2;
  const RenderResult truth = render(scene, settings);
  const Image target = mean_image(truth.radiance, scene.film.crop_width, scene.film.crop_height);
  for (const LossKind kind : {LossKind::kL2, LossKind::kRelativeL2}) {
    const std::string name = kLosses[static_cast<int>(kind)];
    Moments values(2);
    BackwardOptions options;
    options.parameters = {"clay.reflectance"};
    settings.spp = 2;
    for (settings.seed = 100; settings.seed < 164; ++settings.seed) {
      const LossResult loss = image_loss(scene, target, {kind}, settings);
      const BackwardResult result = backward(scene, loss.adjoint, options, settings);
      values.add_batch({loss.value, result.parameters[0].moments.mean(0)}, 1);
    }
    EXPECT_LT(std::fabs(values.mean(0)), 4.5 * std::sqrt(values.variance(0))) << name;
    EXPECT_LT(std::fabs(values.mean(1)), 4.5 * std::sqrt(values.variance(1))) << name;
  }
}

// The loss of a pyramid from its definition: every block of 2^k by 2^k pixels by itself.
double pyramid_loss(const std::vector<double>& a, const std::vector<double>& b, const Image& target,
                    const Image& mask, int levels, bool relative) {
  const int width = target.width, height = target.height;
  double all = 0, loss = 0;
  for (const float w : mask.data) all += 3 * w;
  for (int size = 1, k = 0; k < levels; ++k, size *= 2) {
    for (int y = 0; y < height; y += size) {
      for (int x = 0; x < width; x += size) {
        for (int c = 0; c < 3; ++c) {
          double weight = 0, sums[3] = {};
          for (int i = 0; i < size * size; ++i) {
            const int u = x + i % size, v = y + i / size;
            if (u >= width || v >= height || mask.at(u, v, 0) == 0) continue;
            const double w = mask.at(u, v, 0);
            const size_t at = 3 * (static_cast<size_t>(v) * width + u) + c;
            weight += w;
            sums[0] += w * a[at];
            sums[1] += w * b[at];
            sums[2] += w * target.at(u, v, c);
          }
          if (weight == 0) continue;
          for (double& sum : sums) sum /= weight;
          const double one = (sums[0] - sums[2]) * (sums[1] - sums[2]);
          loss += weight / all / levels * (relative ? one / (sums[2] * sums[2] + 0.01) : one);
        }
      }
    }
  }
  return loss;
}

TEST(Losses, OfAPyramidAreThoseOfItsBlocks) {
  const TempFiles files;
  SceneParts parts;
  parts.width = 7;
  parts.height = 5;
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("clay", ".6, .5, .4")) +
               square("lamp", 0.8, 90, {0.5, 3.5, 1}, area_light("glow", "6, 6, 6"));
  const Scene scene = make_scene(files, parts);
  EXPECT_EQ(most_pyramid_levels(scene), 4);
  RunSettings settings;
  settings.spp = 2;
  settings.seed = 5;
  std::vector<std::vector<double>> images;
  for (int i = 0; i < 2; ++i) {  // those of image_loss()
    RunSettings own = settings;
    own.seed = mix_bits(mix_bits(settings.seed) + 1 + i);
    images.push_back(means(render(scene, own).radiance));
  }
  Image target(7, 5, 3), mask(7, 5, 1);
  for (size_t i = 0; i < target.data.size(); ++i) target.data[i] = 0.1f * (i % 7);
  for (size_t i = 0; i < mask.data.size(); ++i) mask.data[i] = static_cast<float>(i % 4);
  target.at(4, 0, 1) = NAN;  // where the mask is zero
  for (const bool relative : {false, true}) {
    for (const int levels : {1, 2, 4}) {
      const LossKind kind = relative ? LossKind::kRelativeL2 : LossKind::kL2;
      const LossResult loss = image_loss(scene, target, {kind, levels}, settings, mask);
      const auto exact = [&](size_t at, double step) {
        std::vector<std::vector<double>> moved = images;
        for (auto& image : moved) image[at] += step;
        return pyramid_loss(moved[0], moved[1], target, mask, levels, relative);
      };
      EXPECT_NEAR(loss.value, exact(0, 0), 1e-12) << levels;
      for (size_t i = 0; i < loss.adjoint.data.size(); ++i) {
        // A parabola: its difference is the derivative.
        const double slope = (exact(i, 0.5) - exact(i, -0.5));
        EXPECT_NEAR(loss.adjoint.data[i], slope, 1e-7 * std::fabs(slope) + 1e-12) << levels;
      }
    }
  }
  EXPECT_THROW(image_loss(scene, target, {.levels = 5}, settings, mask), InputError);
  EXPECT_THROW(image_loss(scene, target, {.levels = 0}, settings, mask), InputError);
  EXPECT_THROW(image_loss(scene, target, {.method = "rays"}, settings, mask), InputError);
}

// The loss of images without noise that have one value everywhere, as the target does.
double loss_of_one(LossKind kind, double image, double target) {
  const auto encoded = [](double v) {
    return v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
  };
  const double off = image - target;
  switch (kind) {
    case LossKind::kL2:
      return off * off;
    case LossKind::kRelativeL2:
      return off * off / (target * target + 0.01);
    case LossKind::kL1:
      return std::fabs(off);
    case LossKind::kL1Srgb:
      return std::fabs(encoded(image) - encoded(target));
    case LossKind::kSmape:
      return std::fabs(off) / (std::fabs(image) + std::fabs(target) + 0.01);
  }
  return NAN;
}

// Every pixel shows a sky, without noise: its channels are dark (on the line of sRGB's curve),
// medium and bright. Targets lie above, below, and below zero.
TEST(Losses, AreTheirFormulas) {
  const TempFiles files;
  SceneParts parts;
  parts.width = 4;
  parts.height = 3;
  parts.body =
      R"(<emitter type="constant"><rgb name="radiance" value="0.002, 0.3, 2.5"/></emitter>)";
  const Scene scene = make_scene(files, parts);
  const double image[] = {0.002, 0.3, 2.5};
  const double targets[] = {-0.1, 0.001, 0.1, 1, 3};
  RunSettings settings;
  settings.spp = 1;
  for (size_t k = 0; k < std::size(kLosses); ++k) {
    const auto kind = static_cast<LossKind>(k);
    for (const double target : targets) {
      const Image wanted = [&] {
        Image made(4, 3, 3);
        for (float& v : made.data) v = static_cast<float>(target);
        return made;
      }();
      const LossResult loss = image_loss(scene, wanted, {kind}, settings);
      double mean = 0;
      for (int c = 0; c < 3; ++c) {
        const double at = static_cast<float>(target), step = 1e-5 * image[c];
        mean += loss_of_one(kind, image[c], at) / 3;
        const double slope =
            (loss_of_one(kind, image[c] + step, at) - loss_of_one(kind, image[c] - step, at)) /
            (2 * step);
        EXPECT_NEAR(36 * loss.adjoint.data[c], slope, 1e-5 * std::fabs(slope) + 1e-9)
            << kLosses[k] << " " << target << " " << c;
      }
      EXPECT_NEAR(loss.value, mean, 1e-6 * mean) << kLosses[k] << " " << target;
    }
  }
}

TEST(Losses, ImagesThatDoNotFitAreNamed) {
  const TempFiles files;
  const Scene scene = gloss_scene(files);
  const Image target(scene.film.crop_width, scene.film.crop_height, 3);
  const auto refused = [&](const Image& t, const Image& mask) -> std::string {
    try {
      check_loss_images(scene, t, mask, "t.exr", "m.exr");
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  Image mask = target;
  EXPECT_EQ(refused(target, mask),
            "m.exr: error: the mask is zero everywhere: no pixel is left for the loss");
  for (float& v : mask.data) v = 1;
  EXPECT_EQ(refused(target, mask), "");
  mask.at(1, 2, 2) = 0;
  EXPECT_EQ(refused(target, mask)
                .find("m.exr: error: the mask's channels differ in column 1, "
                      "row 2"),
            0u);
  Image holes = target;
  holes.at(3, 0, 1) = NAN;
  EXPECT_EQ(refused(holes, {}).find("t.exr: error: the target is not finite in column 3, row 0"),
            0u);
  EXPECT_EQ(refused(Image(1, 1, 3), {}).find("t.exr: error: the target has 1 x 1 pixels"), 0u);
}

}  // namespace
}  // namespace limn
