#pragma once
// Lines from regions of light through points of edges, for the term `penumbra`.
#include <optional>

#include "integrators/paths/path.h"
#include "integrators/terms/penumbra.h"
#include "integrators/terms/vertex_edges.h"

namespace limn {

struct DrawnLine {
  EdgeSample edge;  // probability: of the edge, times the line's density once that is complete
  FaceRef face;     // that the line meets
  LampLine line;
};

// The same, complete, and as a vertex of a path sees where it ends.
struct SeenLine {
  DrawnLine drawn;
  Vec3d omega;    // unit, from the vertex
  Rgb<double> f;  // of the vertex's scattering
};

class PenumbraLines {
 public:
  // All must outlive it.
  PenumbraLines(const PathContext& context, const EdgeSamplerInput& edges,
                const LightRegions& regions, const LampEdges& lamp_edges)
      : context_(context), edges_(edges), regions_(regions), lamp_edges_(lamp_edges) {}

  // u: in [0, 1), chooses the edge and its region. None if the line meets nothing.
  std::optional<DrawnLine> draw(double u, Rng& rng, RayCount& rays) const;
  // Completes the density of a drawn line for who sees where it ends (penumbra_share()). False
  // where the line belongs to `direct`; where nearly all does, mostly.
  bool complete(DrawnLine& drawn, const PathStep& step, int bounces, Rng& rng) const;

  // One drawn for a vertex (PathVertex, or that of reverse mode); books what becomes of it. None if
  // it adds nothing there.
  template <class Vertex>
  std::optional<SeenLine> seen_from(const Vertex& vertex, const Rng& key, TermCost& cost) const {
    ++cost.samples;
    RayCount rays;
    // Not the numbers of the term `shadow` there.
    Rng rng = key.at(Purpose::kShadow, vertex.bounces).at(Purpose::kDirect, 0);
    const double u = rng.uniform();
    auto drawn = draw(u, rng, rays);
    cost.add(rays);
    if (!drawn) {
      ++cost.no_edge;
      return {};
    }
    const Vec3d q = value(vertex.surface.p);
    const Vec3d to = drawn->line.p - q;
    const double distance = length(to);
    const bool apart = distance > 0 && drawn->face != vertex.surface.face;
    const Vec3d omega = apart ? to / distance : Vec3d{};
    double pdf = apart ? vertex.scattering.pdf_solid_angle(omega) : 0;
    if (const MirroredLight* mirrored = context_.mirrored; mirrored && pdf > 0) {
      pdf = MirroredLight::pdf(mirrored->mixture(vertex.surface, vertex.scattering), omega, pdf);
    }
    const Rgb<double> f = pdf > 0 ? vertex.scattering.eval_value(omega) : Rgb<double>{};
    if (is_black(f) || !complete(*drawn, {q, pdf}, vertex.bounces + 1, rng)) {
      ++cost.zero_weight;
      return {};
    }
    if (is_hidden_from(context_, vertex, drawn->face, omega, distance, cost)) {
      ++cost.occluded;
      return {};
    }
    return SeenLine{*drawn, omega, f};
  }

 private:
  const PathContext& context_;
  const EdgeSamplerInput& edges_;
  const LightRegions& regions_;
  const LampEdges& lamp_edges_;
};

}  // namespace limn
