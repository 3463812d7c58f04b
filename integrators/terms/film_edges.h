#pragma once
// What moves on the film: edges as the camera sees them, and curves where its clip planes cut
// faces. Two kinds list them: CameraEdges once, for all that is seen from one point or along one
// direction; LensEdges for every point of a lens.
#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/film/clip_curves.h"
#include "integrators/paths/camera_path.h"
#include "integrators/paths/path.h"
#include "integrators/terms/film_lines.h"
#include "integrators/terms/film_views.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

struct FilmEdge : FilmLine {
  EdgeRef id;
  static constexpr uint32_t kNoClip = UINT32_MAX;
  uint32_t clip = kNoClip;  // the clip segment that it is, in the place of an edge
  uint32_t view = 0;        // by which flat mirrors it is seen, of views_; 0: by none
  bool refracted = false;   // a curve: its ends are not on the film
  double t0, t1;            // the part of the edge that may reach the film: its ends
  Lanes speed0, speed1;     // v_n there [pixels]; n points to the positive side of EdgeView::side
  bool in_line = false;     // film_lines.h
};

// A point of one of them.
struct FilmEdgePoint {
  FilmEdge edge;
  double s;        // position on the film: (1 - s) of its first end and s of the other
  FilmPlace at;    // on the film, and of the lens
  double density;  // [1 / pixel of length]
  RefractedPoint refracted = {};  // where panes refract it
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

// Whose they are, of two edges in one line that move past each other (EdgesInLine::parting).
using Parting = std::optional<std::array<ShapeId, 2>>;

class FilmEdges {
 public:
  // free: all that may move is listed, with the speeds of unit translations in the first three
  // lanes (relative to the camera); null: what the scene's tangents move, with their speeds. Edges
  // of faces seen edge-on, and edges behind others in one line: see Viewpoint.
  FilmEdges(const PathContext& context, const EdgeSamplerInput& input, const FreeMotion* free)
      : context_(context),
        input_(input),
        free_(free),
        clips_(find_clip_segments(context.scene)),
        views_(list_film_views(context, free != nullptr)) {}
  virtual ~FilmEdges() = default;

  // Edges are drawn by how fast they move against positions on the film, which may move from now
  // on, and those at rest are listed, too; an empty function: positions are held.
  virtual void move_film(const FilmMotionAt& /*motion*/) {}
  // Whether none moves.
  virtual bool empty() const = 0;
  // Those that move while positions are held.
  virtual size_t size() const = 0;
  virtual const Parting& parting() const = 0;
  // The point at u in [0, 1), as a camera with a lens sees it through this point; none if it does
  // not.
  virtual std::optional<FilmEdgePoint> choose(double u, const LensPoint& lens) const = 0;

  double list_seconds() const { return list_seconds_; }
  const ClipSegment& clip_of(const FilmEdge& edge) const { return clips_[edge.clip]; }
  // Where the point is on its edge, in space: (1 - t) of the edge's first end and t of the other.
  double t_of(const FilmEdgePoint& point) const;
  // dL there, and on which mirrors it is seen; false if it is hidden.
  bool difference_at(const FilmEdgePoint& point, const Rng& key, RayCount& rays,
                     Rgb<double>& difference, MirrorFaces& by) const;

 protected:
  const Scene& scene() const { return context_.scene; }
  // Whether all faces around the edge are emitters that the camera does not see.
  bool is_hidden(const EdgeMesh& mesh, EdgeId edge) const;
  // Finds where an edge, or a clip segment, lies on the film of a view: what of it may be seen
  // there, if nothing hides it. False if none of it is.
  // image: of the camera, if it is not that itself.
  bool place(EdgeRef id, const CameraView<Dual>& view, FilmEdge& edge,
             const FilmView* image = nullptr) const;
  bool place(uint32_t clip, const CameraView<Dual>& view, FilmEdge& edge) const;
  // The same through panes, but for where on the film.
  bool place_refracted(EdgeRef id, uint32_t view, FilmEdge& edge) const;
  // Adds how fast it moves there, times its length: by its motion at some places, as it may move at
  // others alone.
  void add_speed(FilmEdge& edge, const LensPoint& lens, int lanes) const;
  // Puts a point onto the curve that is seen of its edge, through a point of the lens.
  bool bend(FilmEdgePoint& point, const LensPoint& lens) const;
  // Where no motion is known: whether an edge that moves with these faces may move as it is seen.
  bool may_move(const FilmView& view, std::span<const FaceRef> faces) const;
  // The faces whose vertices an edge hangs on: of its own mesh, or, where two faces cross, both.
  static FaceList faces_that_move(const EdgeMesh& mesh, EdgeId edge) {
    const FaceList faces = mesh.faces_around(edge);
    return mesh.shape.valid() ? FaceList(faces[0]) : faces;
  }
  // The fraction of a segment in space that is seen at the fraction s of its projection.
  double fraction_in_space(double s, double depth0, double depth1) const {
    if (scene().camera.is_orthographic()) return s;
    return s * depth0 / ((1 - s) * depth1 + s * depth0);
  }

  const PathContext& context_;
  const EdgeSamplerInput& input_;
  const FreeMotion* free_;
  std::vector<ClipSegment> clips_;
  std::vector<FilmView> views_;  // the camera first
  double list_seconds_ = 0;

 private:
  Vec3<Dual> moving(const Vec3d& x, const Vec3<Lanes>& velocity) const;
  bool place_ends(const Vec3<Dual>& x0, const Vec3<Dual>& x1, const Vec3d& side,
                  const CameraView<Dual>& view, FilmEdge& edge) const;
  bool difference_beyond(const FilmEdgePoint& point, const Rng& key, RayCount& rays,
                         Rgb<double>& difference, MirrorFaces& by) const;
  // The point that sees y, a point of the edge; that of the camera's image, by way of mirrors.
  Vec3d viewer_of(const FilmEdgePoint& point, const FacesAround& around, const Vec3d& y) const;
};

}  // namespace limn
