#pragma once
// What a sample of each pixel holds: how many samples of every term, and how its directions move.
#include <algorithm>
#include <array>
#include <vector>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/paths/direction_field.h"
#include "integrators/terms/term.h"
#include "limn/integrators/gradient.h"

namespace limn {

// The film in square cells of pixels that share a plan.
struct PlanGrid {
  int x0 = 0, y0 = 0;  // of the film's crop
  int cell = 1;        // side [pixels]
  int columns = 1, rows = 1;

  PlanGrid() = default;
  // Cells of one pixel, or larger ones for films of more than `most` pixels.
  PlanGrid(const Film& film, size_t most);

  size_t size() const { return static_cast<size_t>(columns) * rows; }
  // Of a pixel around the film: that of the nearest.
  size_t index(int x, int y) const {
    const int column = std::clamp((x - x0) / cell, 0, columns - 1);
    return static_cast<size_t>(std::clamp((y - y0) / cell, 0, rows - 1)) * columns + column;
  }
  // The one pixel of its cell that a pilot looks at.
  bool is_probe(const Film& film, int x, int y) const;
};

// Means over square windows of cells, 2 radius + 1 wide and cut at the border.
std::vector<double> window_means(const PlanGrid& grid, const std::vector<double>& values,
                                 int radius);

// Whole numbers, or less than one at vertices: then a path has one sample at each with this
// probability, or none at all.
using PixelCounts = std::array<float, kMostTerms>;

struct SamplePlan {
  // Of every term that has no counts by pixel: those of the film, and all if `counts` is empty.
  SampleCounts uniform;
  PlanGrid grid;
  std::vector<PixelCounts> counts;     // by cell; empty: `uniform`
  std::vector<DirectionField> fields;  // by cell; empty: directions are held
  std::vector<FilmMotion> film;        // by cell: positions on the film; empty: they are held
  // A draw of an edge that adds w times a radiance difference to its pixel, in luminance, is traced
  // with the probability |survival w| (over parameters), see survival_of; zero: all are.
  Lanes survival{};
  // Whether vertices that move fast take more samples of edges and lights and more directions, and
  // those that little light comes from fewer edges.
  bool splits = false;
  Numbers numbers = Numbers::kIndependent;
  PathsTaken taken;  // see share_paths

  PixelCounts counts_at(const PixelSample& at) const;
  // Where samples are shared: gives pixels as many of the paths that `slot` counts as any near them
  // wishes for, and lets a pixel take only so many of each sample as all near it have: so weights
  // add up to 1 for each path. What is shared stays as it is.
  void share_paths(size_t slot, int reach, const Film& shown);
  const DirectionField* field_at(const PixelSample& at) const {
    return fields.empty() ? nullptr : &fields[grid.index(at.x, at.y)];
  }
  const FilmMotion* film_motion(int x, int y) const {
    return film.empty() ? nullptr : &film[grid.index(x, y)];
  }
};

}  // namespace limn
