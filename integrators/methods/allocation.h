#pragma once
// How a job's work is shared among the terms of a derivative.
#include <vector>

#include "limn/integrators/gradient.h"

namespace limn {

// One sample of a term: its variance, in any unit that all terms share, and what it costs, in any
// unit that all terms share.
struct TermFigures {
  double variance = 0;
  double cost = 0;
  double least = 1;  // the fewest samples it can have in a sample of a pixel
};

// After equal time, the squared error goes with (sum of variance / samples) times (sum of cost *
// samples). Its minimum is at samples ~ sqrt(variance / cost); this is the best of the small counts
// in use: at most eight, so that a pilot that saw too little of a term starves it no further.
SampleCounts best_samples(const std::vector<TermFigures>& figures);

// Variances of one sample of each term in a pilot of any number of parameters: means over pixels; a
// thousandth of them, those with the largest variance of all terms together, is left out: single
// bright samples would rule the choice. Each parameter counts alike: its variances are divided by
// their sum.
std::vector<double> pilot_variances(const GradientResult& pilot);

// Samples per pixel of a pilot for a job of `spp` samples of `pixels` pixels; 0 if the job is too
// short for one.
int pilot_samples(size_t pixels, int spp);

}  // namespace limn
