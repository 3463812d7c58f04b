#pragma once
// What one path, or one point of the film, adds to a gradient. Terms are those of forward mode.
#include <memory>
#include <vector>

#include "integrators/backward/edge_motion.h"
#include "integrators/backward/film_adjoint.h"
#include "integrators/backward/film_field.h"
#include "integrators/backward/filter_adjoint.h"
#include "integrators/backward/parameter_slots.h"
#include "integrators/backward/pixel_choice.h"
#include "integrators/estimates/gradient_estimator.h"
#include "integrators/paths/traced_scene.h"
#include "integrators/terms/term.h"
#include "limn/core/parameter.h"
#include "limn/integrators/methods.h"

namespace limn {

class ReverseEstimator final : public GradientEstimator {
 public:
  // InputError as backward().
  // time: as of ParameterSlots. kept: of other times; may be null.
  ReverseEstimator(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
                   int threads, const std::optional<double>& time = {}, KeptEdges* kept = nullptr);
  ReverseEstimator(const ReverseEstimator&) = delete;
  ReverseEstimator& operator=(const ReverseEstimator&) = delete;

  const ParameterSlots& parameters() const { return parameters_; }
  // Of a term, for each path.
  double samples_of(size_t slot) const;
  // For each path; see possible_samples().
  void set_samples(std::vector<double> samples) { planned_ = std::move(samples); }
  // What a pilot may choose from: never fewer than there are without one where `forest` has the
  // term, so that what the pilot did not see stays within the error bars. Of `filter` what it has.
  std::vector<double> possible_samples(size_t slot) const;
  std::string method_name() const { return options_.method.name(); }

  // For a pilot: from now on only the term in the slot adds something, and batches have so many of
  // their samples. No slot: all do.
  void probe(double share, std::optional<size_t> slot) {
    share_ = share;
    only_ = slot;
  }
  bool computes(size_t slot) const { return terms_[slot] != nullptr; }
  // Whether a term, or any, takes samples of edges at vertices.
  bool draws_at_vertices(size_t slot) const {
    return terms_[slot] && terms_[slot]->uses_vertices();
  }
  bool draws_at_vertices() const { return vertices_; }
  // See Term.
  double work(size_t slot, const TermCost& cost) const {
    return terms_[slot] ? terms_[slot]->work(cost) : 0;
  }
  double first_work(size_t slot, const TermCost& cost) const {
    return terms_[slot] ? terms_[slot]->first_work(cost) : 0;
  }
  const BackwardOptions& options() const { return options_; }
  // Adds the terms, statistics of the set-up, and warnings.
  void describe(BackwardResult& result) const;

  const Scene& scene() const override { return parameters_.scene(); }
  size_t slots() const override { return types_.size(); }
  const char* slot_name(size_t slot) const override { return types_[slot]->name; }
  uint32_t gradient_slots() const override { return parameters_.slots().count; }
  std::vector<std::vector<double>> gather(const std::vector<double>& sums) const override {
    if (!field_) return parameters_.gather(sums);
    std::vector<double> all = sums;
    field_->gather(all);
    return parameters_.gather(all);
  }
  std::vector<size_t> sizes() const override { return parameters_.sizes(); }
  int most_batches() const override { return std::max(1, options_.batches); }
  // Those of planned runs are even; a pilot is behind these.
  Numbers numbers() const override {
    return planned_.empty() ? Numbers::kIndependent : Numbers::kEvenInBatches;
  }
  void end_tile(std::vector<Contribution>& contributions) const override;

  bool samples_pixels() const override {
    return only_ ? *only_ == pixel_slot_ || draws_at_vertices(*only_) : paths_;
  }
  size_t pixel_slot() const override { return pixel_slot_; }
  size_t samples(const Batch& batch) const override { return choice_.paths(batch, share_); }
  void add_tile(const Batch& batch, size_t tile, GradientTile& to) const override;
  int64_t sample_of(int64_t number) const override { return choice_.sample_of(number); }
  void add_sample(const Batch& batch, const PixelSample& at, GradientTile& to) const override;

  double film_samples(size_t slot) const override {
    return adds(slot) && (is_filter(slot) || terms_[slot]->uses_film()) ? share_ * film_points(slot)
                                                                        : 0;
  }
  int film_stream(size_t slot) const override { return types_[slot]->film_stream; }
  void add_film(size_t slot, std::span<const FilmDraw> draws, GradientTile& to) const override;

 private:
  class VertexAdjoints;

  bool adds(size_t slot) const { return terms_[slot] && (!only_ || *only_ == slot); }
  // Of a term with points on the film, for each path.
  double film_points(size_t slot) const;
  // At every vertex: a whole number, or the probability that a path has one.
  double vertex_samples(size_t slot) const {
    return planned_.empty() ? options_.edge_samples : planned_[slot];
  }
  bool is_filter(size_t slot) const { return types_[slot]->moved_film; }
  bool may_move_film() const;
  CameraRay<Var> ray_through(const FilmPlace& film, const CameraRay<double>& ray) const;
  // The path of a pixel. expected: how many paths it has in the batch, on average.
  struct Path {
    PixelSample at;
    double expected;
    double paths;  // of all pixels in the batch
    Rng key;
  };
  Path path(const Batch& batch, size_t index) const;
  void add_path(const Path& path, Tape& tape, GradientTile& to) const;
  // Leaves on the tape what a sample contributes; false if it is not finite.
  bool trace(const Path& path, Tape& tape, GradientTile& to) const;
  bool trace(size_t slot, const FilmDraw& draw, Tape& tape, GradientTile& to) const;
  bool trace_line(size_t slot, const FilmDraw& draw, Tape& tape, GradientTile& to) const;

  BackwardOptions options_;
  std::vector<double> planned_;  // samples of each slot; empty: those of the options
  double share_ = 1;
  std::optional<size_t> only_;
  FilmAdjoint film_;
  PixelChoice choice_;
  ParameterSlots parameters_;
  ReverseMethod method_;
  Moved moved_;  // by the parameters
  TracedScene traced_;
  std::unique_ptr<FilmField> field_;         // null where positions on the film are held
  std::unique_ptr<FilterAdjoint> filtered_;  // with it
  FreeMotion free_;
  TermInput input_;
  FilterTable filter_;
  EdgeMotion motion_;
  std::vector<const TermType*> types_;        // of each slot
  std::vector<std::unique_ptr<Term>> terms_;  // null where not computed
  size_t pixel_slot_ = 0;                     // of the term that traces paths
  bool paths_ = false, vertices_ = false;     // whether some term uses them
};

// Adds what the tape of a sample contributes, and its magnitude: squares are summed over all
// contributions, in the units of their slots. False if one is not finite; then nothing is added.
bool add_tape(const Tape& tape, const NonFinite::SampleId& place, const ParameterSlots& parameters,
              TermCost& cost, GradientTile& to);

}  // namespace limn
