#pragma once
// The gradient of the image that FacesEstimator makes: one term, `faces`, and no noise.
#include <memory>
#include <vector>

#include "integrators/backward/parameter_slots.h"
#include "integrators/estimates/gradient_estimator.h"
#include "integrators/film/pixel_parts.h"
#include "integrators/paths/traced_scene.h"

namespace limn {

// A pixel has one sample.
class FacesGradient final : public GradientEstimator {
 public:
  // The scene must outlive it. InputError as backward().
  FacesGradient(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
                int threads);

  const ParameterSlots& parameters() const { return parameters_; }
  void describe(BackwardResult& result) const;

  const Scene& scene() const override { return parameters_.scene(); }
  size_t slots() const override { return 1; }
  const char* slot_name(size_t slot) const override;
  uint32_t gradient_slots() const override { return parameters_.slots().count; }
  std::vector<std::vector<double>> gather(const std::vector<double>& sums) const override {
    return parameters_.gather(sums);
  }
  std::vector<size_t> sizes() const override { return parameters_.sizes(); }
  int most_batches() const override { return 1; }
  size_t samples(const Batch&) const override { return adjoint_.size(); }
  size_t tiles(const Batch&) const override { return pixels_.tiles().size(); }
  void add_tile(const Batch& batch, size_t tile, GradientTile& to) const override;
  void add_sample(const Batch& batch, const PixelSample& at, GradientTile& to) const override;
  void end_tile(std::vector<Contribution>& contributions) const override;

 private:
  void add_wanted(size_t tile, const PixelRegions::Wanted& wanted, GradientTile& to) const;
  const Rgb<double>& adjoint_at(int x, int y) const {
    return adjoint_[pixel_index(scene().film, x, y) / 3];
  }
  bool trace(const PixelParts& parts, size_t i, const Rgb<double>& adjoint, Tape& tape) const;

  std::vector<Rgb<double>> adjoint_;
  ParameterSlots parameters_;
  std::shared_ptr<const CoincidentFaces> faces_;
  PixelRegions pixels_;
  TracedScene traced_;
};

}  // namespace limn
