// Samples of each term for the least error after equal time.
#include "integrators/methods/allocation.h"

#include <algorithm>
#include <numeric>

namespace limn {
namespace {

constexpr int kMost = 8;  // not tuned
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

std::vector<double> mean_variances(const ParameterGradient& gradient, size_t pixel_count) {
  std::vector<std::vector<double>> terms;
  for (const Moments& term : gradient.terms) {
    terms.push_back(term.size() > 0 ? pixel_variances(term) : std::vector<double>(pixel_count));
  }
  std::vector<double> all(pixel_count);
  for (const auto& term : terms) {
    for (size_t i = 0; i < pixel_count; ++i) all[i] += term[i];
  }
  std::vector<size_t> pixels(pixel_count);
  for (size_t i = 0; i < pixels.size(); ++i) pixels[i] = i;
  const size_t kept = pixels.size() - pixels.size() / 1000;
  std::stable_sort(pixels.begin(), pixels.end(),
                   [&](size_t a, size_t b) { return all[a] < all[b]; });
  std::vector<double> means(terms.size());
  for (size_t t = 0; t < terms.size(); ++t) {
    for (size_t i = 0; i < kept; ++i) means[t] += terms[t][pixels[i]] / static_cast<double>(kept);
  }
  return means;
}

std::vector<double> counts_to_try(const TermFigures& term) {
  std::vector<double> counts;
  // What costs nothing or does not vary is not there, or not worth more.
  for (double c = term.least; c < 1 && term.cost > 0; c *= 2) counts.push_back(c);
  for (int c = 1; c <= (term.variance > 0 && term.cost > 0 ? kMost : 1); ++c) counts.push_back(c);
  return counts;
}

}  // namespace

SampleCounts best_samples(const std::vector<TermFigures>& figures) {
  struct Choice {
    std::vector<double> samples;
    double cost = 0, variance = 0;
    double product() const { return variance * cost; }
  };
  std::vector<Choice> choices(1);
  for (const TermFigures& term : figures) {
    std::vector<Choice> longer;
    for (const Choice& choice : choices) {
      for (const double n : counts_to_try(term)) {
        Choice& c = longer.emplace_back(choice);
        c.samples.push_back(n);
        c.cost += term.cost * n;
        c.variance += term.variance / n;
      }
    }
    choices = std::move(longer);
  }
  double least = choices[0].product();
  for (const Choice& c : choices) least = std::min(least, c.product());
  if (!(least > 0)) return {};
  const Choice* best = nullptr;
  for (const Choice& c : choices) {
    if (c.product() <= kTie * least && (!best || c.cost < best->cost)) best = &c;
  }
  return SampleCounts(best->samples);
}

std::vector<double> pilot_variances(const GradientResult& pilot) {
  std::vector<double> shares(pilot.terms.size());
  for (const ParameterGradient& gradient : pilot.parameters) {
    const std::vector<double> variances = mean_variances(gradient, gradient.total.size() / 3);
    const double sum = std::accumulate(variances.begin(), variances.end(), 0.0);
    if (!(sum > 0)) continue;
    for (size_t t = 0; t < shares.size(); ++t) shares[t] += variances[t] / sum;
  }
  return shares;
}

int pilot_samples(size_t pixels, int spp) {
  // At least two, for variances; at most an eighth of the job; more than some ten thousand paths
  // say nothing new.
  constexpr size_t kEnough = 16384;  // not tuned
  if (spp < 16) return 0;
  const size_t wanted = (kEnough + pixels - 1) / pixels;
  return static_cast<int>(std::clamp<size_t>(wanted, 2, std::min(8, spp / 8)));
}

}  // namespace limn
