#pragma once
// Thin penumbras. In the shadow of an edge before a small lamp, or close behind an edge, the place
// where the edge cuts into the lamp is small, and what the edge adds there is as large: samples of
// pixels and of directions meet it ever more rarely. So what `direct` holds at a vertex p of a path is
// split. Projected through a point of the edge onto the surface at p, the lamp covers some solid angle
// as seen from the viewer q of p, the camera or the vertex before. Where a path from q meets that by
// few chances, the penumbra is thin, and `penumbra` finds the same contribution from the other end,
// along lines from the lamp through the edge (penumbra_boundary.cpp).
#include <span>

#include "integrators/terms/term.h"
#include "limn/edgetree/edges.h"

namespace limn {

// Fewer paths than this of a pixel's, or of those that come to the vertex before, meet a penumbra
// that is thin.
inline constexpr double kThinPenumbra = 0.25;

// A line from region k through the point e of an edge that meets a surface of unit normal n at p.
struct LampLine {
  size_t region;
  Vec3d e, p, n;
};

// If lines through e follow LightRegions::draw_direction, the density of p as seen from q [1/sr].
// One over it is, up to the shape of the lamp, the solid angle that the lamp covers projected through
// e. Zero if none comes there.
double density_seen(const LightRegions& regions, const LampLine& line, const Vec3d& q);

// Whether the penumbra around p is thin where a path has come by this step: by the density of
// directions; for the camera, whose steps have none, by that of positions in one pixel.
bool is_thin(const Camera& camera, const LightRegions& regions, const LampLine& line,
             const PathStep& step, int bounces);

// Whether penumbras of an edge with these faces around may be thin before region k: not a lamp's own,
// which are its border and no occluders.
bool may_be_thin(const LightRegions& regions, size_t k, std::span<const FaceRef> faces_around);

}  // namespace limn
