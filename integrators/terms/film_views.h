#pragma once
// From where the camera sees edges: itself, and its images in chains of flat mirrors.
#include <algorithm>
#include <memory>
#include <span>
#include <vector>

#include "integrators/edges/flat_mirrors.h"
#include "integrators/edges/viewpoint.h"
#include "integrators/paths/path_context.h"
#include "integrators/terms/refracted_view.h"

namespace limn {

// A part of the film [pixels].
struct FilmWindow {
  double x0, y0, x1, y1;

  bool holds(const FilmPosition& at) const {
    return at.x >= x0 && at.x <= x1 && at.y >= y0 && at.y <= y1;
  }

  // Cuts the segment from (from_x, from_y) to (to_x, to_y) likewise.
  bool clip(double from_x, double to_x, double from_y, double to_y, double& s0, double& s1) const {
    return clip_range(from_x, to_x - from_x, x0, x1, s0, s1) &&
           clip_range(from_y, to_y - from_y, y0, y1, s0, s1);
  }
};

// Where a film position can matter to a pixel of the crop window.
FilmWindow sampled_window(const Film& film);

// A point on the side of a plane from which a camera looks at x, a point of the plane; of a lens
// its center.
inline Vec3d eye_before(const Camera& camera, const Vec3d& x) {
  return camera.is_orthographic() ? x - value(camera.forward) : value(camera.origin);
}

struct FilmView {
  FlatMirrors::Chain chain;  // empty: the camera itself
  Camera camera;             // its image
  const Viewpoint* viewpoint;
  std::unique_ptr<const Viewpoint> own_viewpoint = nullptr;  // of an image
  FilmWindow window;                                         // no more than this is seen
  // Of an edge only what lies on the side of the last mirror that this is not on is seen.
  const FlatMirrors* mirrors = nullptr;
  std::unique_ptr<const RefractedView> refracted = nullptr;  // in the place of an image

  bool direct() const { return chain.count == 0; }
  uint32_t last_mirror() const { return chain.mirrors[chain.count - 1]; }
  // Whether one of the faces is of the last mirror: an edge of it lies in it, and is its own image.
  bool touches_mirror(std::span<const FaceRef> faces) const {
    return !direct() && std::ranges::any_of(faces, [&](FaceRef face) {
      return mirrors->of(face) == last_mirror();
    });
  }
  // Cuts the segment from a to b to what lies before the last mirror. origin: of the image, or the
  // point of its lens.
  bool clip_to_mirror(const Vec3d& origin, const Vec3d& a, const Vec3d& b, double& t0,
                      double& t1) const;
};

// The camera, then its images in chains of mirrors that may show it something, then what it sees
// through panes. held: the mirrors' motion is left out.
std::vector<FilmView> list_film_views(const PathContext& context, bool held);

}  // namespace limn
