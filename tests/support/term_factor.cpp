// Scores pooled over pixels and parameters.
#include "support/term_factor.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>

namespace limn {
namespace {

// The factor of one parameter, from values begin to end, in run j.
double factor_in(const Values& error, const Values& term, const Values& mean, double runs,
                 size_t begin, size_t end) {
  Values others;
  double size = 0;
  for (size_t i = begin; i < end; ++i) {
    others.push_back((mean[i] * runs - term[i]) / (runs - 1));
    size += std::fabs(others.back()) / static_cast<double>(end - begin);
  }
  double sum = 0, all = 0;
  for (size_t i = begin; i < end; ++i) {
    const double t = others[i - begin], u = size > 0 ? t / (std::fabs(t) + size) : 0;
    sum += u * error[i];
    all += u * t;
  }
  return all > 0 ? 1 + sum / all : 1;
}

double variance_of(std::span<const double> values) {
  double mean = 0, sum = 0;
  const auto n = static_cast<double>(values.size());
  for (const double v : values) mean += v / n;
  for (const double v : values) sum += (v - mean) * (v - mean) / (n - 1);
  return sum;
}

}  // namespace

TermFactor term_factor(const std::vector<Values>& errors, const std::vector<Values>& terms,
                       const std::vector<size_t>& groups) {
  const size_t runs = errors.size(), half = runs / 2;
  const Values mean = mean_values(terms);
  Values factors(runs), weights(runs);
  size_t begin = 0;
  for (const size_t group : groups) {
    Values own;
    for (size_t j = 0; j < runs; ++j) {
      own.push_back(
          factor_in(errors[j], terms[j], mean, static_cast<double>(runs), begin, begin + group));
    }
    begin += group;
    for (size_t j = 0; j < runs; ++j) {
      const double variance = variance_of({&own[j < half ? half : 0], half});
      if (!(variance > 0)) continue;
      factors[j] += own[j] / variance;
      weights[j] += 1 / variance;
    }
  }
  EXPECT_EQ(begin, errors[0].size());
  TermFactor factor{0, 0};
  for (size_t j = 0; j < runs; ++j) {
    factors[j] /= weights[j];
    factor.value += factors[j] / static_cast<double>(runs);
  }
  factor.sigma = std::sqrt(variance_of(factors) / static_cast<double>(runs));
  return factor;
}

void expect_factor(const std::string& name, const TermFactor& factor, double scale) {
  // Of Student's distribution with some thirty degrees of freedom: a chance of 1e-4 in both tails,
  // and 95 % in one.
  constexpr double kLimit = 4.5, kPower = 1.7;
  fmt::print("{:32} factor {:.4f} +- {:.4f}\n", name, factor.value, factor.sigma);
  EXPECT_LE(std::fabs(factor.value - 1), kLimit * factor.sigma) << name;
  EXPECT_LE(factor.sigma, scale / (kLimit + kPower)) << name;
}

TermRunValues run_term(const Scene& scene, const GradientOptions& options,
                       const std::vector<std::string>& of, int spp, uint64_t seed) {
  RunSettings settings;
  settings.spp = spp;
  settings.seed = seed;
  const GradientResult result = gradient(scene, options, settings);
  EXPECT_EQ(result.non_finite.count, 0u) << result.non_finite.message();
  TermRunValues values;
  for (const ParameterGradient& g : result.parameters) {
    append(values.total, means(g.total));
    Values sum(g.total.size());
    for (size_t t = 0; t < result.terms.size(); ++t) {
      if (std::ranges::find(of, result.terms[t].name) == of.end()) continue;
      for (size_t i = 0; i < sum.size(); ++i) sum[i] += g.terms[t].mean(i);
    }
    append(values.term, sum);
  }
  return values;
}

Values difference(const Values& a, const Values& b) {
  Values result(a.size());
  for (size_t i = 0; i < a.size(); ++i) result[i] = a[i] - b[i];
  return result;
}

Values mean_values(const std::vector<Values>& all) {
  Values mean(all[0].size());
  for (const Values& values : all) {
    for (size_t i = 0; i < mean.size(); ++i) {
      mean[i] += values[i] / static_cast<double>(all.size());
    }
  }
  return mean;
}

void append(Values& to, const Values& more) { to.insert(to.end(), more.begin(), more.end()); }

}  // namespace limn
