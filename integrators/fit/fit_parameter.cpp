// Parameters of a fit: found by name in every view, moved by their optimiser.
#include "integrators/fit/fit_parameter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "integrators/fit/surface_tree.h"
#include "limn/core/check.h"
#include "limn/core/error.h"
#include "limn/integrators/remesh.h"

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
    : name_(name),
      in_view_(views.size()),
      shapes_(views.size()),
      moves_texels_(views.size()),
      first_view_(views.size()) {
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
    moves_texels_[v] = in_view_[v]->texel_map(scene) != nullptr;
    for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
      if (!in_view_[v]->velocities(scene, ShapeId(s)).empty()) shapes_[v] = ShapeId(s);
    }
  }
  if (first_view_ == views.size()) throw UnknownParameter(*unknown);
  natural_step_ = natural_step_in(views[first_view_].scene);
  const size_t dimensions = in_view_[first_view_]->array.size();
  if (dimensions == 1 || dimensions == 2) {
    find_array(views, options.smoothing);
  } else {
    find_numbers(views);
  }
  find_bounds(views, options);
  // Channels of a colour are as different as two parameters: each has its own scale. Texels that
  // few paths meet have noise alone, which a scale of their own would make as large as any step.
  const bool alone = !is_array() && !is_map() && options.optimiser == OptimiserKind::kAdamUniform;
  optimiser_.emplace(alone ? OptimiserKind::kAdam : options.optimiser, numbers_.size());
}

// A rotation moves its farthest vertex as far as a translation does.
double FitParameter::natural_step_in(const Scene& scene) const {
  const Parameter& parameter = *in_view_[first_view_];
  const ShapeId shape = shapes_[first_view_];
  if (!shape.valid() || !parameter.array.empty()) return parameter.natural_step;
  double fastest = 0;
  for (const Vec3d& v : parameter.velocities(scene, shape)) fastest = std::max(fastest, length(v));
  const double diagonal = bounds_of(scene.shape(shape).mesh).diagonal();
  return fastest > 0 ? 0.01 * diagonal / fastest : parameter.natural_step;
}

void FitParameter::find_in_views(const std::vector<FitView>& views) {
  for (size_t v = 0; v < views.size(); ++v) {
    if (in_view_[v]) in_view_[v] = find_parameter_or_array(views[v].scene, name_);
  }
}

void FitParameter::find_numbers(const std::vector<FitView>& views) {
  const Parameter& first = *in_view_[first_view_];
  for (size_t v = first_view_; v < views.size(); ++v) {
    if (!in_view_[v] || in_view_[v]->array == first.array) continue;
    throw InputError({views[v].scene.file},
                     fmt::format("the map of \"{}\" has another size than that of {}", name_,
                                 views[first_view_].scene.file));
  }
  numbers_.resize(first.numbers());
}

void FitParameter::find_array(const std::vector<FitView>& views, double smoothing) {
  const Mesh& first = mesh(views);
  for (size_t v = first_view_; v < views.size(); ++v) {
    if (!in_view_[v]) continue;
    const Mesh& other = views[v].scene.shape(shapes_[v]).mesh;
    if (other.positions == first.positions && other.faces == first.faces) continue;
    throw InputError({views[v].scene.file},
                     fmt::format("the mesh of \"{}\" is not that of {}: views of one shape must "
                                 "show the same vertices and faces",
                                 name_, views[first_view_].scene.file));
  }
  const double in_edges = smoothing * bounds_of(first).diagonal() / mean_edge_length(first);
  large_steps_ = std::make_unique<LargeSteps>(first, in_edges * in_edges);
  if (in_view_[first_view_]->array.size() == 1) {
    const std::vector<Vec3d> directions =
        in_view_[first_view_]->directions(views[first_view_].scene);
    for (const uint32_t v : large_steps_->first()) {
      start_.push_back(cast<double>(first.positions[v]));
      along_.push_back(directions[v]);
    }
    numbers_.resize(large_steps_->size());
    return;
  }
  std::vector<double> positions;
  for (const uint32_t v : large_steps_->first()) {
    for (int k = 0; k < 3; ++k) positions.push_back(static_cast<double>(first.positions[v][k]));
  }
  numbers_ = large_steps_->apply(positions);
}

void FitParameter::find_bounds(const std::vector<FitView>& views, const FitOptions& options) {
  least_ = in_view_[first_view_]->least;
  most_ = in_view_[first_view_]->most;
  for (const FitBounds& bounds : options.bounds) {
    if (bounds.parameter != name_) continue;
    if (is_array())
      throw InputError("\"" + name_ + "\" has no bounds: they are for scalars and texels");
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
  std::vector<double> step = optimiser_->step(scaled(gradient), count);
  for (double& x : step) x *= natural_step_ * size;
  add_to_numbers(step, views);
  return 0;
}

bool FitParameter::add(std::vector<double>& step, std::vector<FitView>& views) {
  for (double& x : step) x *= natural_step_;
  if (is_array()) {
    std::vector<double> tried = numbers_;
    for (size_t i = 0; i < tried.size(); ++i) tried[i] += step[i];
    if (!place_vertices(large_steps_->solve(tried), views)) return false;
    numbers_ = std::move(tried);
  } else {
    add_to_numbers(step, views);
  }
  for (double& x : step) x /= natural_step_;
  return true;
}

void FitParameter::add_to_numbers(std::vector<double>& step, std::vector<FitView>& views) {
  for (size_t v = 0; v < views.size(); ++v) {
    if (!in_view_[v]) continue;
    const std::vector<double> now = bounded_numbers(views[v], v);
    for (size_t k = 0; k < step.size(); ++k) {
      const double below = std::min(0.0, least_ - now[k]), above = std::max(0.0, most_ - now[k]);
      step[k] = std::clamp(step[k], below, above);
    }
  }
  for (size_t v = 0; v < views.size(); ++v) {
    if (!in_view_[v]) continue;
    Scene& scene = views[v].scene;
    std::vector<double> value = in_view_[v]->value(scene);
    if (value.empty()) {
      in_view_[v]->move(scene, step[0]);
      continue;
    }
    for (size_t k = 0; k < step.size(); ++k) value[k] = bounded_sum(value[k], step[k]);
    in_view_[v]->assign(scene, value);
  }
  const bool has_values = !in_view_[first_view_]->value(views[first_view_].scene).empty();
  for (size_t k = 0; k < step.size(); ++k) {
    numbers_[k] = has_values ? numbers_[k] + step[k] : bounded_sum(numbers_[k], step[k]);
  }
}

// Sums round: a value next to its bound must not pass it, and one that was stopped is there.
double FitParameter::bounded_sum(double now, double step) const {
  if (step == least_ - now) return least_;
  if (step == most_ - now) return most_;
  return std::clamp(now + step, least_, most_);
}

std::vector<double> FitParameter::lengths_to_bounds(const std::vector<double>& direction,
                                                    const std::vector<FitView>& views) const {
  std::vector<double> lengths(direction.size(), std::numeric_limits<double>::infinity());
  if (is_array()) return lengths;
  for (size_t v = 0; v < views.size(); ++v) {
    if (!in_view_[v]) continue;
    const std::vector<double> now = bounded_numbers(views[v], v);
    for (size_t k = 0; k < direction.size(); ++k) {
      const double d = direction[k] * natural_step_;
      if (d == 0) continue;
      const double length = ((d < 0 ? least_ : most_) - now[k]) / d;
      lengths[k] = std::min(lengths[k], std::max(0.0, length));
    }
  }
  return lengths;
}

std::vector<double> FitParameter::scaled(const std::vector<double>& gradient) const {
  if (!is_array()) {
    std::vector<double> step = gradient;
    for (double& g : step) g *= natural_step_;
    return step;
  }
  const std::vector<uint32_t>& welded = large_steps_->welded();
  const size_t each = is_displacement() ? 1 : 3;
  std::vector<double> of_welded(numbers_.size());
  for (size_t v = 0; v < welded.size(); ++v) {
    for (size_t k = 0; k < each; ++k) of_welded[each * welded[v] + k] += gradient[each * v + k];
  }
  // The matrix is symmetric: dL/du = (I + lambda L)^-1 dL/dv.
  std::vector<double> step = large_steps_->solve(of_welded);
  for (double& x : step) x *= natural_step_;
  return step;
}

int FitParameter::move_vertices(const std::vector<double>& gradient, double size, int64_t count,
                                std::vector<FitView>& views) {
  std::vector<double> step = optimiser_->step(scaled(gradient), count);
  for (double& x : step) x *= natural_step_ * size;
  for (int halvings = 0; halvings < kMostHalvings; ++halvings) {
    std::vector<double> tried = numbers_;
    for (size_t i = 0; i < tried.size(); ++i) tried[i] += std::ldexp(step[i], -halvings);
    if (!place_vertices(large_steps_->solve(tried), views)) continue;
    numbers_ = std::move(tried);
    return halvings;
  }
  return kMostHalvings;
}

bool FitParameter::place_vertices(const std::vector<double>& vertices,
                                  std::vector<FitView>& views) const {
  std::vector<Vec3f> all;
  for (const size_t w : large_steps_->welded()) {
    const double* x = &vertices[is_displacement() ? w : 3 * w];
    all.push_back(
        cast<float>(is_displacement() ? start_[w] + along_[w] * *x : Vec3d{x[0], x[1], x[2]}));
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

std::vector<FitScalar> FitParameter::scalars(const std::vector<FitView>& views) const {
  if (is_array() || is_map()) return {};
  const Parameter& parameter = *in_view_[first_view_];
  const std::vector<double> numbers = bounded_numbers(views[first_view_], first_view_);
  if (!parameter.colour) return {{name_, parameter.unit, numbers[0], name_}};
  std::vector<FitScalar> channels;
  for (int c = 0; c < 3; ++c) {
    const double x = numbers[static_cast<size_t>(c)];
    channels.push_back({name_ + "." + "rgb"[c], parameter.unit, x, name_});
  }
  return channels;
}

FitState::Numbers FitParameter::state() const {
  FitState::Numbers state{numbers_, optimiser_->first, optimiser_->second, 0, 0};
  if (is_array()) {
    state.natural_step = natural_step_;
    state.lambda = large_steps_->lambda();
  }
  return state;
}

void FitParameter::restore(const FitState::Numbers& numbers, const std::vector<FitView>& views,
                           bool remeshed) {
  size_t size = numbers_.size();
  if (is_array()) {
    if (!(numbers.lambda >= 0)) throw InputError("the state of \"" + name_ + "\" has no lambda");
    if (remeshed) find_in_views(views);
    // The matrix is of lambda and the triangles alone; to factor it takes longer than a step.
    if (remeshed || numbers.lambda != large_steps_->lambda()) {
      large_steps_ = std::make_unique<LargeSteps>(mesh(views), numbers.lambda);
    }
    natural_step_ = numbers.natural_step;
    size = (is_displacement() ? 1 : 3) * large_steps_->size();
  }
  const size_t moments = optimiser_->first.empty() ? 0 : size;
  if (numbers.values.size() != size || numbers.first.size() != moments ||
      numbers.second.size() != moments) {
    throw InputError("the state of \"" + name_ + "\" is of another size or optimiser");
  }
  const Parameter& first = *in_view_[first_view_];
  if (!is_array() && first.value(views[first_view_].scene).empty()) {
    for (const double x : numbers.values) {
      if (x >= first.least && x <= first.most) continue;
      throw InputError(fmt::format("the state of \"{}\" has {:g}, which it cannot be", name_, x));
    }
  }
  numbers_ = numbers.values;
  optimiser_->first = numbers.first;
  optimiser_->second = numbers.second;
}

void FitParameter::remesh(double edge, double smoothing, std::vector<FitView>& views) {
  const Mesh before = mesh(views);
  const std::vector<uint32_t> welded = large_steps_->welded();
  const Remeshed after = limn::remesh(before, edge * mean_edge_length(before),
                                      views[first_view_].scene.shape(shapes_[first_view_]).where);
  for (size_t v = 0; v < views.size(); ++v) {
    if (in_view_[v]) set_mesh(views[v].scene, shapes_[v], after.positions, after.faces, nullptr);
  }
  find_in_views(views);
  natural_step_ = in_view_[first_view_]->natural_step;
  find_array(views, smoothing);
  if (optimiser_->first.empty()) return;
  std::vector<double> first, second;
  const SurfaceTree tree(before);
  for (const uint32_t v : large_steps_->first()) {
    const SurfaceTree::Nearest nearest = tree.nearest(cast<double>(mesh(views).positions[v]));
    const auto c = corners_of(before, nearest.face.index());
    const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
    double moments[2][3] = {};
    for (int k = 0; k < 3; ++k) {
      const Vec3d &a = c[(k + 1) % 3], &b = c[(k + 2) % 3];
      // Rounding may take a corner's weight below zero, where a square must not go.
      const double weight =
          std::max(0.0, dot(n, cross(a - nearest.point, b - nearest.point)) / dot(n, n));
      const size_t w = 3 * size_t{welded[before.face(nearest.face)[k]]};
      for (int axis = 0; axis < 3; ++axis) {
        moments[0][axis] += weight * optimiser_->first[w + axis];
        moments[1][axis] += weight * optimiser_->second[w + axis];
      }
    }
    first.insert(first.end(), moments[0], moments[0] + 3);
    second.insert(second.end(), moments[1], moments[1] + 3);
  }
  optimiser_->first = std::move(first);
  optimiser_->second = std::move(second);
}

}  // namespace limn
