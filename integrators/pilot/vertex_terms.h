#pragma once
// Visitors of a TermEstimator's paths: what the terms add at vertices, and how vertices move.
// Included by term_estimator.cpp alone.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "integrators/paths/path_log.h"
#include "integrators/pilot/term_estimator.h"
#include "integrators/terms/direct_edges.h"
#include "integrators/terms/vertex_edges.h"

namespace limn {

// The value of a sample that needs a ray which cannot be traced.
inline const double kNan = std::numeric_limits<double>::quiet_NaN();
inline const Lanes kNotFinite{kNan, kNan, kNan, kNan};

// How the vertices of a path move; the visitor of a path.
class TermEstimator::VertexMotions {
 public:
  void operator()(const SurfacePoint<Dual>& surface, const Scattering<Dual>&, const Rgb<Dual>&,
                  const DirectionMotion*, const PathStep&, int, const Rng&) {
    velocities_.push_back({surface.p.x.d, surface.p.y.d, surface.p.z.d});
  }
  const Vec3<Lanes>& velocity(int bounces) const { return velocities_.at(bounces); }

 private:
  std::vector<Vec3<Lanes>> velocities_;
};

// The terms at vertices, as the visitor of a path.
class TermEstimator::VertexTerms {
 public:
  // held: how the vertices of the path move while its directions are held, if what turns change is
  // needed; else null.
  // traced: added to, unless it is null.
  VertexTerms(const TermEstimator& estimator, const PixelCounts& counts, const VertexMotions* held,
              TracedDraws* traced, SampleSink& sink)
      : estimator_(estimator),
        counts_(counts),
        held_(held),
        setting_{estimator.scene_, estimator.warp_field_.get(), estimator.lanes(), traced,
                 sink.log()},
        sink_(sink),
        sums_(),
        turned_() {}

  void operator()(const SurfacePoint<Dual>& surface, const Scattering<Dual>& scattering,
                  const Rgb<Dual>& throughput, const DirectionMotion* motion, const PathStep& step,
                  int bounces, const Rng& key) {
    const Rgb<double> weight = value(throughput);
    if (sink_.log()) log_vertex(*sink_.log(), surface, scattering, weight, bounces);
    const Bsdf::Lobes& lobes = scattering.bsdf().lobes();
    const Arrival arrival{weight, motion, step, bounces, key};
    if (lobes.above) add_side(surface, scattering, arrival, false);
    if (!lobes.below) return;
    const auto other = beyond(estimator_.scene_, surface, scattering.wi());
    add_side(other, scattering, arrival, true);
  }

  const PixelCounts& counts() const { return counts_; }
  const Rgb<Lanes>& sum(size_t slot) const { return sums_[slot]; }
  const Rgb<Lanes>& turned(size_t slot) const { return turned_[slot]; }
  void scale(double by) {
    for (size_t slot = 0; slot < estimator_.slots(); ++slot) {
      for (auto* sums : {&sums_, &turned_, &again_}) (*sums)[slot] = (*sums)[slot] * by;
    }
  }
  // Has two other samples at the same vertices, see PairSums. They are not booked.
  void draw_twice() { twice_ = true; }
  const Rgb<Lanes>& again(size_t slot) const { return again_[slot]; }
  // What lists of silhouettes took, in the unit of Term::work.
  double listing(size_t slot) const { return listing_[slot]; }

 private:
  // How the path came to a vertex.
  struct Arrival {
    const Rgb<double>& weight;
    const DirectionMotion* motion;
    const PathStep& step;
    int bounces;
    const Rng& key;
  };
  // below: what passes the surface, from beyond() it.
  void add_side(const SurfacePoint<Dual>& surface, const Scattering<Dual>& scattering,
                const Arrival& arrival, bool below) {
    const auto& [weight, motion, step, bounces, key] = arrival;
    PathVertex vertex =
        plain_vertex(surface, scattering, estimator_.scene_.shading, bounces, step, key, below);
    vertex.throughput = weight;
    if (is_unseen(vertex)) return;
    if (motion) vertex.turn = motion->turn;
    TurnedVertex turned;
    if (held_) turned = turned_at(surface, motion, bounces);
    VertexLanes lanes(setting_, vertex, surface, held_ ? &turned : nullptr);
    const double factor = factor_at(surface, weight, bounces);
    for (size_t slot = 0; slot < estimator_.slots(); ++slot) {
      const Term* term = estimator_.terms_[slot].get();
      if (!term || !term->uses_vertices()) continue;
      if (skipped(slot, key)) continue;
      const int planned = std::max(1, static_cast<int>(counts_[slot]));
      const int samples = rounded(planned * factor, key.at(Purpose::kVertexSplit, bounces), slot);
      if (samples == 0) continue;
      const Stopwatch watch;
      TermCost& cost = sink_.cost(slot);
      lanes.start(cost, estimator_.plan_.survival * (1 / (factor * counts_[slot])));
      const double listed = list_work(listed_by_thread());
      const Rgb<Lanes> sum = drawn(*term, vertex, samples, lanes);
      listing_[slot] += list_work(listed_by_thread()) - listed;
      const double share = 1 / factor;
      for (int c = 0; c < 3; ++c) {
        sums_[slot][c] += sum[c] * share;
        turned_[slot][c] += turned.sum[c] * share;
      }
      if (twice_) draw_again(slot, vertex, surface, samples, share / 2);
      cost.seconds += watch.seconds();
    }
  }
  static Rgb<Lanes> drawn(const Term& term, const PathVertex& vertex, int samples,
                          VertexLanes& lanes) {
    try {
      term.add_at_vertex(vertex, samples, lanes);
    } catch (const UntraceableRay&) {
      return grey(kNotFinite);
    }
    return lanes.sum();
  }
  void draw_again(size_t slot, const PathVertex& at, const SurfacePoint<Dual>& surface, int samples,
                  double share) {
    constexpr uint64_t kAgain = 0x20000;  // no depth of a path
    const Rng key = at.key.at(Purpose::kVertexSplit, kAgain);
    PathVertex vertex{at.surface, at.scattering, at.throughput, at.velocity,
                      at.turn,    at.bounces,    at.step,       key};
    vertex.below = at.below;
    VertexLanes::Setting setting = setting_;
    setting.traced = nullptr;
    VertexLanes lanes(setting, vertex, surface, nullptr);
    TermCost cost;
    lanes.start(cost, {});
    const Rgb<Lanes> sum = drawn(*estimator_.terms_[slot], vertex, 2 * samples, lanes);
    for (int c = 0; c < 3; ++c) again_[slot][c] += sum[c] * share;
  }
  TurnedVertex turned_at(const SurfacePoint<Dual>& surface, const DirectionMotion* motion,
                         int bounces) const {
    TurnedVertex turned;
    if (motion) turned.turn.axis = motion->turn.axis;
    for (int k = 0; k < 3; ++k) {
      if (motion) turned.turn.rate[k][k] = motion->unit;
      turned.velocity[k] = estimator_.turned(surface.p[k].d, held_->velocity(bounces)[k]);
    }
    return turned;
  }
  // How many samples the vertex takes in place of one, on average: as large as what they may add.
  double factor_at(const SurfacePoint<Dual>& surface, const Rgb<double>& throughput, int bounces) {
    constexpr double kLeast = 0.125, kMost = 32;  // not tuned
    if (!estimator_.splits_now(held_ != nullptr)) return 1;
    const Vec3d p = value(surface.p);
    if (bounces == 0) first_ = p;
    const Vec3<Lanes> velocity{surface.p.x.d, surface.p.y.d, surface.p.z.d};
    const double factor = luminance(throughput) * estimator_.rates_.splitting(p, velocity, first_);
    return factor < kMost ? std::max(factor, kLeast) : kMost;  // also of what is not a number
  }
  // A whole number with this mean.
  static int rounded(double mean, Rng rng, size_t slot) {
    const double whole = std::floor(mean);
    if (whole == mean) return static_cast<int>(mean);
    rng = rng.at(Purpose::kVertexSplit, slot);
    return static_cast<int>(whole) + (rng.uniform() < mean - whole ? 1 : 0);
  }
  // One decision for all vertices of a path; copies behind a vertex that slides fast make their
  // own.
  bool skipped(size_t slot, const Rng& key) const {
    return counts_[slot] < 1 && key.at(Purpose::kTermRoulette, slot).uniform() >= counts_[slot];
  }

  const TermEstimator& estimator_;
  PixelCounts counts_;
  const VertexMotions* held_;
  VertexLanes::Setting setting_;
  SampleSink& sink_;
  std::array<Rgb<Lanes>, kMostTerms> sums_;
  std::array<Rgb<Lanes>, kMostTerms> turned_;
  std::array<Rgb<Lanes>, kMostTerms> again_{};
  std::array<double, kMostTerms> listing_{};
  bool twice_ = false;
  Vec3d first_;  // vertex of the path
};

}  // namespace limn
