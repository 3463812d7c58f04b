#pragma once
// The terms: a factory in a file of its own each, and one row. Included by term.cpp, and by the
// terms for their factories.
#include "integrators/terms/term.h"
#include "limn/core/parameter.h"

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
    {.name = "interior",
     .description = "derivative of the integrand away from discontinuities",
     .make = make_interior_term,
     .applies = always,
     .changes = by_any_change,
     .traces_paths = true,
     .moved_with_directions = true},
    {.name = "camera",
     .description = "silhouettes as the camera sees them",
     .make = make_camera_term,
     .applies = always,
     .changes = by_motion_in_view,
     .least_samples = kLeastFilmSamples,
     .edges = true},
    {.name = "boundary",
     .description = "silhouettes as path vertices see them",
     .make = make_boundary_term,
     .applies = always,
     .changes = by_motion_in_view,
     .edges = true,
     .moved_with_directions = true,
     .film_stream = 4},
    {.name = "shadow",
     .description = "edges of the hard shadows of delta lights",
     .make = make_shadow_term,
     .applies = has_delta_lights,
     .changes = by_motion,
     .edges = true,
     .moved_with_directions = true,
     .film_stream = 1},
    {.name = "direct",
     .description = "silhouettes in front of emitters and bright environment patches",
     .make = make_direct_term,
     .applies = LightRegions::any_in,
     .changes = by_motion_in_view,
     .edges = true,
     .moved_with_directions = true,
     .regions = true},
    {.name = "penumbra",
     .description = "boundary samples generated from the emitter, combined with direct by MIS",
     .make = make_penumbra_term,
     .applies = LightRegions::any_in,
     .changes = by_motion_in_view,
     .edges = true,
     .moved_with_directions = true,
     .film_stream = 2,
     .regions = true},
    {.name = "filter",
     .description = "derivative of the reconstruction filter with reparameterised film samples",
     .make = make_filter_term,
     .applies = always,
     .changes = by_motion_in_view,
     .film_stream = 3,
     .moved_film = true},
};

}  // namespace limn
