#pragma once
// The terms: a factory in a file of its own each, and one row. Included by term.cpp, and by the
// terms for their factories.
#include "integrators/terms/term.h"
#include "limn/core/moved.h"

namespace limn {

std::unique_ptr<Term> make_interior_term(TermInput& input);
std::unique_ptr<Term> make_camera_term(TermInput& input);
std::unique_ptr<Term> make_boundary_term(TermInput& input);
std::unique_ptr<Term> make_shadow_term(TermInput& input);
std::unique_ptr<Term> make_direct_term(TermInput& input);
std::unique_ptr<Term> make_penumbra_term(TermInput& input);
std::unique_ptr<Term> make_filter_term(TermInput& input);

inline bool always(const Scene&) { return true; }
inline bool has_delta_lights(const Scene& scene) { return !scene.delta_lights.empty(); }

// An edge adds its speed against what sees it: the film, or a point of a surface. Directions are
// held, so a surface point moves with its own vertices or, where a path from a moving camera or a
// smooth lobe slides over it, with these. Delta lights move the shadows of edges alone.
inline bool by_any_change(const Moved&) { return true; }
inline bool by_motion_in_view(const Moved& moved) {
  return moved.vertices || moved.camera || moved.rays;
}
inline bool by_motion(const Moved& moved) { return moved.any(); }

// The camera's samples are drawn over the whole film: there may be fewer of them than pixels.
inline constexpr double kLeastFilmSamples = 0.125;  // not tuned

inline constexpr TermType kTermTypes[] = {
    {"interior", "derivative of the integrand away from discontinuities", 1, true, false, true, 0,
     always, by_any_change, false, false, make_interior_term},
    {"camera", "silhouettes as the camera sees them", kLeastFilmSamples, false, true, false, 0,
     always, by_motion_in_view, false, false, make_camera_term},
    {"boundary", "silhouettes as path vertices see them", 1, false, true, true, 0, always,
     by_motion_in_view, false, false, make_boundary_term},
    {"shadow", "edges of the hard shadows of delta lights", 1, false, true, true, 1,
     has_delta_lights, by_motion, false, false, make_shadow_term},
    {"direct", "silhouettes in front of emitters and bright environment patches", 1, false, true,
     true, 0, LightRegions::any_in, by_motion_in_view, true, false, make_direct_term},
    {"penumbra", "boundary samples generated from the emitter, combined with direct by MIS", 1,
     false, true, true, 2, LightRegions::any_in, by_motion_in_view, true, false,
     make_penumbra_term},
    {"filter", "derivative of the reconstruction filter with reparameterised film samples", 1,
     false, false, false, 0, always, by_motion_in_view, false, true, make_filter_term},
};

}  // namespace limn
