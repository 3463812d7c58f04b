#pragma once
// Thin penumbras. In the shadow of an edge before a small emitter, or close behind an edge, the
// place where the edge cuts into the emitter is small, and what the edge adds there is as large:
// samples of pixels and of directions meet it ever more rarely. So what `direct` holds is found
// from both ends: `direct` itself lists edges at the vertices that paths come to; `penumbra` draws
// lines from an emitter through a point of an edge to a vertex, and finds who sees that
// (penumbra_boundary.cpp). Close to a second vertex the first is found from there, too: a share of
// the samples of the film scatter a line on to what the camera sees. Each contribution is shared
// between these ways by how densely they are expected to meet it (the power heuristic; any shares
// that add up to one are right). Rays leave surfaces with interpolated normals above their faces
// (surface_point.h), where lines do not end: `direct` has all of theirs.
#include <vector>

#include "integrators/paths/path.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

class LightRegions;

// The edges that lines from regions of light may pass, with how likely each is drawn.
class EmitterEdges {
 public:
  // All must outlive it. lanes: in use.
  EmitterEdges(const Scene& scene, const EdgeSamplerInput& edges, const LightRegions& regions,
               int lanes);

  size_t size() const { return listed_.size(); }
  struct Drawn {
    EdgeRef edge;
    uint32_t region;
    double probability;
  };
  // u in [0, 1); there must be edges.
  Drawn draw(double u) const;
  // Of this edge before region k; 0 if lines from there never pass it: an emitter's own edges, and
  // edges whose two faces all of the region sees from the same side.
  double probability(size_t k, EdgeRef edge) const;

 private:
  // What is seen of a region from around the scene.
  struct Sight {
    bool infinite = false;
    Vec3d v;            // center, or the direction towards it
    double radius = 0;  // around the center; at infinity the sine of the angle
    double light = 0;   // luminance times area; at infinity times solid angle
    bool listed = false;
    size_t first_block = 0;  // of its edges, if they are listed
  };
  struct Weight {
    double length = 0;  // times light
    Lanes speed;        // of its shadow, per length
  };
  // 64 edges of one object before one region: which of them are listed, and how many come before.
  struct Block {
    uint64_t listed = 0;
    uint32_t before = 0;
  };
  void list(const LightRegions& regions);
  void list_object(size_t k, ShapeId object, std::vector<Weight>& weights);
  Sight sight_of(const LightRegions& regions, size_t k) const;
  std::optional<Weight> weigh(size_t k, EdgeRef edge) const;
  double share_of(const Weight& weight) const;

  const EdgeSamplerInput& edges_;
  int lanes_;
  double reach_ = 0;  // the scene's diagonal
  std::vector<Sight> sights_;
  std::vector<ShapeId> emitters_;  // of the regions; none of patches
  // In the order of regions, objects and edges, so that a few bits per edge find them again: to
  // weigh an edge anew would fetch ten lines of the mesh.
  std::vector<Drawn> listed_;
  std::vector<Block> blocks_;
  std::vector<size_t> first_block_;  // of each object, behind its region's first
  std::vector<double> cumulative_;
  std::vector<uint32_t> guide_;  // where draws of u in [i, i + 1) / size() start to look
  double length_ = 0;            // of all weights
  Lanes swept_;
};

// A line from region k through the point e of an edge that meets a surface of unit normal n at p.
struct EmitterLine {
  size_t region;
  EdgeRef edge;
  Vec3d e, p, n;
};

// What both ways to points on the edges before emitters are drawn from.
struct EmitterWays {
  const Scene& scene;
  const EdgeSamplerInput& edges;
  const LightRegions& regions;
  const EmitterEdges& emitter_edges;
  double scattered = 0;  // the share of the samples of the film whose lines are scattered once
};
EmitterWays emitter_ways(const PathContext& context, const EdgeSamplerInput& edges,
                         const LightRegions& regions, const EmitterEdges& emitter_edges);

struct PenumbraShare {
  double density = 0;    // of p as seen from the vertex before [1/sr], if lines through e are drawn
  double share = 0;      // of lines that this vertex, or the camera, sees
  double scattered = 0;  // of lines that are scattered from p; `direct` has the rest
};
// step: how a path came to p, after how many bounces: by the density of directions, or of positions
// in a pixel if it comes from the camera.
PenumbraShare penumbra_share(const EmitterWays& ways, const EmitterLine& line, const PathStep& step,
                             int bounces);
// The density on the film [1 / pixel^2] of the vertex before, of lines that are scattered from p
// alike in all directions; 0 where they do not end.
double scattered_density(const Scene& scene, const EmitterLine& line, const PathStep& step);
// The share of `direct` in what a point of an edge before region k adds at a vertex.
double direct_share(const EmitterWays& ways, const EdgeSample& sample, size_t k,
                    const SurfacePoint<double>& at, const PathStep& step, int bounces);

}  // namespace limn
