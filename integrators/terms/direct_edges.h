#pragma once
// The silhouettes before regions of light, as one point sees them, and points drawn on these by
// what each would add. See direct_boundary.cpp for the estimator.
#include <cstdint>
#include <span>
#include <vector>

#include "integrators/lights/light_regions.h"
#include "limn/core/rng.h"
#include "limn/edgetree/edge_pieces.h"
#include "limn/integrators/run.h"

namespace limn {

// Pieces of silhouettes before regions, in the order of regions.
struct DirectPieces {
  struct Piece {
    uint32_t region;
    EdgePiece piece;
    double sum;          // of the weights up to here; of outlines, of one emitter's
    double density = 1;  // how often it is listed on average, over how often it was
  };
  std::vector<Piece> others;
  std::vector<Piece> outlines;  // sides of small or simple emitters, one after the other
  void clear() { others.clear(), outlines.clear(); }
};

// A point on an edge. The product of its two densities is how many points lie there for one sample,
// on average, per unit t.
struct DirectPoint {
  uint32_t region;
  EdgeSample sample;
};

// Appends to `drawn` as many points, stratified over the weights; `points` for each of `samples`.
// Books them.
void draw_pieces(const EdgeSamplerInput& edges, std::span<const DirectPieces::Piece> pieces,
                 Rng rng, int points, int samples, TermCost& cost, std::vector<DirectPoint>& drawn);

// What the calling thread has listed so far. Lists take time that samples and rays do not tell: a
// pilot charges it by the difference.
struct ListCount {
  uint64_t lists = 0, cones = 0, pieces = 0;  // cones: of regions, over all lists
};
ListCount listed_by_thread();
// In the unit of Term::work: by a fit of times in three scenes of 1 to 6 lamps, against what paths
// and drawn edges take.
double list_work(const ListCount& count);

class DirectEdges {
 public:
  // All must outlive it.
  DirectEdges(const EdgeSamplerInput& edges, const EdgeSampler& sampler,
              const LightRegions& regions)
      : edges_(edges), sampler_(sampler), regions_(regions) {}

  // Replaces what is in `pieces`. Both queries are of the same point: directions towards emitters
  // are held, those towards patches may turn. u: in [0, 1), chooses among many emitters.
  void list(const EdgeQuery& emitters, const EdgeQuery& patches, double u,
            DirectPieces& pieces) const;
  // Replaces what is in `points`. key: of the path; books samples on `cost`.
  void draw(const DirectPieces& pieces, const Rng& key, int bounces, int samples, TermCost& cost,
            std::vector<DirectPoint>& points) const;

 private:
  const EdgeSamplerInput& edges_;
  const EdgeSampler& sampler_;
  const LightRegions& regions_;
};

}  // namespace limn
