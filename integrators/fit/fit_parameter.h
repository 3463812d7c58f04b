#pragma once
// One parameter of a fit: where it is in each view, and how a gradient moves it.
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "integrators/fit/quasi_newton.h"
#include "limn/core/parameter.h"
#include "limn/integrators/fit.h"
#include "limn/integrators/large_steps.h"

namespace limn {

class FitParameter {
 public:
  // InputError if no view has the name, or views differ in what must be alike.
  FitParameter(const std::string& name, const std::vector<FitView>& views,
               const FitOptions& options);

  const std::string& name() const { return name_; }
  bool is_array() const { return large_steps_ != nullptr; }                 // of vertices
  bool is_displacement() const { return !along_.empty(); }                  // an array, too
  bool is_map() const { return in_view_[first_view_]->array.size() == 3; }  // of texels
  size_t size() const { return numbers_.size(); }  // numbers that steps are taken in
  // Null where the view does not have it.
  const Parameter* in_view(size_t view) const {
    return in_view_[view] ? &*in_view_[view] : nullptr;
  }
  // Whether it moves texels in that view.
  bool moves_texels(size_t view) const { return moves_texels_[view]; }
  // The shape of that view that it moves; none if it moves none.
  ShapeId shape(size_t view) const { return shapes_[view]; }

  // gradient: dLoss/dparameter, one value per number, copies of a welded vertex apart. Moves all
  // views by a step of `size` natural steps; count: of steps that came before. Returns how often
  // the step was halved.
  int move(const std::vector<double>& gradient, double size, int64_t count,
           std::vector<FitView>& views);

  // The gradient with respect to the numbers that move, per natural step.
  std::vector<double> scaled(const std::vector<double>& gradient) const;
  // The lengths along a direction in natural steps after which bounds hold its numbers, at least 0;
  // infinite where none does.
  std::vector<double> lengths_to_bounds(const std::vector<double>& direction,
                                        const std::vector<FitView>& views) const;
  // Adds a step in natural steps, up to bounds, and makes `step` what was added. False, and nothing
  // but `step` is changed, if a face would lose its area or grow together with another.
  bool add(std::vector<double>& step, std::vector<FitView>& views);

  // One, or the three channels of a colour; none of an array or a map.
  std::vector<FitScalar> scalars(const std::vector<FitView>& views) const;
  FitState::Numbers state() const;
  // The views have their state already; remeshed: with other triangles than before.
  void restore(const FitState::Numbers& numbers, const std::vector<FitView>& views, bool remeshed);

  // New triangles for the shape of an array in all views, with edges `edge` times as long as now,
  // and from now on that smoothing; the optimiser's state is interpolated.
  void remesh(double edge, double smoothing, std::vector<FitView>& views);

 private:
  const Mesh& mesh(const std::vector<FitView>& views) const {
    return views[first_view_].scene.shape(shapes_[first_view_]).mesh;
  }
  double natural_step_in(const Scene& scene) const;  // of the first view
  // Once more, after the mesh has changed.
  void find_in_views(const std::vector<FitView>& views);
  void find_array(const std::vector<FitView>& views, double smoothing);
  void find_numbers(const std::vector<FitView>& views);
  void find_bounds(const std::vector<FitView>& views, const FitOptions& options);
  int move_vertices(const std::vector<double>& gradient, double size, int64_t count,
                    std::vector<FitView>& views);
  // vertices: their positions, or how far they are displaced.
  bool place_vertices(const std::vector<double>& vertices, std::vector<FitView>& views) const;
  // step: in the parameter's unit; cut at bounds.
  void add_to_numbers(std::vector<double>& step, std::vector<FitView>& views);
  // What a number is after a step within bounds.
  double bounded_sum(double now, double step) const;
  // The numbers that bounds hold for: values, or the sum of steps.
  std::vector<double> bounded_numbers(const FitView& view, size_t index) const;

  std::string name_;
  std::vector<std::optional<Parameter>> in_view_;
  std::vector<ShapeId> shapes_;
  std::vector<bool> moves_texels_;
  size_t first_view_ = 0;  // that has it
  double natural_step_ = 0;
  double least_ = 0, most_ = 0;
  std::unique_ptr<LargeSteps> large_steps_;  // of an array
  std::vector<Vec3d> start_, along_;         // of displacements, for each welded vertex
  std::vector<double> numbers_;              // u of an array, or the sums of steps
  std::optional<Optimiser> optimiser_;
};

}  // namespace limn
