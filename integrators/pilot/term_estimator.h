#pragma once
// The terms of a derivative image as one estimator: up to kLanes parameters of one scene.
#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/paths/traced_scene.h"
#include "integrators/paths/walk.h"
#include "integrators/paths/warp_field.h"
#include "integrators/pilot/pilot_moments.h"
#include "integrators/pilot/sample_plan.h"
#include "integrators/pilot/value_paths.h"
#include "integrators/terms/lane_sinks.h"
#include "integrators/terms/term.h"
#include "limn/core/parameter.h"

namespace limn {

// How directions are warped, see warp_field.h.
struct Warping {
  WarpOptions options;
  bool unbiased = false;
};

// What few methods have.
struct TermExtras {
  const Warping* warping = nullptr;  // null where directions are not warped
  bool closed = false;  // what surfaces scatter is known in closed form, see closed_light.h
  bool moved_film = false;
  bool of_differences = false;      // paths are those of differences
  std::optional<double> time = {};  // of the shutter, see at_time(); none: the reference time
  KeptEdges* kept = nullptr;        // of other times; must outlive the estimator; may be null
};

class TermEstimator final : public SampleEstimator {
 public:
  // parameters: at most kLanes. types: terms_of() the scene; slots are indices into it. computed:
  // one per type; of these only changed_terms() have samples.
  TermEstimator(const Scene& scene, std::span<const Parameter> parameters,
                const std::vector<const TermType*>& types, const std::vector<bool>& computed,
                const EdgeSamplerType& sampler, int threads, const TermExtras& extras = {});
  TermEstimator(const TermEstimator&) = delete;
  TermEstimator& operator=(const TermEstimator&) = delete;

  // What samples hold from now on.
  void set_plan(SamplePlan plan);
  const SamplePlan& plan() const { return plan_; }
  // What samples of a slot cost, see Term::work and first_work.
  double work(size_t slot, const TermCost& cost) const;
  double first_work(size_t slot, const TermCost& cost) const;
  // Adds what to tell of kinks that the parameters move the scene across: none twice.
  void warn_of_kinks(std::vector<std::string>& warnings) const;
  void describe(GradientStats& stats) const;
  const EdgeSamplerInput* edges() const { return input_.made_edges(); }
  const PathContext& context() const { return traced_.context(); }
  // Null where no edges are sampled.
  const Viewpoints* viewpoints() const { return traced_.context().viewpoints; }
  const MotionRates& motion_rates() const { return rates_; }
  // Whether a slot's samples belong to pixels, not to the film.
  bool adds_to_pixels(size_t slot) const {
    return terms_[slot] && (terms_[slot]->uses_paths() || terms_[slot]->uses_vertices() ||
                            terms_[slot]->uses_moved_pixels());
  }

  bool draws_at_vertices(size_t slot) const {
    return terms_[slot] && terms_[slot]->uses_vertices();
  }

  // One path with one sample of every term at its vertices.
  struct Sample {
    Rgb<double> radiance;
    std::array<TurnedSample, kMostTerms> terms;  // of each slot; zero for those of the film
    // Of terms at vertices, where asked for: two draws at those of one path.
    std::array<std::array<Rgb<Lanes>, 2>, kMostTerms> pair;
    std::array<double, kMostTerms> listing;  // work of lists of silhouettes
    TracedDraws traced;
    bool finite;
  };
  // turns: whether turns of directions at the first vertex are looked at; the values are those of
  // directions at rest.
  // again: whether terms draw twice at the vertices.
  Sample sample(const PixelSample& at, const Rng& key, bool turns, bool again,
                SampleSink& sink) const;

  const Scene& scene() const override { return scene_; }
  size_t slots() const override { return types_.size(); }
  const char* slot_name(size_t slot) const override { return types_[slot]->name; }
  int lanes() const override { return lanes_; }
  Lanes lane_scale() const override { return lane_scale_; }

  Numbers numbers() const override { return plan_.numbers; }
  bool samples_pixels() const override { return paths_ || vertices_; }
  size_t pixel_slot() const override { return pixel_slot_; }
  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override {
    add_samples(samples, {}, sink);
  }
  // Positions that move do so for each pixel by itself.
  int reach() const override { return plan_.film.empty() ? reach_ : 0; }
  int places() const override { return most_paths_; }
  void add_shared(std::span<const KeyedSample> samples, std::span<const SharedPlace* const> places,
                  SampleSink& sink) const override {
    add_samples(samples, places, sink);
  }

  double film_samples(size_t slot) const override {
    return terms_[slot] && terms_[slot]->uses_film() ? plan_.uniform[slot] : 0;
  }
  int film_stream(size_t slot) const override { return types_[slot]->film_stream; }
  bool sample_film(size_t slot, double u, const Rng& key, RayCount& rays,
                   FilmSample& sample) const override;
  const FilmMotion* film_motion(int x, int y) const override { return plan_.film_motion(x, y); }
  const Vec3<Lanes>* turn(int x, int y) const override {
    const DirectionField* field = plan_.field_at({x, y, 0});
    return field ? &field->turn : nullptr;
  }

 private:
  class VertexTerms;
  class VertexMotions;
  class PathBatch;
  struct Path {
    PathSums<Dual> found;
    bool finite;
  };
  struct PathCosts {
    RayCount rays;
    WarpCount warped;
  };
  // Where a path starts; mirrored: see mirrored_in_pixel. shared: null if it is its pixel's alone.
  struct PathStart {
    PixelSample at;
    bool mirrored = false;
    const SharedPlace* shared = nullptr;
    int number = 0;     // of the path
    double weight = 1;  // pixel_filter_weight of its own place
  };
  PathStart weighed(PathStart start, const Rng& key) const;
  // places: of shared samples, else empty.
  void add_samples(std::span<const KeyedSample> samples, std::span<const SharedPlace* const> places,
                   SampleSink& sink) const;
  // walks[i] is a path of places[i]; at most as many as a PathTracer takes.
  template <class Visitor>
  PathCosts trace(std::span<const PathStart> places, std::span<Walk<Dual, Visitor>> walks,
                  SampleLog* log, bool twice) const;
  template <class Visitor>
  Path trace_one(const PathStart& place, const Rng& key, const DirectionField* field,
                 Visitor& visitor, SampleLog* log, TermCost& cost, bool twice = false) const;
  Path path_of(const PathSums<Dual>& found, bool failed) const;
  void add_values(std::span<const KeyedSample> samples, std::span<const SharedPlace* const> places,
                  SampleSink& sink) const;
  void add_moved_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const;
  Rgb<Lanes> sample_moved_pixel(size_t slot, const PixelSample& at, const Rng& key,
                                SampleSink& sink) const;
  void add_logged(const PixelSample& at, const Rng& key, const SharedPlace* shared,
                  SampleSink& sink) const;
  // How many places of its pixel a path takes: in closed form these alone are left to chance.
  int places_of_path() const { return traced_.context().closed ? 2 : 1; }
  // Paths that are traced twice must take the same samples, though their vertices move otherwise.
  bool splits_now(bool twice) const { return plan_.splits && !twice; }
  // What turns about the axes change, in the unit of MotionRates: from what lanes 1 to 3 have more
  // where directions turn in them.
  Lanes turned(const Lanes& turning, const Lanes& held) const;
  Rgb<Lanes> turned(const Rgb<Lanes>& turning, const Rgb<Lanes>& held) const;
  // Without what turns change in lanes 1 to 3.
  Rgb<Lanes> at_rest(const Rgb<Lanes>& turning, const Rgb<Lanes>& turned) const;
  static void add_cost(const PathCosts& costs, size_t paths, TermCost& cost);
  void add_path(const PathStart& start, const Path& path, double weight, SampleSink& sink) const;
  void add_vertices(const PathStart& start, const VertexTerms& vertices, SampleSink& sink) const;

  std::vector<bool> changed_;  // of each slot: whether it is sampled
  Scene scene_;                // with its parameters seeded
  int lanes_;
  Lanes lane_scale_;
  TracedScene traced_;
  CameraView<Dual> camera_;
  FilterTable filter_;
  TermInput input_;
  std::vector<const TermType*> types_;
  std::vector<std::unique_ptr<Term>> terms_;  // of each slot; null where not computed
  size_t pixel_slot_ = 0;                     // of the term that traces paths
  bool paths_ = false, vertices_ = false;     // whether some term uses them
  bool moves_film_;                           // whether a plan may
  MotionRates rates_;
  std::unique_ptr<ValuePaths> values_;     // null where something moves
  std::unique_ptr<WarpField> warp_field_;  // null where directions are not warped
  // What a pilot turns directions by: about the axes x, y and z in the lanes 1 to 3.
  DirectionField turning_;
  SamplePlan plan_;
  int reach_ = 0;       // of shared samples where positions on the film are held
  int most_paths_ = 1;  // of a sample
};

}  // namespace limn
