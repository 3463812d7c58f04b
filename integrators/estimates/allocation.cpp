#include "integrators/estimates/allocation.h"

#include <algorithm>

namespace limn {
namespace {

constexpr int kMost = 8;
// The camera's samples are drawn over the whole film: there may be fewer of them than pixels.
constexpr double kLeastCamera = 0.125;
// Products that differ by less are equal as far as a pilot can tell; the cheaper one leaves less
// behind when a run is stopped.
constexpr double kTie = 1.01;

// The variance of one sample of every pixel, over its channels.
std::vector<double> pixel_variances(const Moments& moments) {
  std::vector<double> variances(moments.size() / 3);
  for (size_t i = 0; i < moments.size(); ++i) {
    variances[i / 3] += moments.variance(i) * static_cast<double>(moments.samples());
  }
  return variances;
}

std::array<double, kTermCount> mean_variances(const ParameterGradient& gradient) {
  std::array<std::vector<double>, kTermCount> terms;
  for (int t = 0; t < kTermCount; ++t) terms[t] = pixel_variances(gradient.terms[t]);
  const auto all = [&](size_t i) { return terms[0][i] + terms[1][i] + terms[2][i]; };
  std::vector<size_t> pixels(terms[0].size());
  for (size_t i = 0; i < pixels.size(); ++i) pixels[i] = i;
  const size_t kept = pixels.size() - pixels.size() / 1000;
  std::stable_sort(pixels.begin(), pixels.end(),
                   [&](size_t a, size_t b) { return all(a) < all(b); });
  std::array<double, kTermCount> means{};
  for (int t = 0; t < kTermCount; ++t) {
    for (size_t i = 0; i < kept; ++i) means[t] += terms[t][pixels[i]] / static_cast<double>(kept);
  }
  return means;
}

std::vector<double> counts_to_try(const TermFigures& term, double least) {
  std::vector<double> counts;
  // What costs nothing or does not vary is not there, or not worth more.
  for (double c = least; c < 1 && term.cost > 0; c *= 2) counts.push_back(c);
  for (int c = 1; c <= (term.variance > 0 && term.cost > 0 ? kMost : 1); ++c) counts.push_back(c);
  return counts;
}

}  // namespace

SampleCounts best_samples(const PilotFigures& figures) {
  struct Choice {
    SampleCounts samples;
    double cost, product;
  };
  const auto& [interior, camera, boundary] = figures;
  std::vector<Choice> choices;
  for (const double i : counts_to_try(interior, 1)) {
    for (const double c : counts_to_try(camera, kLeastCamera)) {
      for (const double b : counts_to_try(boundary, 1)) {
        const double cost = interior.cost * i + camera.cost * c + boundary.cost * b;
        const double variance = interior.variance / i + camera.variance / c + boundary.variance / b;
        choices.push_back({{static_cast<int>(i), c, static_cast<int>(b)}, cost, variance * cost});
      }
    }
  }
  double least = choices[0].product;
  for (const Choice& c : choices) least = std::min(least, c.product);
  if (!(least > 0)) return {};
  const Choice* best = nullptr;
  for (const Choice& c : choices) {
    if (c.product <= kTie * least && (!best || c.cost < best->cost)) best = &c;
  }
  return best->samples;
}

PilotFigures pilot_figures(const GradientResult& pilot, double draw_cost) {
  PilotFigures figures;
  for (const ParameterGradient& gradient : pilot.parameters) {
    const auto variances = mean_variances(gradient);
    const double sum = variances[0] + variances[1] + variances[2];
    if (!(sum > 0)) continue;
    for (int t = 0; t < kTermCount; ++t) figures[t].variance += variances[t] / sum;
  }
  for (int t = 0; t < kTermCount; ++t) {
    figures[t].cost = static_cast<double>(pilot.costs[t].rays);
  }
  figures[kBoundary].cost += draw_cost * static_cast<double>(pilot.costs[kBoundary].samples);
  return figures;
}

int pilot_samples(size_t pixels, int spp) {
  // At least two, for variances; at most an eighth of the job; more than some ten thousand paths
  // say nothing new.
  constexpr size_t kEnough = 16384;
  if (spp < 16) return 0;
  const size_t wanted = (kEnough + pixels - 1) / pixels;
  return static_cast<int>(std::clamp<size_t>(wanted, 2, std::min(8, spp / 8)));
}

}  // namespace limn
