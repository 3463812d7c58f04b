#pragma once
// What every pixel of a film with a box filter shows: its visible regions, found once.
#include <atomic>
#include <vector>

#include "limn/core/scene.h"
#include "limn/core/visible_regions.h"

namespace limn {

class FilmRegions {
 public:
  // The scene must outlive it. Empty if interrupted meanwhile (null: never). InputError, with the
  // filter's place, unless the filter is a box.
  FilmRegions(const Scene& scene, int threads, const std::atomic<bool>* interrupted = nullptr);

  // The face that is seen at a film position in the pixel (x, y) of the crop window [all in pixels
  // of the full film]; none where nothing is.
  FaceRef face_at(int x, int y, double film_x, double film_y) const;

  // Part of a segment, from (1 - s) of its first end and s of the other.
  struct Interval {
    double from, to;
  };
  // The parts of a segment on the film along which one of the faces is seen, at the segment or
  // nearer to it than a millionth of a pixel; in order, without overlaps.
  std::vector<Interval> seen_parts(const PlanePoint& from, const PlanePoint& to,
                                   std::span<const FaceRef> faces) const;

  // Of a point of an edge on the film, the faces around which are given: what is seen beside it that
  // is none of them (no face where nothing is). None if that cannot be told: the edge is hidden
  // there, or within a hundred millionth of a pixel more than one other thing is seen.
  std::optional<FaceRef> seen_beside(const PlanePoint& p, std::span<const FaceRef> around) const;

  size_t size() const;       // regions of all pixels
  size_t crossings() const;  // lines where faces pass through each other, pixel by pixel
  double seconds() const { return seconds_; }  // that it took to find them

 private:
  struct Region {
    FaceRef face;
    uint32_t first_corner, corner_count;  // no corners: the whole pixel
  };
  struct Tile {
    std::vector<uint32_t> first_region;  // of each of its pixels, row by row, and the end
    std::vector<Region> regions;
    std::vector<PlanePoint> corners;  // counter-clockwise as (x, y) [pixels of the full film]
    size_t crossings = 0;
  };
  class Builder;

  // visit(face, corners): for every region of a pixel of the full film in the crop window.
  template <class Visit>
  void for_each_region(int x, int y, const Visit& visit) const;

  const Film& film_;
  std::vector<Tile> tiles_;  // as make_tiles lists them
  double seconds_ = 0;
};

}  // namespace limn
