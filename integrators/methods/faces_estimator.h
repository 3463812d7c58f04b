#pragma once
// The image of a film with a box filter from its visible faces: a pixel is the sum over them of
// A L(c), A the area that a face shows in the pixel and L the radiance seen at the centroid c of
// that, light being known in closed form. Nothing in it is left to chance, and the derivative is
// that of this very function of the scene: dA L + A (dL + grad L . dc).
#include <memory>
#include <span>
#include <vector>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/film/pixel_parts.h"
#include "integrators/paths/traced_scene.h"
#include "limn/core/parameter.h"

namespace limn {

inline constexpr const char* kFacesTerm = "faces";

// A pixel has one sample. Slot g holds the derivatives for the parameters from g
// kLanes on; without parameters there is one slot without derivatives.
class FacesEstimator final : public SampleEstimator {
 public:
  // The scene must outlive it. InputError as PixelRegions::check() and check_closed_light().
  FacesEstimator(const Scene& scene, std::span<const Parameter> parameters, int threads);
  ~FacesEstimator() override;

  const Scene& scene() const override { return scene_; }
  size_t slots() const override { return std::max<size_t>(1, groups_.size()); }
  const char* slot_name(size_t) const override { return kFacesTerm; }
  int lanes() const override { return lanes_; }
  Lanes lane_scale() const override { return lane_scale_; }
  size_t together() const override { return kTileSize * kTileSize; }
  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override;

 private:
  // Up to kLanes parameters.
  struct Group;

  template <class S>
  bool add_part(const PixelParts& parts, size_t i, const Scene& scene, const CameraView<S>& view,
                const PathContext& context, SampleLog* log, Rgb<S>& sum) const;
  // Of a pixel; false if it is not finite, and then nothing is added.
  bool add_image(const PixelParts& parts, const PixelSample& at, SampleSink& sink) const;
  bool add_derivatives(const PixelParts& parts, const PixelSample& at, SampleSink& sink) const;

  const Scene& scene_;
  int lanes_;
  Lanes lane_scale_;
  std::shared_ptr<const CoincidentFaces> faces_;
  PixelRegions pixels_;
  TracedScene traced_;
  CameraView<double> view_;
  std::vector<std::unique_ptr<Group>> groups_;
};

}  // namespace limn
