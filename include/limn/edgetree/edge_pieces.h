#pragma once
// Parts of edges as seen from a point, weighed and drawn by what they add to the boundary integral
// if radiance jumps by one across them.
//
// Between the unit directions a and b of a piece's ends, at the distances l_a and l_b, points are
// seen along z(u) = (1 - u) a + u b, 0 <= u <= 1. In u the integrand f_s det(w_0, w_1, v) / |w|^3
// dt becomes
//   f_s(z / |z|) (a x b) . ((1 - u) v_a / l_a + u v_b / l_b) / |z|^3 du:
// what varies with the distance drops out, the velocity is linear in u, and |z| is nearly 1 where
// pieces are short. So u is drawn uniformly, and a piece weighs by two points of Gauss and Legendre
// of the modulus, f_s being the transformed cosine. No closed form is needed, and no weight is zero
// by cancellation: a linear function that vanishes at both points vanishes everywhere, and the
// cosine is positive within a part above the horizon.
#include <span>
#include <vector>

#include "limn/edgetree/direction_cone.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

struct EdgePiece {
  EdgeRef edge;
  double t0, t1;                  // the part of it
  double inverse_l0, inverse_l1;  // of its ends' distances
  double weight;                  // > 0

  // A point, given u uniform in [0, 1), and its density per unit t of the edge.
  struct Place {
    double t, density;
  };
  Place place(double u) const;
};

// Appends what of the edges lies inside the cone and above the query's horizon, in pieces of at
// most 0.3 rad, less in narrow lobes. Nothing of an edge that is at rest relative to the query, or
// whose line meets p.
void cut_edges(const EdgeSamplerInput& input, const EdgeQuery& query, const DirectionCone& cone,
               std::span<const ListedEdge> edges, std::vector<EdgePiece>& pieces);

}  // namespace limn
