#pragma once
// What a run reports of itself among GradientResult::settings.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "integrators/pilot/probed.h"
#include "integrators/pilot/sample_plan.h"
#include "limn/integrators/gradient.h"

namespace limn {

inline void describe_warping(const WarpOptions& warp, GradientResult& result) {
  TermCost all;
  for (const TermRun& term : result.terms) all.merge(term.cost);
  const auto share = [](uint64_t part, uint64_t of) {
    return of > 0 ? static_cast<double>(part) / static_cast<double>(of) : 0;
  };
  result.settings.push_back({"auxiliary rays", static_cast<double>(warp.rays)});
  result.settings.push_back({"kappa", warp.kappa});
  result.settings.push_back({"directions ruled by one ray", share(all.dominated, all.warped)});
  result.settings.push_back({"rays on an edge", static_cast<double>(all.dropped)});
}

inline void describe_film(const std::vector<FilmMotion>& film, GradientResult& result) {
  const auto moving = std::count_if(film.begin(), film.end(), [](const FilmMotion& motion) {
    return !is_zero(motion.x) || !is_zero(motion.y);
  });
  const double share = static_cast<double>(moving) / static_cast<double>(film.size());
  result.settings.push_back(
      {"share of pixels with reparameterised film samples", std::round(share * 100) / 100});
}

inline void describe_pilot(const Probed& probed, bool looked, double detail,
                           GradientResult& result) {
  result.settings.push_back({"pilot", probed.pilot.spp == 0
                                          ? std::string("none: too few samples fit into the time")
                                          : fmt::format("{} samples of {} pixels", probed.pilot.spp,
                                                        probed.pilot.grid.size())});
  result.settings.push_back(
      {"film motion",
       fmt::format("{}looked for; {:.3g} moving edges in a pixel", looked ? "" : "not ", detail)});
}

}  // namespace limn
