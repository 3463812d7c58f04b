#pragma once
// The visible regions of a film's pixels, tile by tile, for films with a box filter: what a pixel
// shows is then what is seen within it.
#include <atomic>
#include <functional>
#include <optional>
#include <vector>

#include "integrators/estimates/tiles.h"
#include "limn/core/face_overlaps.h"
#include "limn/core/scene.h"
#include "limn/core/visible_regions.h"

namespace limn {

// How far regions reach beyond a pixel [pixels]: a step of their grid.
inline constexpr double kPixelMargin = 0x1p-30;
// What needs them, for messages.
inline constexpr const char* kRegionsUser = "points \"faces\"";

class PixelRegions {
 public:
  // Finds which faces may be seen in which tile of make_tiles(). Scene and faces must outlive it.
  // InputError unless the filter is a box, with its place, and the camera a pinhole.
  PixelRegions(const Scene& scene, const CoincidentFaces& faces, int threads);
  static void check(const Scene& scene);

  const std::vector<Tile>& tiles() const { return tiles_; }
  // Which of tiles() a pixel of the crop is in.
  size_t tile_of(int x, int y) const;
  // Of a region; none where nothing is seen.
  FaceRef face_of(uint32_t label) const;

  // visit(x, y, regions): for the pixels of a tile that are wanted, row by row; `regions` is that
  // of the pixel until visit returns. False if interrupted meanwhile (null: never). InputError for
  // a pixel of too many regions.
  using Wanted = std::function<bool(int, int)>;
  using Visit = std::function<void(int, int, const VisibleRegions&)>;
  bool for_each_pixel(size_t tile, const std::atomic<bool>* interrupted, const Wanted& wanted,
                      const Visit& visit) const;

 private:
  std::optional<SeenFace> see(uint32_t label) const;
  std::vector<SeenFace> seen_in(size_t tile) const;
  std::optional<bool> rule(uint32_t a, uint32_t b) const;
  [[noreturn]] void refuse(int x, int y) const;
  bool is_met(uint32_t label) const;
  void bin_faces(int threads);

  const Scene& scene_;
  const DuplicateFaces& copies_;
  const FaceOverlaps& overlaps_;
  PlaneView view_;
  std::vector<Tile> tiles_;
  std::vector<uint32_t> first_label_;  // of each shape: labels are faces, counted through
  uint32_t labels_ = 0;
  // Labels in order: of tile t those from first_binned_[t] to first_binned_[t + 1].
  std::vector<size_t> first_binned_;
  std::vector<uint32_t> binned_;
};

}  // namespace limn
