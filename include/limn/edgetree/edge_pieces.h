#pragma once
// Pieces of edges as seen from a point, weighted and sampled by their contribution to the boundary
// integral for a unit radiance difference.
//
// Let a and b be the unit directions of a piece's ends, at the distances l_a and l_b. The points
// between are seen along z(u) = (1 - u) a + u b, 0 <= u <= 1. In u the integrand f_s det(w_0, w_1,
// v) / |w|^3 dt becomes
// f_s(z / |z|) (a x b) . ((1 - u) v_a / l_a + u v_b / l_b) / |z|^3 du:
// The dependence on distance cancels, the velocity is linear in u, and |z| is nearly 1 for short
// pieces. So u is sampled uniformly, and a piece's weight is the two-point Gauss-Legendre
// quadrature of the modulus, with a transformed cosine for f_s. No closed form is needed. No weight
// cancels to zero: a linear function that vanishes at both points is zero everywhere, and the
// cosine is positive above the horizon.
#include <span>
#include <vector>

#include "limn/edgetree/direction_cone.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

struct EdgePiece {
  EdgeRef edge;
  double t0, t1;                  // parameter range on the edge
  double inverse_l0, inverse_l1;  // of the end points' distances
  double weight;                  // > 0

  // A point for u uniform in [0, 1), and its density with respect to the edge's parameter t.
  struct Sample {
    double t, density;
  };
  Sample place(double u) const;
};

// Appends the parts of the edges inside of the cone and above the query's horizon, in pieces of at
// most 0.3 rad, less in narrow lobes. Skips edges that are static relative to the query and edges
// whose line passes through p.
void cut_edges(const EdgeSamplerInput& input, const EdgeQuery& query, const DirectionCone& cone,
               std::span<const ListedEdge> edges, std::vector<EdgePiece>& pieces);

}  // namespace limn
