// Parameters of a fit: found by name in every view, moved by their optimiser.
#include "integrators/fit/fit_parameter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "limn/core/check.h"
#include "limn/core/error.h"

namespace limn {

namespace {

// A step is halved at most so often: what is left is below the rounding of a coordinate.
constexpr int kMostHalvings = 30;

// The mesh with other positions, unless a face loses its area or vertices grow together.
std::optional<Mesh> moved_whole(const Shape& shape, std::vector<Vec3f> positions) {
  const Mesh& mesh = shape.mesh;
  Mesh moved;
  try {
    moved = moved_mesh(mesh, std::move(positions), shape.where, nullptr);
  } catch (const InputError&) {  // too far away, or no face is left
    return std::nullopt;
  }
  if (moved.faces != mesh.faces || moved.weld != mesh.weld) return std::nullopt;
  for (const FaceIndices& face : mesh.faces) {
    if (has_area(mesh, face) && !has_area(moved, face)) return std::nullopt;
  }
  return moved;
}

}  // namespace

FitParameter::FitParameter(const std::string& name, const std::vector<FitView>& views,
                           const FitOptions& options)
    : name_(name), in_view_(views.size()), shapes_(views.size()), first_view_(views.size()) {
  std::optional<UnknownParameter> unknown;
  for (size_t v = 0; v < views.size(); ++v) {
    const Scene& scene = views[v].scene;
    try {
      in_view_[v] = find_parameter_or_array(scene, name);
    } catch (const UnknownParameter& error) {
      if (!unknown) unknown = error;
      continue;
    }
    first_view_ = std::min(first_view_, v);
    for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
      if (!in_view_[v]->velocities(scene, ShapeId(s)).empty()) shapes_[v] = ShapeId(s);
    }
  }
  if (first_view_ == views.size()) throw UnknownParameter(*unknown);
  if (in_view_[first_view_]->size > 1) {
    find_array(views, options);
  } else {
    numbers_ = {0};
  }
  find_bounds(views, options);
  optimiser_.emplace(options.optimiser, numbers_.size());
}

void FitParameter::find_array(const std::vector<FitView>& views, const FitOptions& options) {
  const auto mesh_in = [&](size_t v) -> const Mesh& {
    return views[v].scene.shape(shapes_[v]).mesh;
  };
  const Mesh& mesh = mesh_in(first_view_);
  for (size_t v = first_view_; v < views.size(); ++v) {
    if (!in_view_[v]) continue;
    if (mesh_in(v).positions == mesh.positions && mesh_in(v).faces == mesh.faces) continue;
    throw InputError({views[v].scene.file},
                     fmt::format("the mesh of \"{}\" is not that of {}: views of one shape must "
                                 "show the same vertices and faces",
                                 name_, views[first_view_].scene.file));
  }
  if (!(options.smoothing >= 0 && options.smoothing < 1e3)) {
    throw InputError(fmt::format("the smoothing {:g} is not in [0, 1000)", options.smoothing));
  }
  large_steps_ = std::make_unique<LargeSteps>(mesh, options.smoothing * bounds_of(mesh).diagonal());
  std::vector<double> positions;
  for (const uint32_t v : large_steps_->first()) {
    for (int k = 0; k < 3; ++k) positions.push_back(static_cast<double>(mesh.positions[v][k]));
  }
  numbers_ = large_steps_->apply(positions);
}

void FitParameter::find_bounds(const std::vector<FitView>& views, const FitOptions& options) {
  least_ = in_view_[first_view_]->least;
  most_ = in_view_[first_view_]->most;
  for (const FitBounds& bounds : options.bounds) {
    if (bounds.parameter != name_) continue;
    if (is_array()) throw InputError("\"" + name_ + "\" is an array: bounds are for scalars");
    if (!(bounds.least <= bounds.most)) {
      throw InputError(fmt::format("bounds of \"{}\": {:g} is not below {:g}", name_, bounds.least,
                                   bounds.most));
    }
    least_ = std::max(least_, bounds.least);
    most_ = std::min(most_, bounds.most);
  }
  if (is_array()) return;
  for (size_t v = 0; v < views.size(); ++v) {
    if (!in_view_[v]) continue;
    for (const double x : bounded_numbers(views[v], v)) {
      if (x >= least_ && x <= most_) continue;
      throw InputError({views[v].scene.file},
                       fmt::format("\"{}\" starts at {:g}, outside of its bounds [{:g}, {:g}]",
                                   name_, x, least_, most_));
    }
  }
}

std::vector<double> FitParameter::bounded_numbers(const FitView& view, size_t index) const {
  const std::vector<double> value = in_view_[index]->value(view.scene);
  return value.empty() ? numbers_ : value;
}

int FitParameter::move(const std::vector<double>& gradient, double size, int64_t count,
                       std::vector<FitView>& views) {
  if (is_array()) return move_vertices(gradient, size, count, views);
  move_scalar(gradient[0], size, count, views);
  return 0;
}

void FitParameter::move_scalar(double gradient, double size, int64_t count,
                               std::vector<FitView>& views) {
  const double natural = in_view_[first_view_]->natural_step;
  double step = natural * size * optimiser_->step({natural * gradient}, count)[0];
  for (size_t v = 0; v < views.size(); ++v) {
    if (!in_view_[v]) continue;
    for (const double x : bounded_numbers(views[v], v)) {
      step = std::clamp(step, std::min(0.0, least_ - x), std::max(0.0, most_ - x));
    }
  }
  for (size_t v = 0; v < views.size(); ++v) {
    if (!in_view_[v]) continue;
    Scene& scene = views[v].scene;
    in_view_[v]->move(scene, step);
    // Sums round: a value next to its bound must not pass it.
    std::vector<double> value = in_view_[v]->value(scene);
    if (value.empty()) continue;
    for (double& x : value) x = std::clamp(x, least_, most_);
    in_view_[v]->assign(scene, value);
  }
  numbers_[0] += step;
}

int FitParameter::move_vertices(const std::vector<double>& gradient, double size, int64_t count,
                                std::vector<FitView>& views) {
  const std::vector<uint32_t>& welded = large_steps_->welded();
  std::vector<double> of_welded(3 * large_steps_->size());
  for (size_t v = 0; v < welded.size(); ++v) {
    for (int k = 0; k < 3; ++k) of_welded[3 * welded[v] + k] += gradient[3 * v + k];
  }
  // The matrix is symmetric: dL/du = (I + lambda L)^-1 dL/dv.
  std::vector<double> step = large_steps_->solve(of_welded);
  const double natural = in_view_[first_view_]->natural_step;
  for (double& x : step) x *= natural;
  step = optimiser_->step(step, count);
  for (double& x : step) x *= natural * size;
  for (int halvings = 0; halvings < kMostHalvings; ++halvings) {
    std::vector<double> tried = numbers_;
    for (size_t i = 0; i < tried.size(); ++i) tried[i] += std::ldexp(step[i], -halvings);
    if (!place_vertices(large_steps_->solve(tried), views)) continue;
    numbers_ = std::move(tried);
    return halvings;
  }
  return kMostHalvings;
}

bool FitParameter::place_vertices(const std::vector<double>& positions,
                                  std::vector<FitView>& views) const {
  std::vector<Vec3f> all;
  for (const uint32_t w : large_steps_->welded()) {
    const double* x = &positions[3 * size_t{w}];
    all.push_back(cast<float>(Vec3d{x[0], x[1], x[2]}));
  }
  Scene& first = views[first_view_].scene;
  std::optional<Mesh> moved = moved_whole(first.shape(shapes_[first_view_]), all);
  if (!moved) return false;
  for (size_t v = first_view_; v < views.size(); ++v) {
    if (!in_view_[v]) continue;
    Shape& shape = views[v].scene.shapes[shapes_[v].index()];
    if (shape.mesh.normal_source == first.shape(shapes_[first_view_]).mesh.normal_source) {
      shape.mesh = *moved;
    } else {
      shape.mesh = moved_mesh(shape.mesh, all, shape.where, nullptr);
    }
  }
  return true;
}

FitScalar FitParameter::scalar(const std::vector<FitView>& views) const {
  CHECK(!is_array());
  const Parameter& parameter = *in_view_[first_view_];
  const std::vector<double> numbers = bounded_numbers(views[first_view_], first_view_);
  double sum = 0;
  for (const double x : numbers) sum += x;
  return {name_, parameter.unit, sum / static_cast<double>(numbers.size())};
}

FitState::Numbers FitParameter::state() const {
  return {numbers_, optimiser_->first, optimiser_->second};
}

void FitParameter::restore(const FitState::Numbers& numbers) {
  if (numbers.values.size() != numbers_.size() ||
      numbers.first.size() != optimiser_->first.size() ||
      numbers.second.size() != optimiser_->second.size()) {
    throw InputError("the state of \"" + name_ + "\" is of another size or optimiser");
  }
  numbers_ = numbers.values;
  optimiser_->first = numbers.first;
  optimiser_->second = numbers.second;
}

}  // namespace limn
