#pragma once
// Sight through parallel layers of media: planes of water and panes of glass.
#include <span>

#include "limn/core/vec.h"

namespace limn {

struct FlatLayer {
  double height;  // along the layers' normal; positive
  double index;   // of refraction; of all layers over any one
};

// The unit direction in which a point sees another one through layers. With h_j their heights, n_j
// their indices and R the distance of both points across the normal, the path has
//   sum over j of h_j tan(theta_j) = R,   n_j sin(theta_j) the same for all j.
// In u = tan(theta) of the layer of the least index the sum is concave and grows without bound: it
// has one root, to which Newton's method rises from 0. way: from the one to the other; n: the unit
// normal along it, of which way has the sum of all heights.
Vec3d direction_through(std::span<const FlatLayer> layers, const Vec3d& n, const Vec3d& way);

}  // namespace limn
