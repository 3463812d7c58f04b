#pragma once
// What each face shows of itself in a pixel: its area there and the centroid of that, as functions
// of the scene with their derivatives. No corner of what is seen is differentiated: with the side
// of a region on the line l . (x, y, 1) = 0, l positive inside,
//   dA = sum over sides of the integral of dl . (x, y, 1) / |(l_1, l_2)| along the side,
// and the same times x and y for the moments M. The regions tell which lines these are and where
// they meet, on a grid; what is added up is the true lines, those of planes through the camera and
// an edge, or through the line where two planes meet. So values of different scenes differ by what
// has moved, not by rounding to the grid, and the derivative is that of the very value. After Zhou,
// Wu, Ramamoorthi, Yan 2021, with lines in place of corners.
//
// A line on the border of two pixels moves into one or the other, and the area that it sweeps is
// this one's alone: each pixel has a kink there, their sum has none. What is returned is the mean
// of both sides, half in each pixel. So regions are found a step of the grid beyond the pixel,
// where such a line is inside of both, and are cut by the pixel's own border where they are summed.
#include <vector>

#include "integrators/film/pixel_regions.h"
#include "limn/core/camera.h"
#include "limn/core/var.h"

namespace limn {

// The visible part of a face in a pixel, in one piece or several.
template <class S>
struct FacePart {
  FaceRef face;  // none: where nothing is seen
  S area{};      // [pixels^2]
  S x{}, y{};    // its centroid [pixels of the full film]: on the face, but perhaps hidden there
};

// Of one pixel at a time.
class PixelParts {
 public:
  PixelParts(const Scene& scene, const PixelRegions& pixels)
      : scene_(scene), pixels_(pixels), view_(scene.camera), plane_(view_.plane(0, 0)) {}

  // Finds the parts in the pixel (x, y), in the order of labels. moving: whether derivatives will
  // be evaluated.
  void find(int x, int y, const VisibleRegions& regions, bool moving);
  size_t size() const { return parts_.size(); }

  // seeded: the scene, with tangents for Dual; for Var that of the tape's slots. view: of its
  // camera.
  template <class S>
  FacePart<S> part(size_t i, const Scene& seeded, const CameraView<S>& view) const;

 private:
  using Side = VisibleRegions::Side;
  // Of a region, and then of all that show one label.
  struct Part {
    uint32_t label;
    double area = 0, mx = 0, my = 0;          // moments about the pixel's center
    double x0 = 1, x1 = -1, y0 = 1, y1 = -1;  // its box, from the center
    size_t first_side = 0, end_side = 0;
  };
  // What the motion dl of a line adds: dl times these.
  struct Weights {
    Vec3d area, mx, my;
  };
  struct PartSide {
    uint32_t shown;  // label of the part
    Side line;
    Weights weights;
  };
  // A side of a region, its line positive inside. still: it is the pixel's own border.
  struct TrueSide {
    Vec3d line;
    bool still, flipped;
  };

  TrueSide true_side(const Side& side) const;
  void add_region(uint32_t label, std::span<const PlanePoint> corners, std::span<const Side> sides,
                  bool moving);
  void join_parts();
  void join_sides();
  // Line of a side on the film about the pixel's center, of either sign.
  template <class S>
  Vec3<S> line(const Scene& scene, const CameraView<S>& view,
               const typename CameraView<S>::Plane& plane, const Side& side) const;
  template <class S>
  Vec3<S> plane_of(const Scene& scene, const CameraView<S>& view, const Side& side) const;

  const Scene& scene_;
  const PixelRegions& pixels_;
  CameraView<double> view_;
  PlanePoint center_;  // of the pixel
  CameraView<double>::Plane plane_;
  std::vector<Part> parts_;
  std::vector<PartSide> sides_;
  // Of the region in hand.
  std::vector<TrueSide> ring_;
  std::vector<PlanePoint> corners_;
};

}  // namespace limn
