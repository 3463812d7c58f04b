#pragma once
// What a Fit holds: its views, its parameters, and the loop over steps.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "integrators/edges/scene_edges.h"
#include "integrators/fit/fit_parameter.h"
#include "integrators/fit/quasi_newton.h"
#include "limn/integrators/fit.h"

namespace limn {

class Fit::Impl {
 public:
  Impl(std::vector<FitView> views, const FitOptions& options, const RunSettings& settings);

  void listen(const std::function<void(double)>& progress, const std::atomic<bool>* interrupted) {
    settings_.progress = progress;
    settings_.interrupted = interrupted;
  }
  std::optional<FitRecord> step();
  std::vector<FitScalar> scalars() const;
  FitState state() const;
  void restore(const FitState& state);

  std::vector<FitView> views;
  std::vector<std::string> warnings;
  int64_t steps = 0;

 private:
  void check_shapes();
  void check_channels() const;
  void check_terms() const;
  void check_remeshing();
  // Whether parameters move edges that may be seen.
  bool moves_on_film(size_t view) const;
  void check_exact();
  // Of a scalar; none where the view does not have it, and of motions.
  std::vector<double> values_in(size_t view, const FitParameter& parameter) const;
  // What parameters without values (a field of texels, one of them) move, each map once.
  std::vector<const TexelMap*> texel_maps(size_t view) const;
  // Half done where it throws.
  void put(const FitState& state);
  // Whether the shape may have other triangles than at the start.
  bool may_remesh(size_t view, ShapeId shape) const;
  // InputError for the state of another fit.
  void check_state(const FitState& state) const;
  // Shapes of a view that some parameter moves, in the scene's order.
  std::vector<ShapeId> moved_shapes(size_t view) const;
  RunSettings view_settings(size_t view) const;
  // What the remeshings so far have left of steps and smoothing.
  double shrunk() const {
    const auto done = [&](int64_t step) { return step <= steps; };
    const auto count = std::count_if(options_.remesh.begin(), options_.remesh.end(), done);
    return std::pow(options_.remesh_shrink, static_cast<double>(count));
  }
  // The loss is a function of the parameters: all steps take the same samples.
  bool is_exact() const { return options_.optimiser == OptimiserKind::kLbfgs; }
  bool over_faces() const { return options_.backward.points == FilmPoints::kFaces; }
  // Importances of skies that no parameter changes are made once.
  void keep_skies();
  // Per pixel, of this step, if there were so many at the first one.
  int samples_of(int first) const;
  // In fit_blurred.cpp.
  void check_blur() const;
  Blur blur() const;  // of this step; sigma 0: the gradient is that of sharp faces
  // Adds the gradient of the blurred scene. False: interrupted.
  bool add_blurred(size_t view, const Image& adjoint, const RunSettings& settings,
                   std::vector<std::vector<double>>& gradients) const;
  // False: interrupted.
  bool add_view(size_t view, FitRecord& record, std::vector<std::vector<double>>& gradients);
  // Loss and gradients of all views; false: interrupted.
  bool evaluate(FitRecord& record, std::vector<std::vector<double>>& gradients);
  void finish_step(FitRecord& record);

  // Of kLbfgs, in fit_quasi_newton.cpp.
  struct Iterate {
    FitRecord record;              // its losses
    std::vector<double> gradient;  // of all parameters in turn, per natural step
  };
  // A line from here_, and what bounds leave of it.
  struct Line {
    std::vector<double> direction;  // 0 for numbers that cannot move
    std::vector<double> lengths;    // along it, after which a bound holds a number
    bool fresh = false;             // the direction is minus the gradient
  };
  std::optional<Iterate> place();
  // Along a direction, for each number; infinite where no bound is met.
  std::vector<double> lengths_to_bounds(const std::vector<double>& direction) const;
  Line downwards() const;
  // Adds `length` times the direction, up to bounds; none if a face would lose its area or a value
  // cannot be, else what was added.
  std::optional<std::vector<double>> advance(const std::vector<double>& direction, double length);
  enum class Search { kFound, kNone, kInterrupted };
  Search search_along(const Line& line, double first, FitRecord& record);
  // Of it nothing is left where it throws.
  std::optional<std::pair<Iterate, std::vector<double>>> search_from(const Iterate& start,
                                                                     const FitState& before,
                                                                     const Line& line, double first,
                                                                     FitRecord& record,
                                                                     bool& interrupted);
  // At rest: on to the next remeshing, if one is left.
  void skip_to_remeshing();
  std::optional<FitRecord> quasi_newton_step();

  FitOptions options_;
  RunSettings settings_;
  std::vector<FitParameter> parameters_;
  std::vector<KeptEdges> kept_;  // of each view
  QuasiNewton quasi_newton_;
  std::optional<Iterate> here_;  // of the parameters as they are, if known
};

}  // namespace limn
