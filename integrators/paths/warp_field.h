#pragma once
// Warped-area sampling (Bangaru, Li, Durand 2020, doi 10.1145/3414685.3417833): directions that
// move with the edges that a point sees. For any continuous tangential field V on the sphere of
// directions at a shading point p that equals on every edge of E(p) the velocity of the edge as
// seen from p, the substitution w -> w + theta V(w) leaves no boundary term,
//   d/dtheta int g dw = int [ dg/dtheta + grad g . V + g div V ] dw,   g = f_s L_i.
// So a sampled direction becomes the dual number (w, V), and the throughput of its path grows by
// (1, div V); densities and MIS weights stay constants. No edge is sampled.
//
// V is an average of the velocities v(w') = (1 - w' w'^T) (y' - p') / t of what rays (p, w') meet
// at distance t (y' of the material point, p' of p; 0 of what escapes),
//   V(w) = (1 - w w^T) X,   X = int K v dw' / int K dw',   K(w, w') = (D + B(w'))^-3,
//   D = exp(kappa (1 - w . w')) - 1,
// with the boundary function B (boundary_function.h): next to an edge K diverges there, and V tends
// to the edge's velocity from both sides. N auxiliary rays, drawn with density ~ exp(kappa w . w'),
// estimate numerator and denominator. They come in pairs that mirror each other about w: what is
// odd around w cancels, of V the slope of v, of div V the gradients of K.
//
// A ratio of estimates is biased, by about 1 / N and more near edges: the method `was`. The method
// `was-unbiased` takes it out by roulette over levels (Rhee and Glynn 2015): with R_n the estimate
// by n rays,
//   R_N + (R_2n - (R_n^a + R_n^b) / 2) / P(k),   n = N 2^(k-1),   P(k) ~ 2^(-3k/2),
// a and b the halves of the 2n rays; the mean of the sum over all levels is that of R for ever more
// rays. Levels have no end, so that nothing is cut off; 35 rays are expected for N = 8.
//
// Lines where surfaces pass through each other move as neither surface does, and edges of several
// surfaces that touch may not either. These are sampled (shading_boundary.cpp): for any V at all,
// what edges add that move with v - |w| V makes up for the difference. The same holds for the edges
// of sharp shadows.
#include <cstdint>

#include "integrators/paths/boundary_function.h"
#include "integrators/paths/direction_field.h"
#include "limn/core/ray_tracer.h"
#include "limn/core/shading.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/run.h"

namespace limn {

// How a unit direction moves, per parameter.
struct DirectionWarp {
  Vec3<Lanes> velocity{};  // V, across the direction [1 / unit of the parameter]
  Lanes divergence{};      // div V: how fast a solid angle around it grows, over its size
};

inline Vec3<Dual> warped(const Vec3d& w, const DirectionWarp& warp) {
  const Vec3<Lanes>& v = warp.velocity;
  return {{w.x, v.x}, {w.y, v.y}, {w.z, v.z}};
}

// What one auxiliary ray found.
struct AuxiliaryRay {
  Vec3d direction;            // w', unit
  double weight = 1;          // exp(kappa (1 - w . w')): one over its density, but for a constant
  double boundary = 1;        // B
  Vec3<Lanes> velocity = {};  // v(w')
};

// The sums over auxiliary rays of one direction w.
class WarpSums {
 public:
  // False if the ray lies on an edge to rounding, and is left out.
  bool add(const Vec3d& w, double kappa, const AuxiliaryRay& ray);
  void merge(const WarpSums& other);
  // V and div V, the rays being held; zero without rays.
  DirectionWarp warp(const Vec3d& w) const;
  // Whether one ray holds nine tenths of all weights.
  bool dominated() const { return largest_ >= 0.9 * weight_; }

 private:
  double weight_ = 0, largest_ = 0;  // sum of K over density
  Vec3d gradient_{};                 // of the same with respect to w
  Vec3<Lanes> velocity_{};           // sum of K v over density
  Lanes along_{};                    // sum of grad K . v over density
};

// What the fields of some directions cost.
struct WarpCount {
  uint64_t fields = 0;     // directions whose motion rays determined
  uint64_t dominated = 0;  // of which one ray held nine tenths of the weights
  uint64_t dropped = 0;    // rays on an edge to rounding

  void add(const WarpCount& other) {
    fields += other.fields;
    dominated += other.dominated;
    dropped += other.dropped;
  }
};

class WarpField {
 public:
  // scene: with its parameters seeded. edges: its own, see BoundaryFunction. All must outlive this.
  // InputError for options that are no numbers of the kind that they should be.
  WarpField(const Scene& scene, const RayTracer& tracer, const EdgeSamplerInput& edges,
            const WarpOptions& options, bool unbiased);

  // How the unit direction w moves at a surface point. False where all that rays could meet is at
  // rest: no ray is traced. Thread-safe. Throws as RayTracer does.
  bool at(const SurfacePoint<Dual>& surface, const Vec3d& w, Rng rng, RayCount& rays,
          WarpCount& count, DirectionWarp& warp) const;

 private:
  struct Sphere {
    Vec3d center;
    double radius;
  };
  bool may_move(const SurfacePoint<Dual>& surface, const Vec3d& w) const;
  // Adds `count` rays, an even number.
  void trace(const SurfacePoint<Dual>& surface, const Vec3d& w, uint64_t count, Rng& rng,
             WarpSums& sums, RayCount& rays, WarpCount& dropped) const;
  AuxiliaryRay look(const SurfacePoint<Dual>& surface, const Vec3d& w) const;

  const Scene& scene_;
  const RayTracer& tracer_;
  BoundaryFunction boundary_;
  WarpOptions options_;
  bool unbiased_;
  std::vector<Sphere> moving_;  // around every shape that moves
};

// The field along one path, and what it costs.
class DirectionWarper {
 public:
  DirectionWarper(const WarpField& field, RayCount& rays) : field_(field), rays_(rays) {}

  // How the unit direction w moves; null where it is at rest. Holds until the next call.
  const DirectionMotion* motion(const SurfacePoint<Dual>& surface, const Vec3d& w, const Rng& rng) {
    motion_.warp = &warp_;
    return field_.at(surface, w, rng, rays_, count_, warp_) ? &motion_ : nullptr;
  }
  const WarpCount& count() const { return count_; }

 private:
  const WarpField& field_;
  RayCount& rays_;
  WarpCount count_;
  DirectionWarp warp_;
  DirectionMotion motion_;
};

}  // namespace limn
