// The loop of a fit: losses and gradients of all views, then a step of every parameter.
#include "limn/integrators/fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "integrators/backward/steps.h"
#include "integrators/fit/fit_impl.h"
#include "integrators/methods/faces_estimator.h"
#include "integrators/methods/hair_gaps.h"
#include "integrators/methods/term_job.h"
#include "integrators/terms/term.h"
#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/rng.h"
#include "limn/integrators/fit_options.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/remesh.h"

namespace limn {

namespace {

std::vector<Vec3<Dual>*> camera_vectors(Camera& c) {
  return {&c.origin, &c.left, &c.up, &c.forward};
}

std::vector<double> camera_numbers(const Camera& camera) {
  Camera copy = camera;
  std::vector<double> numbers;
  for (const Vec3<Dual>* v : camera_vectors(copy)) {
    for (int k = 0; k < 3; ++k) numbers.push_back((*v)[k].v);
  }
  for (const Dual* v : {&copy.fov, &copy.aperture_radius, &copy.focus_distance}) {
    numbers.push_back(v->v);
  }
  return numbers;
}

void set_camera(Camera& camera, const std::vector<double>& numbers) {
  size_t next = 0;
  for (Vec3<Dual>* v : camera_vectors(camera)) {
    for (int k = 0; k < 3; ++k) (*v)[k].v = numbers[next++];
  }
  for (Dual* v : {&camera.fov, &camera.aperture_radius, &camera.focus_distance}) {
    v->v = numbers[next++];
  }
}

// What translations take along: of shapes, and of the camera.
std::vector<Vec3d*> course_points(Scene& scene, const std::vector<ShapeId>& shapes) {
  if (!scene.exposure) return {};
  Exposure& exposure = own_exposure(scene);
  std::vector<Course*> courses = {&exposure.cameras[scene.sensor]};
  for (const ShapeId s : shapes) courses.push_back(&exposure.shapes[s.index()]);
  std::vector<Vec3d*> points;
  for (Course* course : courses) {
    points.push_back(&course->center);
    for (Keyframe& key : course->keyframes) points.push_back(&key.place);
  }
  return points;
}

std::vector<double> course_numbers(const Scene& scene, const std::vector<ShapeId>& shapes) {
  Scene hull;
  hull.exposure = scene.exposure;
  hull.sensor = scene.sensor;
  std::vector<double> numbers;
  for (const Vec3d* p : course_points(hull, shapes)) {
    numbers.insert(numbers.end(), {p->x, p->y, p->z});
  }
  return numbers;
}

[[noreturn]] void refuse_state() {
  throw InputError("the state is that of another fit: of other parameters or meshes");
}

// Twice as large after each `period` steps, in whole numbers.
int grown(int count, int64_t step, int period) {
  if (period == 0) return count;
  const double factor = std::exp2(static_cast<double>(step) / period);
  return static_cast<int>(std::min(std::round(count * factor), 0x1p30));
}

// Normals of a file would stay as they are while the vertices of an array move.
void free_normals(Scene& scene, const std::string& name, std::vector<std::string>& warnings) {
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Mesh& mesh = scene.shapes[s].mesh;
    const std::string& id = scene.shapes[s].id;
    if (id + ".vertex_positions" != name && id + ".displacement" != name) continue;
    if (mesh.normal_source != NormalSource::kGiven) continue;
    warnings.push_back("\"" + scene.shapes[s].id +
                       "\" has normals of its own: they are computed from its faces instead, "
                       "so that they follow its vertices");
    set_mesh(scene, ShapeId(s), std::vector<Vec3f>(mesh.positions),
             std::vector<FaceIndices>(mesh.faces), nullptr);
  }
}

}  // namespace

Fit::Impl::Impl(std::vector<FitView> all, const FitOptions& options, const RunSettings& settings)
    : views(std::move(all)), options_(options), settings_(settings) {
  if (views.empty()) throw InputError("a fit needs a view: a scene and its target");
  if (options.parameters.empty()) throw InputError("a fit needs a parameter");
  check_options(options);
  for (FitView& view : views) {
    view.scene = deep_copy(view.scene);
    check_loss_images(view.scene, view.target, view.mask);
    const int most = most_pyramid_levels(view.scene);
    if (options.pyramid > most) {
      throw InputError(
          {view.scene.file},
          fmt::format("a pyramid of {} levels: the film has 1 to {}", options.pyramid, most));
    }
    for (const std::string& name : options.parameters) free_normals(view.scene, name, warnings);
  }
  for (const std::string& name : options.parameters) {
    for (const FitParameter& other : parameters_) {
      if (other.name() == name) throw InputError("\"" + name + "\" is given twice");
    }
    parameters_.emplace_back(name, views, options);
  }
  for (const FitBounds& bounds : options.bounds) {
    const auto& names = options.parameters;
    if (std::find(names.begin(), names.end(), bounds.parameter) != names.end()) continue;
    throw InputError("bounds of \"" + bounds.parameter + "\", which is not fitted");
  }
  check_shapes();
  check_channels();
  check_terms();
  if (is_exact()) check_exact();
  check_blur();
  keep_skies();
  if (!options.remesh.empty()) check_remeshing();
  const bool is_smoothed = std::any_of(parameters_.begin(), parameters_.end(),
                                       [](const FitParameter& p) { return p.is_array(); });
  if (options.smoothing > 1 && is_smoothed) {
    warnings.push_back(fmt::format(
        "smoothing {:g} spreads steps over more than a whole shape: it is a share of the "
        "shape's diagonal (by default {:g})",
        options.smoothing, FitOptions{}.smoothing));
  }
  // As it is before the first step; views differ in little but the camera.
  if (!over_faces()) {
    warn_of_hair_gaps(views[0].scene, settings.spp, settings.threads, warnings);
  }
  if (!is_unbiased(options.loss) && !over_faces()) warnings.push_back(bias_warning(options.loss));
}

void Fit::Impl::check_shapes() {
  for (size_t v = 0; v < views.size(); ++v) {
    for (const FitParameter& a : parameters_) {
      const ShapeId shape = a.shape(v);
      if (!a.is_array() || !shape.valid()) continue;
      for (const FitParameter& b : parameters_) {
        if (&a == &b || b.shape(v) != shape) continue;
        // Velocities leave the vertices of the reference time where they are.
        if (!b.is_array() && !b.in_view(v)->value(views[v].scene).empty()) continue;
        throw InputError({views[v].scene.file},
                         fmt::format("\"{}\" and \"{}\" move the same vertices: fit one of them",
                                     a.name(), b.name()));
      }
    }
  }
}

void Fit::Impl::check_channels() const {
  for (const FitParameter& whole : parameters_) {
    for (const FitParameter& part : parameters_) {
      for (size_t v = 0; v < views.size(); ++v) {
        if (&whole == &part || !whole.is_map()) break;
        if (!whole.moves_texels(v) || !part.moves_texels(v)) continue;
        const Scene& scene = views[v].scene;
        if (whole.in_view(v)->texel_map(scene) != part.in_view(v)->texel_map(scene)) continue;
        throw InputError({views[v].scene.file},
                         fmt::format("\"{}\" and \"{}\" move the same texels: fit one of them",
                                     whole.name(), part.name()));
      }
      if (whole.is_array() || !part.name().starts_with(whole.name() + ".")) continue;
      throw InputError(
          fmt::format("\"{}\" is a channel of \"{}\": fit one of them", part.name(), whole.name()));
    }
  }
}

// With an adjoint that is black nothing is sampled.
bool Fit::Impl::moves_on_film(size_t view) const {
  const Scene& scene = views[view].scene;
  BackwardOptions options = options_.backward;
  options.terms = {film_term().name};
  for (const FitParameter& p : parameters_) {
    if (p.in_view(view)) options.parameters.push_back(p.name());
  }
  if (options.parameters.empty()) return false;
  RunSettings own = view_settings(view);
  own.spp = 1;
  const Image black(scene.film.crop_width, scene.film.crop_height, 3);
  for (const auto& [name, count] : backward(scene, black, options, own).stats.edges) {
    if (name == "moving on the film" && count > 0) return true;
  }
  return false;
}

// Those of backward(), which would tell at the first step.
void Fit::Impl::check_terms() const {
  check_task(options_.backward.method, Task::kFit);
  const ReverseMethod& method = *options_.backward.method->reverse;
  check_points(options_.backward.points, method.closed, options_.backward.method.name());
  for (size_t v = 0; v < views.size(); ++v) {
    const auto seen = [&](const FitParameter& p) { return p.in_view(v) != nullptr; };
    if (std::none_of(parameters_.begin(), parameters_.end(), seen)) continue;
    std::vector<std::string> known;
    if (over_faces()) known.emplace_back(kFacesTerm);
    for (const TermType* type : terms_of(views[v].scene, method.sampler, method.closed)) {
      if (!over_faces()) known.emplace_back(type->name);
    }
    selected_terms(known, options_.backward.terms, views[v].scene.file);
  }
}

// What would fail after hours is reported at once.
void Fit::Impl::keep_skies() {
  for (size_t v = 0; v < views.size(); ++v) {
    const std::string& sky = views[v].scene.environment_id;
    const auto moves_sky = [&](const FitParameter& p) {
      return p.in_view(v) && !sky.empty() && p.name().starts_with(sky + ".");
    };
    kept_.emplace_back().keep_environment(std::ranges::none_of(parameters_, moves_sky));
  }
}

void Fit::Impl::check_remeshing() {
  bool any = false;
  for (const FitParameter& p : parameters_) {
    if (p.is_displacement()) {
      throw InputError(fmt::format(
          "\"{}\" moves the vertices that the shape has at first, and remeshing makes others: fit "
          "its vertex_positions, or leave out the remeshing",
          p.name()));
    }
    for (size_t v = 0; v < views.size(); ++v) {
      if (!p.is_array() || !p.shape(v).valid()) continue;
      const Shape& shape = views[v].scene.shape(p.shape(v));
      if (shape.mesh.normal_source == NormalSource::kFace) {
        throw InputError(shape.where,
                         "\"" + shape.id + "\" is shaded flat: remeshing would lose its edges");
      }
      if (shape.mesh.textured) {
        throw InputError(shape.where, "\"" + shape.id +
                                          "\" has textures: remeshing would lose their "
                                          "coordinates; leave out the one or the other");
      }
      remesh(shape.mesh, options_.remesh_edge * mean_edge_length(shape.mesh), shape.where);
      any = true;
    }
  }
  if (!any) throw InputError("there is nothing to remesh: no vertices are fitted");
}

std::vector<ShapeId> Fit::Impl::moved_shapes(size_t view) const {
  std::vector<ShapeId> shapes;
  for (uint32_t s = 0; s < views[view].scene.shapes.size(); ++s) {
    const auto moves = [&](const FitParameter& p) { return p.shape(view) == ShapeId(s); };
    if (std::any_of(parameters_.begin(), parameters_.end(), moves)) shapes.emplace_back(s);
  }
  return shapes;
}

RunSettings Fit::Impl::view_settings(size_t view) const {
  RunSettings own = settings_for(options_.backward.points, settings_);
  own.seconds = 0;
  const uint64_t step = is_exact() ? 0 : static_cast<uint64_t>(steps);
  own.seed = mix_bits(mix_bits(mix_bits(settings_.seed) + step) + view);
  own.progress = nullptr;
  return own;
}

int Fit::Impl::samples_of(int first) const {
  return over_faces() ? 1 : grown(first, steps, options_.spp_doubling);
}

bool Fit::Impl::add_view(size_t view, FitRecord& record,
                         std::vector<std::vector<double>>& gradients) {
  const FitView& v = views[view];
  const double share = 1 / static_cast<double>(views.size());
  RunSettings own = view_settings(view);
  own.spp = samples_of(options_.loss_spp > 0 ? options_.loss_spp : settings_.spp);
  const LossOptions loss_options{
      options_.loss, options_.pyramid,
      options_.blur.particles ? Method("light-traced") : loss_method(options_.backward.method),
      options_.backward.points, is_exact()};
  LossResult loss = image_loss(v.scene, v.target, loss_options, own, v.mask);
  if (loss.spp < own.spp) return false;
  record.view_losses.push_back(loss.value);
  record.loss += share * loss.value;
  record.error = std::hypot(record.error, share * loss.error);
  for (float& a : loss.adjoint.data) a = static_cast<float>(a * share);
  BackwardOptions backward_options = options_.backward;
  // Nobody asks for standard errors, and each batch ends with the adjoint of normals.
  backward_options.batches = 1;
  backward_options.find_gaps = false;  // reported before the first step
  if (is_exact()) backward_options.uniform_pixels = true;
  // Those of the fit: displacements are along the normals of its start.
  backward_options.found.clear();
  for (const FitParameter& p : parameters_) {
    if (p.in_view(view)) backward_options.found.push_back(*p.in_view(view));
  }
  if (backward_options.found.empty()) return true;
  own.spp = samples_of(settings_.spp);
  if (settings_.progress) {
    // The two images take about a third of the time.
    own.progress = [&](double done) {
      settings_.progress(share * (static_cast<double>(view) + (1 + 2 * done) / 3));
    };
  }
  if (blur().sigma > 0) return add_blurred(view, loss.adjoint, own, gradients);
  const BackwardResult result = backward(v.scene, loss.adjoint, backward_options, own, kept_[view]);
  if (result.non_finite.count > 0) throw InputError("gradient: " + result.non_finite.message());
  if (result.spp < own.spp) return false;
  for (size_t i = 0; i < parameters_.size(); ++i) {
    if (!parameters_[i].in_view(view)) continue;
    const Moments& m = result.of(parameters_[i].name()).moments;
    gradients[i].resize(m.size());
    for (size_t k = 0; k < m.size(); ++k) gradients[i][k] += m.mean(k);
  }
  return true;
}

bool Fit::Impl::evaluate(FitRecord& record, std::vector<std::vector<double>>& gradients) {
  gradients.assign(parameters_.size(), {});
  for (size_t v = 0; v < views.size(); ++v) {
    if (!add_view(v, record, gradients)) return false;
  }
  return true;
}

std::optional<FitRecord> Fit::Impl::step() {
  if (is_exact()) return quasi_newton_step();
  const Stopwatch watch;
  FitRecord record;
  record.step = steps;
  record.sigma = blur().sigma;
  record.step_size = options_.step;
  if (options_.step_half_life > 0) {
    record.step_size *= std::exp2(-static_cast<double>(steps) / options_.step_half_life);
  }
  record.step_size *= shrunk();
  std::vector<std::vector<double>> gradients;
  if (!evaluate(record, gradients)) return std::nullopt;
  for (size_t i = 0; i < parameters_.size(); ++i) {
    record.halvings = std::max(record.halvings,
                               parameters_[i].move(gradients[i], record.step_size, steps, views));
  }
  finish_step(record);
  record.seconds = watch.seconds();
  return record;
}

void Fit::Impl::finish_step(FitRecord& record) {
  ++steps;
  if (std::find(options_.remesh.begin(), options_.remesh.end(), steps) != options_.remesh.end()) {
    for (FitParameter& p : parameters_) {
      if (!p.is_array()) continue;
      p.remesh(options_.remesh_edge, options_.smoothing * shrunk(), views);
      record.remeshed = true;
    }
  }
  for (const FitScalar& scalar : scalars()) record.values.push_back(scalar.value);
}

std::vector<FitScalar> Fit::Impl::scalars() const {
  std::vector<FitScalar> list;
  for (const FitParameter& p : parameters_) {
    for (const FitScalar& scalar : p.scalars(views)) list.push_back(scalar);
  }
  return list;
}

std::vector<const TexelMap*> Fit::Impl::texel_maps(size_t view) const {
  std::vector<const TexelMap*> maps;
  for (const FitParameter& p : parameters_) {
    if (p.is_map() || !p.moves_texels(view)) continue;
    const TexelMap* map = p.in_view(view)->texel_map(views[view].scene);
    if (std::find(maps.begin(), maps.end(), map) == maps.end()) maps.push_back(map);
  }
  return maps;
}

std::vector<double> Fit::Impl::values_in(size_t view, const FitParameter& parameter) const {
  if (parameter.is_array() || !parameter.in_view(view)) return {};
  return parameter.in_view(view)->value(views[view].scene);
}

FitState Fit::Impl::state() const {
  FitState state;
  state.steps = steps;
  state.moves = quasi_newton_.steps;
  state.changes = quasi_newton_.changes;
  for (const FitParameter& p : parameters_) state.parameters.push_back(p.state());
  for (size_t v = 0; v < views.size(); ++v) {
    const Scene& scene = views[v].scene;
    FitState::View view{camera_numbers(scene.camera),           {}, {}, {},
                        course_numbers(scene, moved_shapes(v)), {}};
    for (const ShapeId s : moved_shapes(v)) {
      const Mesh& mesh = scene.shape(s).mesh;
      view.shapes.push_back({std::vector<Vec3f>(mesh.positions), std::vector<Vec3d>(mesh.normals),
                             std::vector<FaceIndices>(mesh.faces)});
      view.pivots.emplace_back();
      if (const std::optional<Pivot>& p = scene.shape(s).pivot) {
        view.pivots.back() = {p->center.x, p->center.y, p->center.z, p->size};
      }
    }
    for (const FitParameter& p : parameters_) view.values.push_back(values_in(v, p));
    for (const TexelMap* map : texel_maps(v)) {
      const std::vector<float> texels = map->texels().data;
      view.texels.insert(view.texels.end(), texels.begin(), texels.end());
    }
    state.views.push_back(std::move(view));
  }
  return state;
}

// Displacements are of the vertices that there were at the start.
bool Fit::Impl::may_remesh(size_t view, ShapeId shape) const {
  return std::any_of(parameters_.begin(), parameters_.end(), [&](const FitParameter& p) {
    return p.shape(view) == shape && p.is_array() && !p.is_displacement();
  });
}

void Fit::Impl::check_state(const FitState& state) const {
  const auto check = [](bool good) {
    if (!good) refuse_state();
  };
  check(state.steps >= 0 && state.parameters.size() == parameters_.size() &&
        state.views.size() == views.size());
  size_t numbers = 0;
  for (const FitState::Numbers& p : state.parameters) numbers += p.values.size();
  check(state.moves.size() == state.changes.size());
  for (const auto* list : {&state.moves, &state.changes}) {
    for (const std::vector<double>& x : *list) check(x.size() == numbers);
  }
  for (size_t v = 0; v < views.size(); ++v) {
    const FitState::View& view = state.views[v];
    const std::vector<ShapeId> shapes = moved_shapes(v);
    check(view.camera.size() == 15 && view.shapes.size() == shapes.size() &&
          view.pivots.size() == shapes.size() && view.values.size() == parameters_.size());
    for (const auto& pivot : view.pivots)
      check(pivot.empty() || (pivot.size() == 4 && pivot[3] != 0));
    check(view.courses.size() == course_numbers(views[v].scene, shapes).size());
    for (size_t i = 0; i < parameters_.size(); ++i) {
      check(view.values[i].size() == values_in(v, parameters_[i]).size());
    }
    for (size_t i = 0; i < shapes.size(); ++i) {
      const FitState::Shape& shape = view.shapes[i];
      const Mesh& mesh = views[v].scene.shape(shapes[i]).mesh;
      if (shape.faces != mesh.faces) {  // it gets new triangles
        check(may_remesh(v, shapes[i]));
        continue;
      }
      check(shape.positions.size() == mesh.positions.size() &&
            shape.normals.size() == mesh.normals.size());
    }
    size_t texels = 0;
    for (const TexelMap* map : texel_maps(v)) texels += map->texels().data.size();
    check(view.texels.size() == texels);
  }
}

void Fit::Impl::restore(const FitState& state) {
  check_state(state);
  const FitState before = this->state();
  try {
    put(state);
  } catch (...) {  // a mesh or a value that cannot be
    put(before);
    throw;
  }
}

void Fit::Impl::put(const FitState& state) {
  std::vector<bool> remeshed(parameters_.size());
  for (size_t v = 0; v < views.size(); ++v) {
    Scene& scene = views[v].scene;
    const FitState::View& view = state.views[v];
    const std::vector<ShapeId> shapes = moved_shapes(v);
    for (size_t i = 0; i < shapes.size(); ++i) {
      const FitState::Shape& shape = view.shapes[i];
      Mesh& mesh = scene.shapes[shapes[i].index()].mesh;
      if (shape.faces != mesh.faces) {
        set_mesh(scene, shapes[i], shape.positions, shape.faces, nullptr);
        for (size_t k = 0; k < parameters_.size(); ++k) {
          if (parameters_[k].shape(v) == shapes[i]) remeshed[k] = true;
        }
        if (shape.normals.size() != mesh.normals.size()) refuse_state();
      }
      mesh.positions = shape.positions;
      mesh.normals = shape.normals;
      update_shading_normals(mesh);
      std::optional<Pivot>& pivot = scene.shapes[shapes[i].index()].pivot;
      pivot.reset();
      if (const std::vector<double>& p = view.pivots[i]; !p.empty()) {
        pivot = {{p[0], p[1], p[2]}, p[3]};
      }
    }
    for (size_t i = 0; i < parameters_.size(); ++i) {
      if (!view.values[i].empty()) parameters_[i].in_view(v)->assign(scene, view.values[i]);
    }
    auto next = view.texels.begin();
    for (const TexelMap* of : texel_maps(v)) {
      auto* map = const_cast<TexelMap*>(of);  // the views are this object's own
      Image texels = map->texels();
      const auto end = next + static_cast<std::ptrdiff_t>(texels.data.size());
      texels.data.assign(next, end);
      map->set_texels(texels);
      next = end;
    }
    set_camera(scene.camera, view.camera);
    const double* number = view.courses.data();
    for (Vec3d* p : course_points(scene, shapes)) {
      for (int k = 0; k < 3; ++k) (*p)[k] = *number++;
    }
  }
  for (size_t i = 0; i < parameters_.size(); ++i) {
    parameters_[i].restore(state.parameters[i], views, remeshed[i]);
  }
  quasi_newton_.steps = state.moves;
  quasi_newton_.changes = state.changes;
  here_.reset();
  steps = state.steps;
}

Fit::Fit(std::vector<FitView> views, const FitOptions& options, const RunSettings& settings)
    : impl_(std::make_unique<Impl>(std::move(views), options, settings)) {}
Fit::~Fit() = default;
Fit::Fit(Fit&&) noexcept = default;

void Fit::listen(const std::function<void(double)>& progress,
                 const std::atomic<bool>* interrupted) {
  impl_->listen(progress, interrupted);
}
std::optional<FitRecord> Fit::step() { return impl_->step(); }
int64_t Fit::steps() const { return impl_->steps; }
const std::vector<FitView>& Fit::views() const { return impl_->views; }
std::vector<FitScalar> Fit::scalars() const { return impl_->scalars(); }
const std::vector<std::string>& Fit::warnings() const { return impl_->warnings; }
FitState Fit::state() const { return impl_->state(); }
void Fit::restore(const FitState& state) { impl_->restore(state); }

}  // namespace limn
