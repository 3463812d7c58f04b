#pragma once
// Edges seen from the pinhole, and curves where the camera's clip planes cut faces, on the film.
#include <algorithm>
#include <span>
#include <vector>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/film/clip_curves.h"
#include "integrators/film/film_regions.h"
#include "integrators/paths/path.h"
#include "integrators/terms/film_lines.h"
#include "limn/core/discrete_distribution.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

struct FilmEdge : FilmLine {
  EdgeRef id;
  static constexpr uint32_t kNoClip = UINT32_MAX;
  uint32_t clip = kNoClip;  // the clip segment that it is, in the place of an edge
  double t0, t1;            // the part of the edge that may reach the film: its ends
  Lanes speed0, speed1;     // v_n there [pixels]; n points to the positive side of EdgeView::side
  std::optional<FaceRef> beside = {};  // FilmRegions::SeenPart; none: a ray tells
  bool in_line = false;                // film_lines.h
};

// A point of one of them.
struct FilmEdgePoint {
  const FilmEdge* edge;
  double s;        // position on the film: (1 - s) of its first end and s of the other
  double x, y;     // film position [pixels]
  double density;  // [1 / pixel of length]
};

// What moves where no motion is known: of these shapes every vertex by itself, and perhaps the
// camera.
struct FreeMotion {
  std::vector<bool> shapes;
  bool camera = false;

  bool moves(std::span<const FaceRef> faces) const {
    return camera || std::any_of(faces.begin(), faces.end(),
                                 [&](FaceRef face) { return shapes[face.shape.index()]; });
  }
};

class CameraEdges {
 public:
  // free: then all that may move is listed, with the speeds of unit translations in the first three
  // lanes (relative to the camera); null: what the scene's tangents move, with their speeds in
  // `lanes` lanes. visible: of the film, to list only what is seen of edges; null: hidden parts are
  // listed too, and found to be hidden by jump_at. Edges of faces seen edge-on, and edges
  // behind others in one line: see Viewpoint.
  CameraEdges(const PathContext& context, const EdgeSamplerInput& input, int lanes,
              const FreeMotion* free = nullptr, const FilmRegions* visible = nullptr);

  // Edges are drawn by how fast they move against positions on the film, which may move from now
  // on, and those at rest are listed, too; an empty function: positions are held.
  void move_film(const FilmMotionAt& motion);

  // Whether none moves.
  bool empty() const { return !(choice_.sum() > 0); }
  // Those that move while positions are held.
  size_t size() const { return moving_; }
  double list_seconds() const { return list_seconds_; }
  // Whose they are, of edges in one line that move past each other: EdgesInLine::parting.
  const std::optional<std::array<ShapeId, 2>>& parting() const { return parting_; }
  const ClipSegment& clip_of(const FilmEdge& edge) const { return clips_[edge.clip]; }

  // The point at u in [0, 1).
  FilmEdgePoint choose(double u) const;
  // Where it is on its edge, in space: (1 - t) of the edge's first end and t of the other.
  double t_of(const FilmEdgePoint& point) const;
  // dL there; false if it is hidden.
  bool jump_at(const FilmEdgePoint& point, const Rng& key, RayCount& rays, Rgb<double>& jump) const;

 private:
  static bool moves(const FilmEdge& edge) { return !is_zero(edge.speed0) || !is_zero(edge.speed1); }
  void list();
  void add_object(ShapeId object);
  void add_clip(uint32_t index);
  // faces: that the edge moves with.
  void add(const FilmEdge& edge, std::span<const FaceRef> faces) {
    if (lists_all_ || (free_ ? free_->moves(faces) : moves(edge))) {
      edges_.push_back(edge);
    } else {
      resting_.push_back(edge);
    }
  }
  bool is_hidden(const EdgeMesh& mesh, EdgeId edge) const;
  bool clip_and_project(EdgeRef id, FilmEdge& edge) const;
  bool clip_to_window(double x0, double x1, double y0, double y1, double& s0, double& s1) const;
  Vec3<Dual> moving(const Vec3d& x, const Vec3<Lanes>& velocity) const;
  bool place_on_film(const Vec3<Dual>& x0, const Vec3<Dual>& x1, const Vec3d& side,
                     FilmEdge& edge) const;
  void find_in_line();
  void keep_seen(const FilmRegions& visible);
  void weigh(const FilmMotionAt& motion);
  void add_pieces(uint32_t edge, const FilmMotionAt& motion);

  // A part of an edge that is drawn alike: [s0, s1] of it.
  struct Piece {
    uint32_t edge;
    double s0, s1;
    Lanes weight;
  };

  const PathContext& context_;
  const EdgeSamplerInput& input_;
  int lanes_;
  const FreeMotion* free_;
  const FilmRegions* visible_;
  const Viewpoint& viewpoint_;
  std::vector<ClipSegment> clips_;
  bool lists_all_ = false;
  std::vector<FilmEdge> edges_;  // that move, or all
  size_t moving_ = 0;
  std::vector<FilmLine> resting_;  // until what is in line with them is found
  std::optional<std::array<ShapeId, 2>> parting_;
  std::vector<Piece> pieces_;
  DiscreteDistribution choice_;  // of a piece
  double list_seconds_ = 0;
};

}  // namespace limn
