#pragma once
// The factor by which estimates of a term differ from its truth, over all its values at once.
#include <string>
#include <vector>

#include "limn/core/scene.h"
#include "limn/integrators/gradient.h"

namespace limn {

// Images of all parameters, one after another.
using Values = std::vector<double>;

struct TermFactor {
  double value = 1, sigma = 0;  // the factor and its standard error
};

// errors: of independent runs, an even number, each an estimate minus the truth; terms: what the
// term adds in each. groups: the numbers of values of every parameter. With t a value of the term,
// from the mean of all other runs, and weights u = t / (|t| + mean |t| of its parameter), a run
// gives the factor 1 + sum(u error) / sum(u t) of a parameter. The mean over parameters weighs them
// by their variance in the other half of the runs; its standard error is from the spread over runs,
// so that it holds whatever the correlation between values.
TermFactor term_factor(const std::vector<Values>& errors, const std::vector<Values>& terms,
                       const std::vector<size_t>& groups);

// The factor is 1, to what a right program exceeds with a chance of 1e-4, and a term scaled by 1 +
// scale or 1 - scale would fail that with 95 %: of 32 runs.
void expect_factor(const std::string& name, const TermFactor& factor, double scale = 0.1);

// One run: the total of every parameter, and the sum of some of its terms.
struct TermRunValues {
  Values total, term;
};
// options.terms: those in the total. of: the terms in the sum.
TermRunValues run_term(const Scene& scene, const GradientOptions& options,
                       const std::vector<std::string>& of, int spp, uint64_t seed);

Values difference(const Values& a, const Values& b);
Values mean_values(const std::vector<Values>& all);
void append(Values& to, const Values& more);

}  // namespace limn
