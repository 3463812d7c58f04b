// The boundary term of the camera: edges that it sees, and curves where its clip planes cut faces,
// listed once, sampled on the film; with a lens, the mean of it over the lens.
//   dI_j/dtheta  +=  integral along the projected edges of h_j(s) dL v_n dl,
// with s the film position [pixels], dl its length element, v_n = ds/dtheta . n the normal speed of
// the projected edge, and dL the radiance behind the normal n minus that before it.

#include <fmt/format.h>

#include "integrators/terms/camera_edges.h"
#include "integrators/terms/lens_edges.h"
#include "integrators/terms/term_table.h"
#include "limn/core/duplicate_faces.h"

namespace limn {
namespace {

class CameraTerm final : public Term {
 public:
  explicit CameraTerm(TermInput& input)
      : input_(input.edges()), has_lens_(input.context.scene.camera.has_lens()) {
    const PathContext& context = input.context;
    if (has_lens_) {
      edges_ = std::make_unique<LensEdges>(context, input_, input.lanes, input.free);
    } else {
      edges_ = std::make_unique<CameraEdges>(context, input_, input.lanes, input.free);
    }
  }

  bool uses_film() const override { return !edges_->empty(); }
  void sample_film(double u, const Rng& key, FilmSink& sink) const override {
    const auto drawn = edges_->choose(u, has_lens_ ? sample_lens(key) : LensPoint{});
    if (!drawn || !sink.at(drawn->at)) return;
    const FilmEdgePoint& point = *drawn;
    RayCount rays;
    Rgb<double> difference;
    MirrorFaces by;
    const bool visible = edges_->difference_at(point, key, rays, difference, by);
    sink.cost().add(rays);
    if (!visible) return;
    const FilmEdge& edge = point.edge;
    const Lanes speed = edge.speed0 * (1 - point.s) + edge.speed1 * point.s;
    FilmLineSample line{edge.nx, edge.ny, speed, point.density};
    line.t = edges_->t_of(point);
    line.by = by;
    line.g = point.refracted.g;
    if (edge.clip == FilmEdge::kNoClip) {
      line.mesh = &input_.object(edge.id.object);
      line.edge = edge.id;
    } else {
      line.clip = &edges_->clip_of(edge);
    }
    sink.add_line(line, difference);
  }
  void move_film(const FilmMotionAt& motion) override { edges_->move_film(motion); }
  void warn_of_kinks(const Scene& scene, std::vector<std::string>& warnings) const override {
    if (!edges_->parting()) return;
    const auto [first, second] = *edges_->parting();
    const std::string whose = first == second
                                  ? fmt::format("edges of {}", quoted_name(scene, first))
                                  : fmt::format("edges of {} and {}", quoted_name(scene, first),
                                                quoted_name(scene, second));
    warnings.push_back(fmt::format(
        "the camera sees {} in one line, one behind the other, and they move past each other: "
        "where both are seen the image is not differentiable; its derivative is that of a camera a "
        "little aside; "
        "differences take the mean of both sides",
        whose));
  }
  void describe(GradientStats& stats) const override {
    stats.setup.emplace_back("edges on the film", edges_->list_seconds());
    stats.edges.emplace_back("moving on the film", edges_->size());
  }

 private:
  const EdgeSamplerInput& input_;
  bool has_lens_;
  std::unique_ptr<FilmEdges> edges_;
};

}  // namespace

std::unique_ptr<Term> make_camera_term(TermInput& input) {
  return std::make_unique<CameraTerm>(input);
}

}  // namespace limn
