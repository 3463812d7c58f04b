#pragma once
// The boundary term of the camera: edges seen from the pinhole, sampled on the film.
//   dI_j/dtheta  +=  integral along the projected edges of h_j(s) dL v_n dl,
// with s the film position [pixels], dl its length element, v_n = ds/dtheta . n the normal speed of
// the projected edge, and dL the radiance behind the normal n minus that before it.
#include <vector>

#include "integrators/terms/edge_jump.h"

namespace limn {

struct FilmEdge {
  EdgeId id;
  double t0, t1;          // the part of the edge that may reach the film
  double depth0, depth1;  // depths of its two ends
  double x0, y0, x1, y1;  // their film positions
  Lanes speed0, speed1;   // v_n there [pixels]; n points to the positive side of EdgeView::side
  double length;          // [pixels]
};

struct FilmSample {
  double x, y;       // film position [pixels]
  Rgb<Lanes> value;  // dL v_n / density
};

class CameraBoundary {
 public:
  // lanes: how many of the derivative lanes are in use.
  CameraBoundary(const PathContext& context, const std::vector<EdgeMesh>& objects, int lanes);

  bool empty() const { return edges_.empty(); }
  // One sample: u in [0, 1) chooses the edge and the point on it. False if it adds nothing.
  bool sample(double u, const Rng& key, RayCount& rays, FilmSample& sample) const;

 private:
  void add_object(uint32_t object);
  bool clip_and_project(EdgeId id, FilmEdge& edge) const;
  void weigh(int lanes);

  const PathContext& context_;
  const std::vector<EdgeMesh>& objects_;
  std::vector<FilmEdge> edges_;
  std::vector<double> cumulative_;  // probabilities of the edges, summed
};

}  // namespace limn
