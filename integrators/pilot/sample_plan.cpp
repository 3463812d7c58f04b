// Plans over the film.
#include "integrators/pilot/sample_plan.h"

#include <algorithm>
#include <cmath>

namespace limn {

PlanGrid::PlanGrid(const Film& film, size_t most) : x0(film.crop_x), y0(film.crop_y) {
  const double pixels = static_cast<double>(film.crop_width) * film.crop_height;
  cell = std::max(1, static_cast<int>(std::ceil(std::sqrt(pixels / static_cast<double>(most)))));
  columns = (film.crop_width + cell - 1) / cell;
  rows = (film.crop_height + cell - 1) / cell;
}

bool PlanGrid::is_probe(const Film& film, int x, int y) const {
  // In the middle of the cell, or of what the film leaves of it.
  const auto middle = [&](int p, int size) {
    const int first = p / cell * cell;
    return p == first + (std::min(cell, size - first) - 1) / 2;
  };
  return middle(x - x0, film.crop_width) && middle(y - y0, film.crop_height);
}

std::vector<double> window_means(const PlanGrid& grid, const std::vector<double>& values,
                                 int radius) {
  std::vector<double> means(values.size());
  for (int y = 0; y < grid.rows; ++y) {
    const int v0 = std::max(0, y - radius), v1 = std::min(grid.rows - 1, y + radius);
    std::vector<double> columns(grid.columns);
    for (int v = v0; v <= v1; ++v) {
      for (int x = 0; x < grid.columns; ++x) columns[x] += values[v * grid.columns + x];
    }
    for (int x = 0; x < grid.columns; ++x) {
      const int u0 = std::max(0, x - radius), u1 = std::min(grid.columns - 1, x + radius);
      double sum = 0;
      for (int u = u0; u <= u1; ++u) sum += columns[u];
      means[y * grid.columns + x] = sum / ((v1 - v0 + 1) * (u1 - u0 + 1));
    }
  }
  return means;
}

namespace {

// Over the same windows.
std::vector<double> window_largest(const PlanGrid& grid, const std::vector<double>& values,
                                   int radius) {
  std::vector<double> largest(values);
  for (int y = 0; y < grid.rows; ++y) {
    for (int x = 0; x < grid.columns; ++x) {
      double& here = largest[y * grid.columns + x];
      for (int v = std::max(0, y - radius); v <= std::min(grid.rows - 1, y + radius); ++v) {
        for (int u = std::max(0, x - radius); u <= std::min(grid.columns - 1, x + radius); ++u) {
          here = std::max(here, values[v * grid.columns + u]);
        }
      }
    }
  }
  return largest;
}

// The share of a filter that lies further from its center.
double share_beyond(const Filter& filter, double distance) {
  return 2 * std::fabs(filter.integral(-distance)) / filter.integral(filter.radius);
}

}  // namespace

void SamplePlan::share_paths(size_t slot, int reach, const Film& shown) {
  if (counts.empty() || !taken.counts.empty()) return;
  // Pixels of less weight need not have as many: each is averaged over those that it has. Against
  // all in reach, derivatives by reflectances take .88 of the time, with no more error.
  constexpr double kSmall = 0.01;
  while (reach > 1 && share_beyond(shown.filter, reach - 0.5) < kSmall) --reach;
  const int radius = (reach + grid.cell - 1) / grid.cell;
  std::vector<double> paths;
  for (const PixelCounts& cell : counts) paths.push_back(std::max(cell[slot], 1.0f));
  paths = window_largest(grid, paths, radius);
  for (size_t i = 0; i < counts.size(); ++i) counts[i][slot] = static_cast<float>(paths[i]);
  for (double& n : paths) n = -n;
  const std::vector<double> fewest = window_largest(grid, paths, radius);
  taken = {shown.crop_x, shown.crop_y, shown.crop_width, {}};
  for (int y = 0; y < shown.crop_height; ++y) {
    for (int x = 0; x < shown.crop_width; ++x) {
      const size_t cell = grid.index(shown.crop_x + x, shown.crop_y + y);
      taken.counts.push_back(static_cast<uint8_t>(-fewest[cell]));
    }
  }
}

PixelCounts SamplePlan::counts_at(const PixelSample& at) const {
  if (!counts.empty()) return counts[grid.index(at.x, at.y)];
  PixelCounts result;
  for (size_t t = 0; t < kMostTerms; ++t) {
    result[t] = static_cast<float>(std::max(1.0, uniform[t]));
  }
  return result;
}

}  // namespace limn
