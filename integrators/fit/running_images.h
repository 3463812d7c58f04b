#pragma once
// Images that a fit carries from step to step, in place of new ones: recursive control variates
// (Nicolet et al. 2023, "Recursive Control Variates for Inverse Rendering"),
//   I_t = F(theta_t; s) + b (I_{t-1} - F(theta_{t-1}; s)),
// F: an image by few samples, s: their seed, new at each step. For steps theta_t that are given,
// the mean of I_t is the image, as b of a block of pixels follows from the other blocks: from
// noise, and how much of it the difference of both F has left. Where theta_t follows from I_{t-1},
// as in a fit, this holds about. b is 0 where nothing is known.
// Noise lasts for about 1 / (1 - b) steps. Its sum over many steps is no less than that of new
// images F: steps that average gradients, as Adam's momentum does, gain little.
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "integrators/backward/steps.h"
#include "integrators/methods/render_seeds.h"

namespace limn {

class RunningImages {
 public:
  explicit RunningImages(const RenderOptions& options) : options_(options) {}

  // As they are, or of the scene alone if there are none yet. Null: interrupted. InputError where
  // samples are not finite.
  const ImagePair* pair(const Scene& scene, const RunSettings& settings);
  // Another pair of the scene that the last call had, by samples of its own; none: interrupted.
  std::optional<ImagePair> fresh(const RunSettings& settings) const;
  // From the scene as it was to how it is. False: interrupted.
  bool carry(const Scene& scene, const RunSettings& settings);

  // For the state of a fit: both images, then the shares of the blocks; none before the first pair.
  std::vector<double> numbers() const;
  static bool fits(size_t numbers, const Scene& scene);
  void restore(const std::vector<double>& numbers, const Scene& scene);

 private:
  bool render(const SeedImages& images, const RunSettings& settings, uint64_t stream,
              ImagePair& to) const;
  size_t block(size_t value) const;
  void find_shares(const ImagePair& before, const ImagePair& now);

  RenderOptions options_;
  int width_ = 0, height_ = 0;
  std::shared_ptr<const SeedImages> here_;  // of the scene that pair_ is of; null: not made
  ImagePair pair_;
  std::vector<double> shares_;  // b, of each block
};

}  // namespace limn
