#pragma once
// Edges on the film that are listed once: seen from a pinhole, or along the direction of an
// orthographic camera, also by way of flat mirrors.
#include <array>

#include "integrators/terms/film_edges.h"
#include "limn/core/discrete_distribution.h"

namespace limn {

class CameraEdges final : public FilmEdges {
 public:
  // As FilmEdges, with the speeds of tangents in `lanes` lanes. Hidden parts are listed too, which
  // difference_at then finds.
  CameraEdges(const PathContext& context, const EdgeSamplerInput& input, int lanes,
              const FreeMotion* free = nullptr);

  void move_film(const FilmMotionAt& motion) override;
  bool empty() const override { return !(choice_.sum() > 0); }
  size_t size() const override { return moving_; }
  const Parting& parting() const override { return parting_; }
  std::optional<FilmEdgePoint> choose(double u, const LensPoint& lens) const override;

 private:
  // A part of an edge that is drawn alike: [s0, s1] of it.
  struct Piece {
    uint32_t edge;
    double s0, s1;
    Lanes weight;
  };

  static bool moves(const FilmEdge& edge) {
    return edge.refracted || !is_zero(edge.speed0) || !is_zero(edge.speed1);
  }
  void list();
  void add_object(ShapeId object, uint32_t view, const CameraView<Dual>& camera);
  void add_refracted(ShapeId object, uint32_t view);
  void add_clip(uint32_t index);
  // faces: that the edge moves with.
  void add(const FilmEdge& edge, std::span<const FaceRef> faces) {
    if (lists_all_ || (free_ ? may_move(views_[edge.view], faces) : moves(edge))) {
      edges_.push_back(edge);
    } else {
      resting_.push_back(edge);
    }
  }
  // Of the edges from the first on, of one view.
  void find_in_line(size_t first);
  // What a face around the edge emits, the brightest, as a mean of channels; 0: nothing.
  double emitted_at(const FilmEdge& edge) const;
  // What differs across an edge: what an emitter emits, what is seen of a surface and behind it, or
  // only how two faces that are both seen are turned.
  enum Kind { kEmitter, kOutline, kFold, kKinds };
  struct Contrast {
    Kind kind;
    double unit;  // to which the radiance difference is in proportion, as far as is known
  };
  Contrast contrast_of(const FilmEdge& edge) const;
  // The sine between normals of a fold; 1 where shading does not follow them.
  double fold_at(const EdgeMesh& mesh, EdgeId edge) const;
  // Looks at differences across some edges of each kind, if there are several.
  void find_contrasts();
  double root_mean_square(Kind kind) const;
  double expected_difference(const FilmEdge& edge) const;
  FilmEdgePoint point_on(const Piece& piece, double fraction) const;
  void weigh(const FilmMotionAt& motion);
  void add_pieces(uint32_t edge, const FilmMotionAt& motion);

  int lanes_;
  bool lists_all_ = false;
  std::vector<FilmEdge> edges_;  // that move, or all
  size_t moving_ = 0;
  // The radiance difference to expect across an edge of each kind, over its unit; all 0: alike.
  std::array<double, kKinds> differences_{};
  std::vector<FilmLine> resting_;  // until what is in line with them is found
  Parting parting_;
  std::vector<Piece> pieces_;
  DiscreteDistribution choice_;  // of a piece
};

}  // namespace limn
