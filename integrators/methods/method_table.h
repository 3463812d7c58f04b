#pragma once
// The methods: a file of its own each, and one row. Included by methods.cpp, and by the methods.
#include "integrators/methods/term_methods.h"
#include "integrators/paths/blurred_scene.h"
#include "limn/integrators/methods.h"

namespace limn {

GradientResult run_differences(const MethodType& method, const Scene& scene,
                               const GradientOptions& options, const RunSettings& settings);

GradientResult run_blurred(const MethodType& method, const Scene& scene,
                           const GradientOptions& options, const RunSettings& settings);

std::unique_ptr<SampleEstimator> make_interpolated_estimator(const Scene& scene,
                                                             const RunSettings& settings,
                                                             const Settings& choices);

// All but those that work term by term.
inline std::vector<MethodType> other_methods() {
  return {{.name = "fd",
           .description = "central finite differences with common random numbers",
           .terms = {"differences"},
           .differs = true,
           .run = run_differences},
          {.name = "path",
           .description = "path tracing with multiple importance sampling of emitters and BSDFs",
           .defaults = {Task::kImage},
           .image = ImageMethod{}},
          {.name = "light-traced",
           .description = "the same and particles from area lights, for caustics",
           .image = ImageMethod{.from_lights = true}},
          {.name = "lines",
           .description = "direct light, ambient occlusion and open sky, integrated along lines "
                          "between silhouettes",
           .settings = {{"azimuths",
                         "of lines through a map: dense where it is bright (map), or uniform",
                         {"map", "uniform"}}},
           .set_up =
               [](MethodType& row) {
                 row.image = ImageMethod{.looks_around = true, .by_lines = true};
                 row.image->uniform_lines = row.settings["azimuths"] == "uniform";
               }},
          {.name = "rays",
           .description = "direct light, ambient occlusion and open sky, by quasi-random rays",
           .image = ImageMethod{.looks_around = true}},
          {.name = "blurred",
           .description = "a scene of blurred faces: smooth, biased for the sharp one",
           .settings = {{"caustics",
                         "of area lights, on what the camera sees: by paths from the camera, or "
                         "by particles from the lights",
                         {"paths", "particles"}}},
           .set_up = [](MethodType& row) { row.particles = row.settings["caustics"] != "paths"; },
           .terms = {"blurred"},
           .blurs = BlurWeights::kOrdered,
           .biased = true,
           .check = check_blurred,
           .image = ImageMethod{},
           .run = run_blurred},
          {.name = "blurred-published",
           .description = "the same with weights opacity times exp(-depth / gamma) (Quinn 2021)",
           .terms = {"blurred"},
           .blurs = BlurWeights::kPublished,
           .biased = true,
           .check = check_blurred,
           .image = ImageMethod{},
           .run = run_blurred},
          {.name = "interpolated",
           .description = "direct light of the sky on diffuse surfaces, from the exact outlines of "
                          "the sky at vertices: biased",
           .settings = {{"interpolate",
                         "between vertices: the outline, the radiance of three outlines, signed "
                         "distances from them, or nothing (exact outlines; rays to where the sky "
                         "is bright and open)",
                         {"outline", "radiance", "distances", "nothing", "rays"}},
                        {"shading",
                         "points where light is evaluated: pixels' own, vertices, or, of all but "
                         "outlines, as many of a triangle as the sky's detail asks for (adaptive)",
                         {"pixel", "vertex", "adaptive"}},
                        {"subdivision",
                         "of adaptive shading: 2 to this times the light's change",
                         {"4", "0", "1", "2", "8", "16", "32"}},
                        {"loops",
                         "of one vertex that go with one of another: one at most, or all",
                         {"one", "all"}},
                        {"gloss-cap",
                         "around mirror directions: the share of a glossy lobe's energy in it",
                         {"0.9", "0.5", "0.7", "0.99"}},
                        {"tolerance",
                         "of the open sky, above which faces are cut; 0: they are not",
                         {"0.01", "0", "0.03", "0.003", "0.001"}}},
           .image = ImageMethod{.looks_around = true, .make = make_interpolated_estimator}}};
}

}  // namespace limn
