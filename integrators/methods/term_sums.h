#pragma once
// Sums of batches, as moments of parameters.
#include <algorithm>
#include <vector>

#include "integrators/estimates/tiles.h"
#include "limn/integrators/gradient.h"

namespace limn {

// Collects sums of batches into the moments of one parameter. sums: of its lane, for each term
// (empty for those that are not computed).
inline void collect(const std::vector<const std::vector<double>*>& sums,
                    const std::vector<TermRun>& terms, int samples, const Film& film, int block,
                    ParameterGradient& g) {
  const int width = film.crop_width;
  const int height = film.crop_height;
  std::vector<double> edges(film_size(film));
  std::vector<double> total(film_size(film));
  // Terms of edges by themselves first: the order of a sum decides its last bits.
  for (const bool of_edges : {true, false}) {
    for (size_t t = 0; t < terms.size(); ++t) {
      if (!sums[t] || terms[t].edges != of_edges) continue;
      std::vector<double>& to = of_edges ? edges : total;
      for (size_t i = 0; i < to.size(); ++i) to[i] += (*sums[t])[i];
    }
  }
  for (size_t i = 0; i < total.size(); ++i) total[i] += edges[i];
  for (size_t t = 0; t < terms.size(); ++t) {
    if (!sums[t]) continue;
    g.terms[t].add_batch(*sums[t], samples);
    if (block > 0) g.term_blocks[t].add_batch(sum_blocks(*sums[t], width, height, block), samples);
  }
  g.total.add_batch(total, samples);
  g.image_sum.add_batch(sum_blocks(total, width, height, std::max(width, height)), samples);
  if (block > 0) g.total_blocks.add_batch(sum_blocks(total, width, height, block), samples);
}

}  // namespace limn
