// Each visible face of a pixel on the tape: what it shows of itself hangs on the lines that bound
// it, the light at its centroid on where that lies and on all that the light depends on.
#include "integrators/backward/faces_gradient.h"

#include "integrators/backward/film_adjoint.h"
#include "integrators/backward/reverse_estimator.h"
#include "integrators/estimates/contributions.h"
#include "integrators/methods/faces_estimator.h"
#include "integrators/methods/term_job.h"
#include "integrators/paths/path_follow.h"
#include "limn/core/exposure.h"

namespace limn {

FacesGradient::FacesGradient(const Scene& scene, const Image& adjoint,
                             const BackwardOptions& options, int threads)
    : adjoint_((check_still(scene, kRegionsUser, reverse_parameters(scene, options)),
                PixelRegions::check(scene), adjoint_pixels(scene, adjoint))),
      parameters_(scene, reverse_parameters(scene, options)),
      faces_(std::make_shared<CoincidentFaces>(parameters_.scene(), threads)),
      pixels_(parameters_.scene(), *faces_, threads),
      traced_(parameters_.scene(), threads, {.closed = true, .faces = faces_}) {
  selected_terms({kFacesTerm}, options.terms, scene.file);
}

void FacesGradient::describe(BackwardResult& result) const {
  result.terms.push_back({kFacesTerm, true, false, 1, {}, {}});
}

const char* FacesGradient::slot_name(size_t) const { return kFacesTerm; }

void FacesGradient::end_tile(std::vector<Contribution>& contributions) const {
  join_slots(contributions);
}

void FacesGradient::add_wanted(size_t tile, const PixelRegions::Wanted& wanted,
                               GradientTile& to) const {
  Tape tape(&parameters_.slots());
  const TapeScope scope(tape);
  PixelParts parts(scene(), pixels_);
  pixels_.for_each_pixel(
      tile, nullptr, [&](int x, int y) { return wanted(x, y) && !is_black(adjoint_at(x, y)); },
      [&](int x, int y, const VisibleRegions& regions) {
        parts.find(x, y, regions, true);
        to.costs[0].samples += parts.size();
        const size_t before = to.contributions.size();
        for (size_t i = 0; i < parts.size(); ++i) {
          tape.clear();
          if (trace(parts, i, adjoint_at(x, y), tape) &&
              add_tape(tape, {x, y, 0, ""}, parameters_, to.costs[0], to)) {
            continue;
          }
          // Nothing of the pixel, as in forward mode.
          to.contributions.resize(before);
          return to.non_finite.add({x, y, 0, kFacesTerm});
        }
      });
}

void FacesGradient::add_tile(const Batch&, size_t tile, GradientTile& to) const {
  add_wanted(
      tile, [](int, int) { return true; }, to);
}

void FacesGradient::add_sample(const Batch&, const PixelSample& at, GradientTile& to) const {
  add_wanted(
      pixels_.tile_of(at.x, at.y), [&](int x, int y) { return x == at.x && y == at.y; }, to);
}

bool FacesGradient::trace(const PixelParts& parts, size_t i, const Rgb<double>& adjoint,
                          Tape& tape) const {
  const CameraView<Var> view = camera_leaves(scene().camera);
  const FacePart<Var> part = parts.part(i, scene(), view);
  const CameraRay<Var> ray = view.ray(part.x, part.y);
  RayCount rays;
  PathTracer<Var, NoVisitor> tracer(traced_.context(), rays);
  Walk<Var, NoVisitor> walk(Rng(0, 0, 0), 0, nullptr);
  if (part.face.shape.valid()) {
    const auto surface = surface_on_ray<Var>(scene(), part.face, ray.origin, ray.direction);
    tracer.place(walk, surface, -ray.direction);
    tracer.follow_one(walk);
  } else {
    walk.sums.radiance = tracer.escaped(ray.direction, 0);
  }
  const Rgb<Var> sum = walk.sums.radiance * part.area;
  if (walk.failed || !is_finite(value(sum))) return false;
  tape.start();
  for (int c = 0; c < 3; ++c) tape.adjoint(sum[c].node) += adjoint[c];
  tape.sweep();
  return true;
}

}  // namespace limn
