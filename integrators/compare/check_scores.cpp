// Weighted sums of what a gradient and differences disagree in, and their errors.
#include "integrators/compare/check_scores.h"

#include <algorithm>
#include <cmath>

#include "integrators/compare/edge_events.h"
#include "limn/integrators/statistics.h"

namespace limn {
namespace {

constexpr size_t kBatchesOfHalf = 3;  // the fewest that weights are taken from
// Where fewer events than this are expected, those that rule the variance may not have come. Not
// tuned.
constexpr double kFewEvents = 20;

using Batches = std::vector<Moments::Batch>;

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

// Mean and variance of a probe over batches, or of those with one parity (0 or 1; else all).
struct Estimate {
  double mean = 0, variance = 0;
};
Estimate estimate(const Batches& batches, const Probe& probe) {
  Moments moments(1);
  for (size_t b = 0; b < batches.size(); ++b) {
    moments.add_batch({dot(probe[b % 2], batches[b].sums)}, batches[b].samples);
  }
  return {moments.mean(0), moments.variance(0)};
}

// All windows over one half of the batches.
Moments half(const Batches& batches, size_t parity) {
  Moments moments(batches.empty() ? 0 : batches[0].sums.size());
  for (size_t b = parity; b < batches.size(); b += 2) {
    moments.add_batch(batches[b].sums, batches[b].samples);
  }
  return moments;
}

// What the terms of edges, or the others, add to a block.
std::vector<double> magnitude_of_edges(const GradientResult& result, const ParameterGradient& g,
                                       const std::vector<double>& differences) {
  std::vector<double> known(differences.size()), sliding(differences.size());
  for (size_t t = 0; t < result.terms.size(); ++t) {
    if (!result.terms[t].computed) continue;
    for (size_t i = 0; i < known.size(); ++i) {
      const double mean = g.term_blocks[t].mean(i);
      if (result.terms[t].edges) {
        known[i] += std::fabs(mean);
      } else {
        sliding[i] += mean;
      }
    }
  }
  // The gradient's own events may be those that have not come.
  for (size_t i = 0; i < known.size(); ++i) {
    known[i] = std::max(known[i], std::fabs(differences[i] - sliding[i]));
  }
  return known;
}

}  // namespace

Windows::Axis::Axis(int pixels, int spacing, int fine) : count((pixels + spacing - 1) / spacing) {
  for (int begin = 0; begin < pixels; begin += fine) {
    const double middle = 0.5 * (begin + std::min(begin + fine, pixels));
    const double place = std::clamp(middle / spacing - 0.5, 0.0, count - 1.0);
    first.push_back(std::min(static_cast<int>(place), std::max(count - 2, 0)));
    second_weight.push_back(place - first.back());
  }
}

Windows::Windows(const Film& film, int spacing, int fine)
    : fine_(fine), x_(film.crop_width, spacing, fine), y_(film.crop_height, spacing, fine) {}

// visit(block, window, weight) for all pairs that belong together.
template <class Visit>
void Windows::visit(const Visit& visit) const {
  size_t block = 0;
  for (size_t y = 0; y < y_.first.size(); ++y) {
    for (size_t x = 0; x < x_.first.size(); ++x, ++block) {
      for (const int dy : {0, 1}) {
        const double wy = dy == 1 ? y_.second_weight[y] : 1 - y_.second_weight[y];
        for (const int dx : {0, 1}) {
          const double w = wy * (dx == 1 ? x_.second_weight[x] : 1 - x_.second_weight[x]);
          if (w == 0) continue;
          visit(block, static_cast<size_t>(y_.first[y] + dy) * x_.count + x_.first[x] + dx, w);
        }
      }
    }
  }
}

std::vector<double> Windows::gather(const std::vector<double>& blocks) const {
  std::vector<double> values(size());
  visit([&](size_t block, size_t window, double w) { values[window] += w * blocks[block]; });
  return values;
}

std::vector<double> Windows::spread(const std::vector<double>& weights) const {
  std::vector<double> values(x_.first.size() * y_.first.size());
  visit([&](size_t block, size_t window, double w) { values[block] += w * weights[window]; });
  return values;
}

Residual::Residual(const Windows& windows, const GradientResult& gradient,
                   const DifferenceEstimate& differences, const std::vector<double>& radiance,
                   const std::vector<double>& largest, double step)
    : windows_(windows) {
  const ParameterGradient& g = gradient.parameters[0];
  gradient_ = gather(g.total_blocks);
  differences_ = gather(differences.blocks);
  degrees_ = std::min(g.total_blocks.degrees(), differences.blocks.degrees());
  // Events of size x at such a rate that their mean is m have a variance of |m| x per sample, also
  // in places where none has come.
  const std::vector<double> of_differences = means(differences.blocks);
  const std::vector<double> edges = magnitude_of_edges(gradient, g, of_differences);
  const auto samples = static_cast<double>(g.total_blocks.samples());
  const auto difference_samples = static_cast<double>(differences.blocks.samples());
  const EventSizes of_edges = event_sizes(batches_of_edges(gradient));
  const EventSizes of_steps = event_sizes(differences.blocks.kept());
  for (size_t i = 0; i < edges.size(); ++i) {
    rare_gradient_.magnitude.push_back(edges[i]);
    rare_gradient_.of_mean_size.push_back(edges[i] * of_edges.mean / samples);
    rare_gradient_.of_large_size.push_back(edges[i] * of_edges.large / samples);
    // Differences may hold all of it as events; one that has not been seen at all is as large as
    // a sample may be, over both steps.
    const double all =
        std::max({edges[i], std::fabs(of_differences[i]), std::fabs(g.total_blocks.mean(i))});
    const double unseen = largest.empty() ? 0 : largest[i] / (2 * step);
    const double large = std::max(of_steps.large, unseen);
    rare_differences_.magnitude.push_back(all);
    rare_differences_.of_mean_size.push_back(all * of_steps.mean / difference_samples);
    rare_differences_.of_large_size.push_back(all * large / difference_samples);
  }
  // A difference of two images of radiance L over 2 h is rounded to some hundred units in the last
  // place of L / h.
  rounding_ = windows.gather(radiance);
  for (double& r : rounding_) r *= 0x1p-44 / step;
}

Batches Residual::gather(const Moments& blocks) const {
  Batches batches;
  for (const Moments::Batch& batch : blocks.kept()) {
    batches.push_back({windows_.gather(batch.sums), batch.samples});
  }
  return batches;
}

double Residual::rare(const Probe& probe, const Rare& variances) const {
  double mean = 0, of_mean_size = 0, of_large_size = 0;
  for (const std::vector<double>& weights : probe) {
    const std::vector<double> of_blocks = windows_.spread(weights);
    for (size_t i = 0; i < of_blocks.size(); ++i) {
      const double square = 0.5 * of_blocks[i] * of_blocks[i];
      mean += 0.5 * std::fabs(of_blocks[i]) * variances.magnitude[i];
      of_mean_size += square * variances.of_mean_size[i];
      of_large_size += square * variances.of_large_size[i];
    }
  }
  return mean * mean < kFewEvents * of_large_size ? std::max(of_mean_size, of_large_size)
                                                  : of_mean_size;
}

Score Residual::score(const Probe& probe) const {
  const Estimate g = estimate(gradient_, probe);
  const Estimate d = estimate(differences_, probe);
  double rounding = 0;
  for (size_t i = 0; i < rounding_.size(); ++i) rounding += std::fabs(probe[0][i]) * rounding_[i];
  Score score;
  score.value = d.mean - g.mean;
  score.batch_error = std::sqrt(g.variance + d.variance + rounding * rounding);
  score.gradient_variance = std::max(g.variance, rare(probe, rare_gradient_));
  score.difference_variance =
      std::max(d.variance, rare(probe, rare_differences_)) + rounding * rounding;
  score.error = std::sqrt(score.gradient_variance + score.difference_variance);
  if (score.value == 0) return score;
  score.z = normal_from_student(score.value / score.error, degrees());
  return score;
}

std::vector<Score> Residual::window_scores() const {
  std::vector<Score> scores;
  Probe probe{std::vector<double>(windows_.size()), std::vector<double>(windows_.size())};
  for (size_t k = 0; k < windows_.size(); ++k) {
    probe[0][k] = probe[1][k] = 1;
    scores.push_back(score(probe));
    probe[0][k] = probe[1][k] = 0;
  }
  return scores;
}

Probe Residual::term_probe(const Moments& term_blocks) const {
  const size_t size = windows_.size();
  Probe probe{std::vector<double>(size), std::vector<double>(size)};
  const Batches term = gather(term_blocks);
  if (std::min(term.size(), gradient_.size()) < 2 * kBatchesOfHalf) return probe;
  std::vector<double> rare = rare_gradient_.of_mean_size;
  for (size_t i = 0; i < rare.size(); ++i) rare[i] += rare_differences_.of_mean_size[i];
  rare = windows_.gather(rare);
  for (const size_t parity : {0, 1}) {
    const Moments mean = half(term, 1 - parity);
    const Moments g = half(gradient_, 1 - parity);
    const Moments d = half(differences_, 1 - parity);
    std::vector<double> variance(size);
    for (size_t k = 0; k < size; ++k) {
      variance[k] = std::max(0.5 * (g.variance(k) + d.variance(k)), rare[k]);
    }
    // No window weighs by a variance that is small by chance.
    const double least = 1e-3 * mean_of(variance);
    double square = 0;
    for (size_t k = 0; k < size; ++k) {
      const double v = std::max(variance[k], least);
      if (v == 0) continue;
      probe[parity][k] = mean.mean(k) / v;
      square += probe[parity][k] * mean.mean(k);
    }
    for (double& w : probe[parity]) w = square > 0 ? w / std::sqrt(square) : 0;
  }
  return probe;
}

double Residual::magnitude(const Moments& blocks) const {
  Moments windows(windows_.size());
  for (const Moments::Batch& batch : gather(blocks)) windows.add_batch(batch.sums, batch.samples);
  double sum = 0;
  for (size_t k = 0; k < windows.size(); ++k) {
    sum += magnitude_without_noise(windows.mean(k), std::sqrt(windows.variance(k)));
  }
  return std::max(sum, 0.0);
}

// Around zero the mean magnitude is root(2 / pi) errors, as is what is taken off.
double magnitude_without_noise(double mean, double error) {
  if (error == 0) return std::fabs(mean);
  const double z = mean / error;
  return std::fabs(mean) - 2 / std::sqrt(kPi) * error * std::exp(-0.5 * z * z);
}

double student_from_normal(double z, double degrees) {
  const double s = z * (8 * degrees + 3) / (8 * degrees + 1);
  return std::sqrt(degrees * std::expm1(s * s / degrees));
}

}  // namespace limn
