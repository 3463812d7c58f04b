#pragma once
// The image motion of the surfaces that the camera sees: known from the scene without any samples.
#include <array>
#include <vector>

#include "integrators/pilot/sample_plan.h"
#include "integrators/pilot/term_estimator.h"

namespace limn {

// Two motions by cell [pixels per unit of each parameter]: the mean of all that a cell shows, and
// that of what is nearest, with which silhouettes move.
using FilmFlows = std::array<std::vector<FilmMotion>, 2>;

// By nine rays through each cell. Points move with their surfaces; what surfaces pass straight on
// counts by its share, and directions that meet nothing stay. No random numbers.
FilmFlows film_flows(const TermEstimator& estimator, const PlanGrid& grid, int threads);

// Whether the parameters move a textured shape: its detail may be finer than its edges.
bool moves_textures(const Scene& scene);

// The cell of another grid that has the first pixel of a cell of `grid`.
size_t in_grid(const PlanGrid& other, const PlanGrid& grid, size_t cell);

// Gives a plan a finer grid: a cell takes over what it had.
void refine(SamplePlan& plan, const PlanGrid& grid);

}  // namespace limn
