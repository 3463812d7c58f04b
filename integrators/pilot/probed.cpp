// Figures of pilots and of fits together.
#include "integrators/pilot/probed.h"

#include <algorithm>
#include <cmath>

#include "integrators/pilot/allocation.h"

namespace limn {

Probed::Spread Probed::spread(int lane, bool turned) const {
  const bool fitted = turned && !fit.variances.empty();
  const size_t slots = pilot.work.size();
  Spread result{std::vector<double>(slots), std::vector<double>(slots),
                std::vector<std::vector<double>>(slots), std::vector<std::vector<double>>(slots)};
  for (size_t slot = 0; slot < slots; ++slot) {
    const double film = pilot.film_variance[slot][lane];
    result.variances[slot] = film;
    if (!pilot.in_cells(slot)) continue;
    // Some terms have samples of both kinds.
    const std::vector<double> held = pilot.variances(slot, lane);
    std::vector<double>&cells = result.cells[slot], &squared = result.cells_squared[slot];
    cells = fitted ? fit.variances[lane][slot] : held;
    squared = pilot.squared_means(slot, lane);
    // Assumption: a turn reduces the squared mean by the same factor as the variance.
    for (size_t i = 0; i < cells.size(); ++i) {
      if (held[i] > 0 && cells[i] < held[i]) squared[i] *= std::max(cells[i], 0.0) / held[i];
      squared[i] *= shared;
    }
    result.variances[slot] += shared * trimmed_mean(cells);
    result.squared_means[slot] = std::max(trimmed_mean(squared), 0.0);
    for (double& cell : cells) cell = shared * cell + film;
  }
  return result;
}

double Probed::error_times_work(int parameters, bool turned) const {
  double product = 1;
  for (int lane = 0; lane < parameters; ++lane) {
    const Spread spread = this->spread(lane, turned);
    std::vector<TermFigures> figures(spread.variances.size());
    for (size_t slot = 0; slot < figures.size(); ++slot) {
      figures[slot] = {.variance = std::max(spread.variances[slot], 0.0),
                       .cost = pilot.work[slot],
                       .least = slot == pilot.pixel_slot ? 1 : kLeastSamples,
                       .first = pilot.first_work[slot],
                       .shares = pilot.shares(slot, lane),
                       .on_film = !pilot.in_cells(slot),
                       .squared_mean = spread.squared_means[slot]};
    }
    product *= std::pow(least_error_times_cost(figures), 1.0 / parameters);
  }
  return product;
}

Probed probe(const TermEstimator& estimator, bool turns, const PilotSize& size,
             const RunSettings& settings, const Stopwatch& watch, const TermsAt& at) {
  Probed probed{run_pilot(estimator, turns, {0, size.spp, size.pixels}, settings, watch, at), {}};
  if (const int reach = estimator.reach(); reach > 0)
    probed.shared = SharedPlace::mean_squares(estimator.scene().film.filter, reach);
  if (turns && probed.pilot.spp > 0)
    probed.fit = fit_fields(probed.pilot, estimator.lanes(), settings.threads);
  return probed;
}

void extend(Probed& probed, const TermEstimator& estimator, bool turns, const PilotSize& size,
            const RunSettings& settings, const Stopwatch& watch) {
  if (size.spp - probed.pilot.spp < 4) return;
  const PilotFigures more =
      run_pilot(estimator, turns, {probed.pilot.spp, size.spp, size.pixels}, settings, watch);
  if (more.spp == 0) return;
  probed.pilot.merge(more);
  if (turns) probed.fit = fit_fields(probed.pilot, estimator.lanes(), settings.threads);
}

}  // namespace limn
