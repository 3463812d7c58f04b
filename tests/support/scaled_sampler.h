#pragma once
// Samplers of edges at many scales.
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/rng.h"
#include "limn/edgetree/edge_sampler.h"
#include "meshes.h"

namespace limn {

// Scaling by a power of two commutes with every rounding: probabilities keep their bits.
// input_at(scale): one object around the origin, 2 or less wide, and all else, scaled. least: what
// all probabilities of a query must exceed together.
template <class Sampler, class InputAt>
void expect_same_at_all_scales(const InputAt& input_at, double least) {
  const EdgeSamplerInput unit_input = input_at(1.0);
  const auto unit = Sampler::build(unit_input, 1);
  for (const int exponent : {-80, -40, -3, 10, 45, 60}) {
    const double scale = std::ldexp(1.0, exponent);
    const EdgeSamplerInput input = input_at(scale);
    const auto scaled = Sampler::build(input, 1);
    Rng rng(24, 0, 0);
    for (int i = 0; i < 5; ++i) {
      EdgeQuery query;
      query.p = random_direction(rng) * 2.5;
      query.n = query.wi = -normalize(query.p);
      if (i % 2 == 1) query.lobe = {ggx_lobe(), 0.2, 1};
      EdgeQuery moved = query;
      moved.p = query.p * scale;
      double sum = 0;
      for (uint32_t e = 0; e < input.objects[0].edges.size(); ++e) {
        const EdgeRef id{ShapeId(0), EdgeId(e)};
        const double probability = unit->probability(query, id);
        EXPECT_EQ(scaled->probability(moved, id), probability) << exponent << " " << e;
        sum += probability;
      }
      EXPECT_GT(sum, least) << exponent;
    }
  }
}

}  // namespace limn
