#pragma once
// Penumbras that are thin on the film. Around the shadow of an edge before a small lamp, or close
// behind an edge, the part of the film where the edge cuts into the lamp shrinks, and what the edge
// adds there grows as much: points of pixels meet it ever more rarely. So at the first vertices of
// paths what `direct` holds is split by the area of film that the lamp covers if it is projected
// through the point of the edge: where that is thin, `penumbra` finds the same contributions from
// the other end, along lines from the lamp through the edge (penumbra_boundary.cpp).
#include "integrators/terms/light_regions.h"
#include "limn/core/camera.h"
#include "limn/edgetree/edges.h"

namespace limn {

// Film areas below this are thin [pixels^2].
inline constexpr double kThinPenumbra = 0.25;

// If lines through a point e of an edge follow LightRegions::draw_direction(k, e), the density on
// the film [1 / pixel^2] of where they meet the surface of unit normal n_g at p. One over it is, up
// to the shape of the lamp, the film's area that the lamp covers projected through e.
double film_density_through(const Camera& camera, const LightRegions& regions, size_t k,
                            const Vec3d& e, const Vec3d& p, const Vec3d& n_g);

inline bool is_thin(double film_density) { return film_density * kThinPenumbra > 1; }

// Whether edges may have thin penumbras before region k: not a lamp's own, which are its border and
// no occluders.
bool may_be_thin(const LightRegions& regions, size_t k, std::span<const FaceRef> faces_around);

}  // namespace limn
