#pragma once
// Where the edges of hard shadows lie in space, and which point of them a vertex draws. A plane
// through a delta light and an edge meets every flat face in a straight segment: the shadow of the
// edge is a chain of pieces, each on one face. They are candidate edges from everywhere, so a
// forest of them draws a piece, and a point on it, by lobe, distance and motion.
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "integrators/paths/path_context.h"
#include "integrators/terms/lifted_faces.h"
#include "limn/core/face_tree.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

struct ShadowEdge;

// The light that passes through an edge: half a plane, or a sector of one, with coordinates (t, k)
// in which straight lines are straight. t: where it passes the edge, 0 to 1. k: at a light, 1 at
// the edge, and 1 / k times as far from the light; at infinity, 0 at the edge and -k behind it, in
// units of the light's direction.
class LightSheet {
 public:
  LightSheet(const LightOrigin& origin, const Vec3d& y0, const Vec3d& y1);

  // All faces that it may cut are among those that meet this set.
  std::span<const HalfSpace> bounds() const { return bounds_; }
  // Its segment on a triangle, if it has any width.
  std::optional<Stretch> cut(const std::array<Vec3d, 3>& corners, uint32_t label) const;
  Vec3d point(double t, double k) const;
  bool infinite() const { return infinite_; }

 private:
  // In the sheet, but not yet divided: linear in space.
  struct OnSheet {
    double a, b, k;  // t = b / (a + b)
  };
  OnSheet on_sheet(const Vec3d& x) const;

  bool infinite_;
  Vec3d y0_, along_, w0_, w1_;
  Vec3d normal_, to_a_, to_b_, to_k_;
  std::array<HalfSpace, 4> bounds_;
};

// A piece of the shadow of an edge.
struct ShadowPiece {
  uint32_t edge;  // among those that part light from shadow
  double t0, t1;  // of the edge
  double k0, k1;  // of the sheet, at t0 and t1
  FaceRef face;   // on which it lies
  EdgeRef place;  // in the forest
  bool infinite;

  // Where the shadow of t lies between the piece's ends, 0 to 1, and its slope.
  double from_edge(double t, double& slope) const;
  // The same, inverted.
  double to_edge(double fraction) const;
};

// A point that was drawn, on an edge that parts light from shadow.
struct ShadowDraw {
  uint32_t edge;
  double t;
  double density;  // of edge and t
};

class ShadowPieces {
 public:
  // input: edges of the scene; it and the scene must outlive this object. free: any velocities may
  // come, not only those in the tangents. The result does not depend on `threads`.
  ShadowPieces(const PathContext& context, const EdgeSamplerInput& input,
               std::span<const ShadowEdge> edges, bool free, int threads);

  bool empty() const { return pieces_.empty(); }
  std::span<const ShadowPiece> pieces() const { return pieces_; }
  const EdgeSampler& sampler() const { return *forest_; }

  // Replaces `draws` by one for each stream, see EdgeSampler::sample_several.
  void draw(const EdgeQuery& query, std::span<Rng> rngs,
            std::vector<std::optional<ShadowDraw>>& draws) const;
  // The density with which a draw takes a point: zero where no piece is known.
  double density(const EdgeQuery& query, uint32_t edge, double t) const;

 private:
  void list(std::span<const ShadowEdge> edges, int threads);
  void place(std::span<const ShadowEdge> edges, bool free);
  Vec3<Lanes> velocity(const ShadowEdge& edge, FaceRef face, double t) const;

  const PathContext& context_;
  const EdgeSamplerInput& input_;
  std::vector<ShadowPiece> pieces_;  // by edges, then by t
  std::vector<uint32_t> first_;      // of each edge, and their number
  // As the objects of input_: pieces with the shape that casts them.
  EdgeSamplerInput placed_;
  std::vector<std::vector<uint32_t>> numbers_;  // of the pieces, by object and edge there
  std::unique_ptr<EdgeSampler> forest_;
};

}  // namespace limn
