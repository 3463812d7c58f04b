// Each visible face of a pixel on the tape: what it shows of itself hangs on the lines that bound
// it, the light at its centroid on where that lies and on all that the light depends on.
#include "integrators/backward/faces_pass.h"

#include "integrators/backward/contributions.h"
#include "integrators/backward/film_adjoint.h"
#include "integrators/backward/parameter_slots.h"
#include "integrators/backward/path_adjoint.h"
#include "integrators/film/pixel_parts.h"
#include "integrators/methods/faces_estimator.h"
#include "integrators/methods/selection.h"
#include "integrators/paths/path_follow.h"
#include "integrators/paths/traced_scene.h"
#include "limn/core/error.h"

namespace limn {
namespace {

class FacesPass {
 public:
  FacesPass(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
            const RunSettings& settings)
      : options_(options),
        settings_(settings),
        film_((check_faces_film(scene.film), scene.film)),
        adjoint_(adjoint_pixels(scene, adjoint)),
        parameters_(scene, reverse_parameters(scene, options)),
        faces_(std::make_shared<CoincidentFaces>(parameters_.scene(), settings.threads)),
        pixels_(parameters_.scene(), *faces_, settings.threads, kFacesUser),
        traced_(parameters_.scene(), settings.threads, {.closed = true, .faces = faces_}) {
    selected_terms({kFacesTerm}, options.terms, scene.file);
  }

  BackwardResult run() {
    BackwardResult result;
    result.setup_seconds = watch_.seconds();
    result.terms.push_back({kFacesTerm, true, false, 1, {}, {}});
    for (const Parameter& p : parameters_.parameters()) {
      result.parameters.push_back({p.name, p.unit, p.shape(), Moments(p.numbers())});
    }
    const size_t tiles = pixels_.tiles().size();
    ProgressCounter progress(settings_, watch_, tiles + 1);
    ContributionSum sum(parameters_.slots().count);
    for (size_t first = 0; first < tiles && !progress.stopped(); first += ContributionSum::kWave) {
      const size_t last = std::min(tiles, first + ContributionSum::kWave);
      std::vector<TileFigures> figures(last - first);
      sum.add_wave(first, last, settings_.threads, [&](size_t t, std::vector<Contribution>& list) {
        add_tile(t, figures[t - first], list);
        progress.step();
      });
      for (const TileFigures& own : figures) {
        result.terms[0].cost.merge(own.cost);
        result.non_finite.merge(own.bad);
        result.tape_bytes = std::max(result.tape_bytes, own.tape_bytes);
      }
    }
    if (!progress.stopped()) collect(sum, result);
    result.seconds = watch_.seconds();
    return result;
  }

 private:
  struct TileFigures {
    TermCost cost;
    NonFinite bad;
    uint64_t tape_bytes = 0;
  };

  void collect(ContributionSum& sum, BackwardResult& result) const {
    const std::vector<std::vector<double>> sums = parameters_.gather(sum.sums());
    for (size_t i = 0; i < sums.size(); ++i) result.parameters[i].moments.add_exact(sums[i]);
    if (options_.each_batch) options_.each_batch(1, sums);
    result.contributions = sum.added();
    result.spp = 1;
    result.batches = 1;
  }

  const Rgb<double>& adjoint_at(int x, int y) const {
    return adjoint_[pixel_index(film_, x, y) / 3];
  }

  void add_tile(size_t t, TileFigures& figures, std::vector<Contribution>& list) const {
    const Stopwatch watch;
    Tape tape(&parameters_.slots());
    const TapeScope scope(tape);
    PixelParts parts(parameters_.scene(), pixels_);
    pixels_.for_each_pixel(
        t, settings_.interrupted, [&](int x, int y) { return !is_black(adjoint_at(x, y)); },
        [&](int x, int y, const VisibleRegions& regions) {
          parts.find(x, y, regions, true);
          figures.cost.samples += parts.size();
          const size_t before = list.size();
          bool finite = true;
          for (size_t i = 0; i < parts.size() && finite; ++i) {
            finite = add_part(parts, i, adjoint_at(x, y), tape, list);
            figures.tape_bytes = std::max<uint64_t>(figures.tape_bytes, tape.bytes());
          }
          if (finite) return;
          // Nothing of the pixel, as in forward mode.
          list.resize(before);
          figures.bad.add({x, y, 0, kFacesTerm});
        });
    join_slots(list);
    figures.cost.seconds += watch.seconds();
  }

  bool add_part(const PixelParts& parts, size_t i, const Rgb<double>& adjoint, Tape& tape,
                std::vector<Contribution>& list) const {
    tape.clear();
    const CameraView<Var> view = camera_leaves(parameters_.scene().camera);
    const FacePart<Var> part = parts.part(i, parameters_.scene(), view);
    const CameraRay<Var> ray = view.ray(part.x, part.y);
    RayCount rays;
    PathTracer<Var, NoVisitor> tracer(traced_.context(), rays);
    Walk<Var, NoVisitor> walk(Rng(0, 0, 0), 0, nullptr);
    const StartRay<Var> start{{}, ray.origin, ray.direction};
    tracer.follow_rays({&start, 1}, {&part.face, 1}, {&walk, 1});
    const Rgb<Var> sum = walk.sums.radiance * part.area;
    if (walk.failed || !is_finite(value(sum))) return false;
    tape.start();
    for (int c = 0; c < 3; ++c) tape.adjoint(sum[c].node) += adjoint[c];
    tape.sweep();
    return append_finite(tape, list);
  }

  Stopwatch watch_;
  const BackwardOptions& options_;
  const RunSettings& settings_;
  const Film& film_;
  std::vector<Rgb<double>> adjoint_;
  ParameterSlots parameters_;
  std::shared_ptr<const CoincidentFaces> faces_;
  PixelRegions pixels_;
  TracedScene traced_;
};

}  // namespace

BackwardResult backward_over_faces(const Scene& scene, const Image& adjoint,
                                   const BackwardOptions& options, const RunSettings& settings) {
  return FacesPass(scene, adjoint, options, settings).run();
}

}  // namespace limn
