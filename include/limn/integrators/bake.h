#pragma once
// A view whose environment can be replaced without its geometry: what every point of its pixels
// sees of the sky, kept along lines between silhouettes (after Nowrouzezahrai, Baran, Mitchell,
// Jarosz 2014, section 4). Its image is linear in a map's texels, and that sum is all that is left
// to do.
#include <cstdint>
#include <string>
#include <vector>

#include "limn/core/image.h"
#include "limn/core/scene.h"
#include "limn/integrators/option.h"
#include "limn/integrators/run.h"

namespace limn {

// A map in place of the scene's environment, as Mitsuba's envmap takes it: radiance is `scale`
// times the texels.
struct SkyMap {
  Image texels;
  double scale = 1;
  // Rotation about the map's pole, as <rotate y="1"/> does it, beyond the to_world of the envmap
  // that the scene was baked with, if it had one [degrees].
  double turn = 0;
};

inline constexpr Option kBakedLinesOption{"lines", "Lines through the sky per point", 1, 1 << 14};

class BakedView {
 public:
  // As `render` with the method lines:azimuths=uniform sees the scene. InputError where that does
  // not support the scene (max_depth other than 2, textures, gloss, delta lights, other sensors
  // than pinholes), and for scenes without an environment. lines: as RenderOptions.
  // An interrupted run keeps nothing, see `complete`.
  struct Made;
  static Made make(const Scene& scene, const RunSettings& settings, int lines);

  // A file's bytes: a text of a few lines, the numbers as they lie in memory, the CRC-32 of all.
  std::string bytes() const;
  // InputError that names the file if it is no baked view, of another version, cut off or damaged.
  static BakedView of_bytes(const std::string& bytes, const std::string& file);

  // The image under a map, height by width by 3: that of the method above for the scene with this
  // map, but for rounding to floats. InputError for maps that are not finite.
  Image relight(const SkyMap& sky, int threads) const;
  // dLoss/dtexels, of the size of the map, from dLoss/dimage: the transpose of `relight`.
  // The texels themselves do not matter. InputError for images of other sizes and for what is not
  // finite.
  Image texel_adjoint(const SkyMap& sky, const Image& adjoint) const;

  // InputError if the scene, but for its environment, is not the one that was baked.
  void check_scene(const Scene& scene) const;

  int width() const { return width_; }
  int height() const { return height_; }

 private:
  struct PixelRow;
  struct Columns;
  template <class Point>
  void walk(size_t pixel, const Columns& columns, const Point& point) const;
  int width_ = 0, height_ = 0, lines_ = 0;
  std::string scene_, fingerprint_;
  std::vector<float> constant_;   // height by width by 3: what does not come from the environment
  std::vector<uint64_t> starts_;  // of each pixel, and the end
  std::vector<float> numbers_;    // see integrators/contours/sky_record.h
};

struct BakedView::Made {
  BakedView view;
  NonFinite non_finite;
  bool complete = false;
};

}  // namespace limn
