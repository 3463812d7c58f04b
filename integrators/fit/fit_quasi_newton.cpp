// Steps of L-BFGS: a direction within bounds, a search along it, and what happens at rest.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "integrators/fit/fit_impl.h"
#include "integrators/terms/term.h"
#include "limn/core/error.h"
#include "limn/integrators/methods.h"

namespace limn {

void Fit::Impl::check_exact() {
  if (!options_.backward.method->closed_light) {
    throw InputError(fmt::format(
        "the optimiser lbfgs compares gradients of different steps, and those of the method {} "
        "are noisy: take the method analytic, or the optimiser adam-uniform",
        options_.backward.method.name()));
  }
  if (!is_unbiased(options_.loss)) {
    throw InputError(
        fmt::format("the optimiser lbfgs needs a smooth loss: take l2 or relative-l2, not {}",
                    kLosses[static_cast<int>(options_.loss)]));
  }
  if (options_.spp_doubling > 0 || options_.step_half_life > 0 || options_.loss_spp > 0) {
    throw InputError(
        "the optimiser lbfgs minimises one function, of the same samples at every step, and finds "
        "its steps by itself: leave out the doubling of samples, the half-life of steps and "
        "samples of the loss");
  }
  if (over_faces()) return;  // all silhouettes are in the losses and their gradients
  const std::vector<std::string>& terms = options_.backward.terms;
  const bool camera =
      terms.empty() || std::find(terms.begin(), terms.end(), film_term().name) != terms.end();
  for (size_t v = 0; v < views.size(); ++v) {
    if (!moves_on_film(v)) continue;
    warnings.push_back(
        "what is fitted moves silhouettes that the camera sees: a film sample that one of them "
        "passes makes the loss discontinuous, by its share of a pixel; with many samples per pixel "
        "the "
        "steps of lbfgs get over that");
    if (camera) {
      warnings.back() +=
          ". The gradient has their part of the mean image's, an estimate of the term camera, "
          "which no difference of these losses shows; the term interior alone leaves it out";
    }
    return;
  }
}

std::optional<Fit::Impl::Iterate> Fit::Impl::place() {
  Iterate place;
  std::vector<std::vector<double>> gradients;
  if (!evaluate(place.record, gradients)) return std::nullopt;
  for (size_t i = 0; i < parameters_.size(); ++i) {
    const std::vector<double> own = parameters_[i].scaled(gradients[i]);
    place.gradient.insert(place.gradient.end(), own.begin(), own.end());
  }
  return place;
}

std::vector<double> Fit::Impl::lengths_to_bounds(const std::vector<double>& direction) const {
  std::vector<double> lengths;
  auto next = direction.begin();
  for (const FitParameter& p : parameters_) {
    const std::vector<double> own(next, next + static_cast<ptrdiff_t>(p.size()));
    next += static_cast<ptrdiff_t>(p.size());
    for (const double length : p.lengths_to_bounds(own, views)) lengths.push_back(length);
  }
  return lengths;
}

// What a bound holds back from going down is as if it were not fitted: it is left out of the
// gradient and of the pairs, or these would tell of a function that cannot be had (as in the
// projected methods of Bertsekas 1982).
Fit::Impl::Line Fit::Impl::downwards() const {
  std::vector<double> gradient = here_->gradient;
  std::vector<double> down = gradient;
  for (double& x : down) x = -x;
  const std::vector<double> reach = lengths_to_bounds(down);
  std::vector<bool> held(reach.size());
  for (size_t i = 0; i < held.size(); ++i) {
    held[i] = reach[i] <= 0;
    if (held[i]) gradient[i] = 0;
  }
  const QuasiNewton free = quasi_newton_.without(held);
  Line line{free.direction(gradient), {}, free.empty()};
  line.lengths = lengths_to_bounds(line.direction);
  for (size_t i = 0; i < held.size(); ++i) {
    if (line.lengths[i] <= 0) line.direction[i] = 0;
  }
  return line;
}

std::optional<std::vector<double>> Fit::Impl::advance(const std::vector<double>& direction,
                                                      double length) {
  std::vector<double> added;
  auto next = direction.begin();
  for (FitParameter& p : parameters_) {
    std::vector<double> step(next, next + static_cast<ptrdiff_t>(p.size()));
    next += static_cast<ptrdiff_t>(p.size());
    for (double& x : step) x *= length;
    try {
      if (!p.add(step, views)) return std::nullopt;
    } catch (const InputError&) {  // the step is too long for what is moved
      return std::nullopt;
    }
    added.insert(added.end(), step.begin(), step.end());
  }
  return added;
}

std::optional<std::pair<Fit::Impl::Iterate, std::vector<double>>> Fit::Impl::search_from(
    const Iterate& start, const FitState& before, const Line& line, double first, FitRecord& record,
    bool& interrupted) {
  std::optional<Iterate> there;
  std::vector<double> moved;
  double last = 0;
  const double slope = inner_product(start.gradient, line.direction);
  const auto evaluate_at = [&](double at) -> std::optional<LinePoint> {
    put(before);
    last = at;
    const auto added = advance(line.direction, at);
    if (!added) {
      ++record.halvings;
      return LinePoint{at, std::numeric_limits<double>::infinity(), 0};
    }
    moved = *added;
    ++record.evaluations;
    there = place();
    interrupted = !there;
    if (interrupted) return std::nullopt;
    LinePoint point{at, there->record.loss, 0};
    for (size_t i = 0; i < moved.size(); ++i) {
      const double d = line.direction[i];
      if (at < line.lengths[i]) {
        point.slope += there->gradient[i] * d;
      } else {
        point.held += start.gradient[i] * (at * d - moved[i]);
      }
    }
    return point;
  };
  if (!(slope < 0)) return std::nullopt;
  const auto found = wolfe_search(evaluate_at, {0, start.record.loss, slope}, first);
  if (found && found->at != last) evaluate_at(found->at);
  if (!found || interrupted) return std::nullopt;
  return std::make_pair(std::move(*there), std::move(moved));
}

// Moves to a lower place along the line, from here_.
Fit::Impl::Search Fit::Impl::search_along(const Line& line, double first, FitRecord& record) {
  const FitState before = state();
  const Iterate start = *here_;
  const auto go_back = [&] {
    put(before);
    here_ = start;
  };
  bool interrupted = false;
  std::optional<std::pair<Iterate, std::vector<double>>> found;
  try {
    found = search_from(start, before, line, first, record, interrupted);
  } catch (...) {
    go_back();
    throw;
  }
  if (!found) {
    go_back();
    return interrupted ? Search::kInterrupted : Search::kNone;
  }
  std::vector<double> change = found->first.gradient;
  for (size_t i = 0; i < change.size(); ++i) change[i] -= start.gradient[i];
  quasi_newton_.add(std::move(found->second), std::move(change));
  here_ = std::move(found->first);
  return Search::kFound;
}

void Fit::Impl::skip_to_remeshing() {
  std::optional<int64_t> next;
  for (const int64_t step : options_.remesh) {
    if (step > steps && (!next || step < *next)) next = step;
  }
  if (next) steps = *next - 1;
}

// Where the pairs of earlier steps lead nowhere, once more without them.
std::optional<FitRecord> Fit::Impl::quasi_newton_step() {
  const Stopwatch watch;
  const bool known = here_.has_value();
  if (!known) here_ = place();
  if (!here_) return std::nullopt;
  FitRecord record = here_->record;
  record.step = steps;
  record.evaluations = known ? 0 : 1;
  Search search = Search::kNone;
  while (search == Search::kNone && !record.at_rest) {
    const Line line = downwards();
    double largest = 0;
    for (const double x : line.direction) largest = std::max(largest, std::fabs(x));
    // Without pairs nothing is known of the size of a step but what the user says.
    const double first = line.fresh && largest > 0 ? options_.step * shrunk() / largest : 1;
    record.step_size = first * largest;
    search = search_along(line, first, record);
    if (search == Search::kInterrupted) return std::nullopt;
    record.at_rest = search == Search::kNone && line.fresh;
    if (search == Search::kNone) quasi_newton_.clear();
  }
  if (record.at_rest) skip_to_remeshing();
  finish_step(record);
  if (record.remeshed) {
    record.at_rest = false;
    here_.reset();
    quasi_newton_.clear();
  }
  record.seconds = watch.seconds();
  return record;
}

}  // namespace limn
