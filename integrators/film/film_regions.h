#pragma once
// What every pixel of a film with a box filter shows: its visible regions, found once.
#include <atomic>
#include <memory>
#include <vector>

#include "limn/core/coincident_faces.h"
#include "limn/core/scene.h"
#include "limn/core/visible_regions.h"

namespace limn {

class PixelRegions;

class FilmRegions {
 public:
  // The scene must outlive it. Empty if interrupted meanwhile (null: never). InputError, with the
  // filter's place, unless the filter is a box.
  FilmRegions(const Scene& scene, int threads, const std::atomic<bool>* interrupted = nullptr);
  static void check(const Scene& scene);  // PixelRegions::check
  // What it had to find of the scene's faces, for a tracer to share.
  std::shared_ptr<const CoincidentFaces> faces() const { return faces_; }

  // The face that is seen at a film position in the pixel (x, y) of the crop window [all in pixels
  // of the full film]; none where nothing is.
  FaceRef face_at(int x, int y, double film_x, double film_y) const;

  // Part of an edge on the film, from (1 - s) of its first end and s of the other.
  struct SeenPart {
    double from, to;
    // What is seen beside it that is none of the edge's faces: a face, or FaceRef{} where nothing
    // is, or where the edge has a face of its own on either side. None if that is not resolved:
    // within a millionth of a pixel more than one other thing is seen.
    std::optional<FaceRef> beside;
  };
  // The parts of an edge along which one of the faces around it is seen, at the edge or nearer to
  // it than a millionth of a pixel: no other part is seen. In order, without overlaps.
  std::vector<SeenPart> seen_parts(const PlanePoint& from, const PlanePoint& to,
                                   std::span<const FaceRef> around) const;

  size_t size() const;       // regions of all pixels
  size_t crossings() const;  // lines where faces pass through each other, pixel by pixel
  double seconds() const { return seconds_; }  // that it took to find them

 private:
  struct Region {
    FaceRef face;
    uint32_t first_corner, corner_count;  // before them the ends of their box; 0: the whole pixel
  };
  struct Tile {
    std::vector<uint32_t> first_region;  // of each of its pixels, row by row, and the end
    std::vector<Region> regions;
    std::vector<PlanePoint> corners;  // counter-clockwise as (x, y) [pixels of the full film]
    size_t crossings = 0;
  };
  static void append(const PixelRegions& pixels, const VisibleRegions& regions, Tile& tile);

  // visit(face, lower, upper, corners): for every region of a pixel of the full film in the crop
  // window, with the ends of its box.
  template <class Visit>
  void for_each_region(int x, int y, const Visit& visit) const;

  const Film& film_;
  std::shared_ptr<const CoincidentFaces> faces_;
  std::vector<Tile> tiles_;  // as make_tiles lists them
  double seconds_ = 0;
};

}  // namespace limn
