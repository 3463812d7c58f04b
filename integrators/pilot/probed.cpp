// Figures of pilots and of fits together.
#include "integrators/pilot/probed.h"

#include <algorithm>
#include <cmath>

#include "integrators/pilot/allocation.h"

namespace limn {

std::vector<double> Probed::variances(int lane, std::vector<std::vector<double>>& cells,
                                      bool turned) const {
  const bool fitted = turned && !fit.variances.empty();
  const size_t slots = pilot.work.size();
  std::vector<double> means(slots);
  cells.assign(slots, {});
  for (size_t slot = 0; slot < slots; ++slot) {
    const double film = pilot.film_variance[slot][lane];
    means[slot] = film;
    if (!pilot.in_cells(slot)) continue;
    // Some terms have samples of both kinds.
    cells[slot] = fitted ? fit.variances[lane][slot] : pilot.variances(slot, lane);
    means[slot] += shared * trimmed_mean(cells[slot]);
    for (double& cell : cells[slot]) cell = shared * cell + film;
  }
  return means;
}

double Probed::error_times_work(int parameters, bool turned) const {
  double product = 1;
  for (int lane = 0; lane < parameters; ++lane) {
    std::vector<std::vector<double>> cells;
    const std::vector<double> means = variances(lane, cells, turned);
    std::vector<TermFigures> figures(means.size());
    for (size_t slot = 0; slot < means.size(); ++slot) {
      figures[slot] = {.variance = std::max(means[slot], 0.0),
                       .cost = pilot.work[slot],
                       .least = slot == pilot.pixel_slot ? 1 : kLeastSamples,
                       .first = pilot.first_work[slot],
                       .shares = pilot.shares(slot, lane),
                       .on_film = !pilot.in_cells(slot)};
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
