#pragma once
// Edges as the camera sees them through one flat refracting plane, or two parallel ones, which do
// not cut its lens. The image of an edge is a curve: direction_through() finds where a point of it
// is seen, and how it moves follows from the camera's ray. With y the edge's point, d the direction
// in which the ray through the film position s arrives there, x(s) where on it, and e the edge's
// direction, it sees the edge where
//   N . (y - x(s)) = 0,  N = d x e.
// So the curve's normal is that of m = N . dx/ds, and it moves by N . (y' - x') / |m|.
#include <optional>

#include "integrators/edges/flat_mirrors.h"
#include "integrators/paths/camera_path.h"
#include "integrators/paths/path_context.h"
#include "limn/edgetree/edges.h"

namespace limn {

// A point of an edge on the film.
struct RefractedPoint {
  FilmPosition at;
  double nx, ny;   // the curve's unit normal, to the positive side of EdgeView::side
  double stretch;  // length of the curve [pixels] per unit of t
  Lanes speed;     // along the normal [pixels]
  Vec3d g;         // the same per velocity of the point
};

// Cuts the parameter range [s0, s1] of a + s d to where it lies in [lower, upper] (Liang and
// Barsky). False if nothing is left.
bool clip_range(double a, double d, double lower, double upper, double& s0, double& s1);

class RefractedView {
 public:
  // chain: one of FlatMirrors::panes(). free: as of CameraEdges. The context must outlive it.
  RefractedView(const PathContext& context, const FlatMirrors::Chain& chain, bool free);

  // Whether the camera looks at the first plane from a side where it lets light pass, and the next
  // is behind.
  bool is_seen() const { return seen_; }
  // Cuts an edge to what lies beyond the planes: t in [t0, t1]; false if nothing does.
  bool clip(const Vec3d& a, const Vec3d& b, double& t0, double& t1) const;
  // Through a point of the lens. None where the camera does not look, or the edge shows nothing to
  // the last plane.
  std::optional<RefractedPoint> see(const EdgeMesh& mesh, EdgeId edge, double t,
                                    const LensPoint& lens) const;

 private:
  // The camera's ray on the other side of the planes.
  template <class S>
  struct Carried {
    Vec3<S> origin, direction;
  };
  Carried<Dual> carried_by_film(const FilmPlace& at) const;
  Carried<Dual> carried_by_scene(const FilmPlace& at) const;
  // Where the camera sees y; none if it does not look there.
  std::optional<FilmPlace> place(const Vec3d& y, const LensPoint& lens) const;

  const PathContext& context_;
  FlatMirrors::Chain chain_;
  bool free_;
  bool seen_ = false;
  Vec3d n_;                      // of the planes, away from the camera
  std::array<double, 3> depth_;  // along it: of the planes from the camera's origin
  std::array<double, 3> index_;  // before, between and behind them
};

}  // namespace limn
