// Two chains of images, whose difference tells their noise.
#include "integrators/fit/running_images.h"

#include <algorithm>
#include <numeric>

#include "limn/core/error.h"
#include "limn/core/rng.h"

namespace limn {
namespace {

constexpr int kBlock = 8;  // pixels along each axis that share b; not tuned

size_t blocks_along(int pixels) { return static_cast<size_t>((pixels + kBlock - 1) / kBlock); }
size_t blocks_of(const Film& film) {
  return blocks_along(film.crop_width) * blocks_along(film.crop_height);
}

}  // namespace

size_t RunningImages::block(size_t value) const {
  const auto x = static_cast<int>(value / 3 % width_), y = static_cast<int>(value / 3 / width_);
  return static_cast<size_t>(y / kBlock) * blocks_along(width_) + x / kBlock;
}

bool RunningImages::render(const SeedImages& images, const RunSettings& settings, uint64_t stream,
                           ImagePair& to) const {
  const uint64_t seeds = mix_bits(settings.seed);
  for (const auto& [image, number] : {std::pair(&to.a, stream), {&to.b, stream + 1}}) {
    RunSettings own = settings;
    own.seed = mix_bits(seeds + number);
    const RenderResult result = images.render(own);
    if (result.non_finite.count > 0) throw InputError("loss: " + result.non_finite.message());
    if (result.spp < own.spp) return false;
    *image = means(result.radiance);
  }
  return true;
}

const ImagePair* RunningImages::pair(const Scene& scene, const RunSettings& settings) {
  if (!here_) here_ = std::make_shared<SeedImages>(deep_copy(scene), settings, options_);
  if (pair_.a.empty()) {
    ImagePair first;
    if (!render(*here_, settings, 1, first)) return nullptr;
    pair_ = std::move(first);
    width_ = scene.film.crop_width;
    height_ = scene.film.crop_height;
    shares_.assign(blocks_of(scene.film), 0);
  }
  pair_.variances.resize(pair_.a.size());
  for (size_t i = 0; i < pair_.a.size(); ++i) {
    const double apart = pair_.a[i] - pair_.b[i];
    pair_.variances[i] = apart * apart;
  }
  return &pair_;
}

std::optional<ImagePair> RunningImages::fresh(const RunSettings& settings) const {
  ImagePair other;
  if (!render(*here_, settings, 5, other)) return std::nullopt;
  return other;
}

bool RunningImages::carry(const Scene& scene, const RunSettings& settings) {
  auto there = std::make_shared<SeedImages>(deep_copy(scene), settings, options_);
  ImagePair before, now;
  if (!render(*here_, settings, 3, before) || !render(*there, settings, 3, now)) return false;
  ImagePair next = now;
  for (size_t i = 0; i < next.a.size(); ++i) {
    const double b = shares_[block(i)];
    next.a[i] += b * (pair_.a[i] - before.a[i]);
    next.b[i] += b * (pair_.b[i] - before.b[i]);
  }
  pair_ = std::move(next);
  here_ = std::move(there);
  find_shares(before, now);
  return true;
}

// With n, n' the noise of F now and before, and e that of I: the variance of n + b (e - n') is
// least for b = cov(n, n') / (var(e) + var(n')). Each is half of what both chains are apart. A
// block's b is that of all others: one that followed its own errors, which are skewed where bright
// samples are rare, would bias it.
void RunningImages::find_shares(const ImagePair& before, const ImagePair& now) {
  std::vector<double> common(shares_.size()), all(shares_.size());
  for (size_t i = 0; i < now.a.size(); ++i) {
    const double n = now.a[i] - now.b[i], m = before.a[i] - before.b[i];
    const double e = pair_.a[i] - pair_.b[i];
    common[block(i)] += n * m;
    all[block(i)] += e * e + m * m;
  }
  const double total_common = std::accumulate(common.begin(), common.end(), 0.0);
  const double total = std::accumulate(all.begin(), all.end(), 0.0);
  for (size_t k = 0; k < shares_.size(); ++k) {
    const double others = total - all[k];
    shares_[k] = others > 0 ? std::clamp((total_common - common[k]) / others, 0.0, 1.0) : 0;
  }
}

std::vector<double> RunningImages::numbers() const {
  std::vector<double> all = pair_.a;
  all.insert(all.end(), pair_.b.begin(), pair_.b.end());
  all.insert(all.end(), shares_.begin(), shares_.end());
  return all;
}

bool RunningImages::fits(size_t numbers, const Scene& scene) {
  const size_t pixels = static_cast<size_t>(scene.film.crop_width) * scene.film.crop_height;
  return numbers == 0 || numbers == 6 * pixels + blocks_of(scene.film);
}

void RunningImages::restore(const std::vector<double>& numbers, const Scene& scene) {
  here_.reset();
  width_ = scene.film.crop_width;
  height_ = scene.film.crop_height;
  const auto values = static_cast<ptrdiff_t>(size_t{3} * width_ * height_);
  const auto first = numbers.begin();
  pair_ = {};
  if (numbers.empty()) return;
  pair_ = {{first, first + values}, {first + values, first + 2 * values}, {}};
  shares_.assign(first + 2 * values, numbers.end());
}

}  // namespace limn
