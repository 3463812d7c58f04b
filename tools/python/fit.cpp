// Fits: parameters of scenes from target images.
#include "limn/integrators/fit.h"

#include <fmt/format.h>
#include <nanobind/stl/map.h>

#include <map>

#include "limn/core/error.h"
#include "limn/core/parallel.h"
#include "limn/integrators/mesh_distance.h"
#include "tools/python/bindings.h"

namespace limn::python {

namespace {

struct FitHandle {
  Fit fit;
  std::vector<FitRecord> history;
  bool busy = false;  // with a step, which lets others have the GIL; used with the GIL held

  // InputError during a step.
  void check_idle() const {
    if (busy) throw InputError("a step is under way: wait for its end");
  }
};

FitView to_view(const SceneHandle& scene, nb::handle target, nb::handle mask) {
  FitView view{scene.get(), to_image(target), {}};
  if (!mask.is_none()) view.mask = to_image(mask);
  return view;
}

std::vector<FitView> to_views(const SceneHandle& scene, nb::handle target, nb::handle mask,
                              const nb::sequence& more) {
  std::vector<FitView> views{to_view(scene, target, mask)};
  for (nb::handle item : more) {
    const std::string place = fmt::format("views[{}]", views.size() - 1);
    const nb::tuple view = nb::isinstance<nb::sequence>(item) ? nb::tuple(item) : nb::tuple();
    if (view.size() < 2 || view.size() > 3 || !nb::isinstance<SceneHandle>(view[0])) {
      throw InputError({place}, "expected (scene, target) or (scene, target, mask)");
    }
    views.push_back(to_view(nb::cast<const SceneHandle&>(view[0]), view[1],
                            view.size() == 3 ? nb::object(view[2]) : nb::none()));
    const FitView& made = views.back();
    check_loss_images(made.scene, made.target, made.mask, place, place);
  }
  return views;
}

// One step on a thread of its own; Ctrl-C leaves what was done: if it came too late, the step.
FitRecord step(FitHandle& handle, const nb::object& progress) {
  handle.check_idle();
  handle.busy = true;
  std::optional<FitRecord> record;
  const auto end = [&] {
    handle.fit.listen(nullptr, nullptr);
    if (record) handle.history.push_back(*record);
    handle.busy = false;
  };
  try {
    run_job({}, progress, [&](const RunSettings& settings) {
      handle.fit.listen(settings.progress, settings.interrupted);
      record = handle.fit.step();
    });
  } catch (...) {
    end();
    throw;
  }
  end();
  return record.value();
}

void run(FitHandle& handle, int steps, const nb::object& callback) {
  if (steps < 0) throw InputError("steps must not be negative");
  for (int i = 0; i < steps; ++i) {
    const FitRecord record = step(handle, nb::none());
    if (!callback.is_none()) callback(record);
    if (record.at_rest) return;
  }
}

void bind_record(nb::module_& m) {
  nb::class_<FitRecord>(m, "FitRecord", "One step of a fit.")
      .def_ro("step", &FitRecord::step, "Counted from 0.")
      .def_ro("loss", &FitRecord::loss,
              "Before the step, a mean over views; unbiased, so it may be below zero.")
      .def_ro("stderr", &FitRecord::error, "Of the loss; NaN with one sample per pixel.")
      .def_ro("view_losses", &FitRecord::view_losses)
      .def_ro("step_size", &FitRecord::step_size, "In natural steps.")
      .def_ro("halvings", &FitRecord::halvings,
              "How often the step was halved, so that no face lost its area.")
      .def_ro("remeshed", &FitRecord::remeshed)
      .def_ro("evaluations", &FitRecord::evaluations, "Losses and gradients that the step took.")
      .def_ro(
          "at_rest", &FitRecord::at_rest,
          "Of lbfgs: no lower loss was found, nothing was moved, and no remeshing is left. Where "
          "one is, the fit goes on to it at once, and steps with it.")
      .def_ro("seconds", &FitRecord::seconds)
      .def("__repr__", [](const FitRecord& r) {
        return fmt::format("<limn.FitRecord: step {}, loss {:.4g} +- {:.2g}>", r.step, r.loss,
                           r.error);
      });
}

void bind_distance(nb::module_& m) {
  m.def(
      "mesh_distance",
      [](nb::handle positions, nb::handle faces, nb::handle true_positions, nb::handle true_faces,
         int64_t samples, uint64_t seed) {
        if (samples < 1) throw InputError("samples must be 1 or more");
        const auto mesh = [](nb::handle p, nb::handle f, const char* what) {
          return make_mesh(to_positions(p), to_faces(f), true, {what}, nullptr);
        };
        const Mesh a = mesh(positions, faces, "mesh");
        const Mesh b = mesh(true_positions, true_faces, "truth");
        const MeshDistance d =
            mesh_distance(a, b, static_cast<size_t>(samples), seed, thread_count(0));
        nb::dict all;
        all["chamfer"] = d.chamfer;
        all["hausdorff"] = d.hausdorff;
        all["hausdorff_95"] = d.hausdorff_95;
        all["normal_angle"] = d.normal_angle;
        return all;
      },
      nb::arg("positions"), nb::arg("faces"), nb::arg("true_positions"), nb::arg("true_faces"),
      nb::arg("samples") = 10000, nb::arg("seed") = 0,
      nb::sig("def mesh_distance(positions: numpy.typing.ArrayLike, faces: numpy.typing.ArrayLike, "
              "true_positions: numpy.typing.ArrayLike, true_faces: numpy.typing.ArrayLike, "
              "samples: int = 10000, seed: int = 0) -> dict[str, float]"),
      "How far two surfaces are apart, by points spread evenly over either.\n\n"
      "chamfer: mean distance to the other surface [scene units], of both directions; "
      "hausdorff_95: what 95 % of the points do not exceed, hausdorff: the largest, of the larger "
      "direction each; normal_angle: mean angle between the faces' normals there [radians].");
}

}  // namespace

void bind_fit(nb::module_& m) {
  bind_record(m);
  bind_distance(m);
  nb::class_<FitHandle>(m, "Fit", "Parameters of scenes, moved until images meet their targets.")
      .def(
          "__init__",
          [](FitHandle* self, const SceneHandle& scene, nb::handle target, const Names& names,
             nb::handle mask, const nb::sequence& views, const std::string& loss,
             const std::string& optimiser, double step, int step_half_life, double smoothing,
             std::optional<int> spp, int loss_spp, const std::vector<int64_t>& remesh,
             const std::vector<std::string>& terms, std::optional<uint64_t> seed, int threads,
             int pyramid, int spp_doubling, double remesh_edge, double remesh_shrink,
             const std::map<std::string, std::pair<double, double>>& bounds,
             const std::string& method, bool uniform_pixels, int edge_samples,
             double camera_samples, double shadow_samples, const std::string& points,
             const nb::object& sampler) {
            refuse_sampler(sampler, "method");
            FitOptions options;
            for (const auto& [name, range] : bounds) {
              options.bounds.push_back({name, range.first, range.second});
            }
            options.backward.method = to_method(method, Task::kFit);
            options.backward.uniform_pixels = uniform_pixels;
            options.backward.edge_samples = edge_samples;
            options.backward.camera_samples = camera_samples;
            options.backward.shadow_samples = shadow_samples;
            options.backward.points = to_points(points, options.backward,
                                                {{"spp", spp.has_value()},
                                                 {"loss_spp", loss_spp != 0},
                                                 {"spp_doubling", spp_doubling != 0}});
            options.parameters = to_list(names);
            options.loss = loss_kind(loss);
            options.optimiser = optimiser_kind(optimiser);
            options.step = step;
            options.step_half_life = step_half_life;
            options.smoothing = smoothing;
            options.loss_spp = loss_spp;
            options.remesh = remesh;
            options.remesh_edge = remesh_edge;
            options.remesh_shrink = remesh_shrink;
            options.pyramid = pyramid;
            options.spp_doubling = spp_doubling;
            options.backward.terms = terms;
            if (step_half_life < 0 || loss_spp < 0 || spp_doubling < 0) {
              throw InputError("step_half_life, spp_doubling and loss_spp must not be negative");
            }
            const RunSettings settings = make_settings(scene.get(), {spp, seed, 0, threads});
            Fit fit(to_views(scene, target, mask, views), options, settings);
            warn_all(fit.warnings());
            new (self) FitHandle{std::move(fit), {}, false};
          },
          nb::arg("scene"), nb::arg("target"), nb::arg("names"), nb::arg("mask") = nb::none(),
          nb::arg("views") = nb::make_tuple(), nb::arg("loss") = "l2",
          nb::arg("optimiser") = "adam-uniform", nb::arg("step") = 1.0,
          nb::arg("step_half_life") = 0, nb::arg("smoothing") = 0.08, nb::arg("spp") = nb::none(),
          nb::arg("loss_spp") = 0, nb::arg("remesh") = nb::make_tuple(),
          nb::arg("terms") = nb::make_tuple(), nb::arg("seed") = nb::none(), nb::arg("threads") = 0,
          nb::arg("pyramid") = 1, nb::arg("spp_doubling") = 0, nb::arg("remesh_edge") = 0.75,
          nb::arg("remesh_shrink") = 0.65, nb::arg("bounds") = nb::dict(),
          nb::arg("method") = Method(Task::kFit).name(), nb::arg("uniform_pixels") = false,
          nb::arg("edge_samples") = 1, nb::arg("camera_samples") = BackwardOptions{}.camera_samples,
          nb::arg("shadow_samples") = BackwardOptions{}.shadow_samples,
          nb::arg("points") = "random", nb::arg("sampler") = nb::none(),
          nb::sig(
              "def __init__(self, scene: Scene, target: numpy.typing.ArrayLike, names: str | "
              "collections.abc.Sequence[str], mask: numpy.typing.ArrayLike | None = None, "
              "views: collections.abc.Sequence[tuple[object, ...]] = (), loss: str = 'l2', "
              "optimiser: str = "
              "'adam-uniform', step: float = 1, step_half_life: int = 0, smoothing: float = "
              "0.08, spp: int | None = None, loss_spp: int = 0, remesh: "
              "collections.abc.Sequence[int] = (), terms: collections.abc.Sequence[str] = (), "
              "seed: int | None = None, threads: int = 0, pyramid: int = 1, spp_doubling: int = "
              "0, remesh_edge: float = 0.75, remesh_shrink: float = 0.65, bounds: "
              "collections.abc.Mapping[str, tuple[float, float]] = {}, method: str = 'forest', "
              "uniform_pixels: bool = False, edge_samples: int = 1, camera_samples: float = 0, "
              "shadow_samples: float = 1, points: str = 'random') -> None"),
          "Copies the scene; it stays as it is.\n\n"
          "target: (H, W, 3) or (H, W). names: scalars and arrays "
          "(\"object.vertex_positions\").\n"
          "mask: weights of the pixels, (H, W). views: further (scene, target) or (scene, target, "
          "mask) that share the parameters.\n"
          "loss: \"l2\", \"relative-l2\", \"l1\", over `pyramid` levels, see image_loss. "
          "optimiser: \"adam-uniform\", \"adam\", "
          "\"gradient-descent\", or with the method \"analytic\" \"lbfgs\", which takes the loss "
          "as "
          "a function without noise.\n"
          "step: in natural steps (1 % of a shape's diagonal, 0.01 radians, 1 % of a value), half "
          "as long after each step_half_life steps (0: never).\n"
          "smoothing: how far a step of a vertex spreads, over the shape's diagonal.\n"
          "spp: samples per pixel of the gradient, and of each of the loss's two images unless "
          "loss_spp says otherwise; twice as many after each spp_doubling steps (0: never).\n"
          "remesh: steps after which vertices get new triangles, with edges remesh_edge times as "
          "long, steps and smoothing remesh_shrink times what they were.\n"
          "bounds: {name: (least, most)} that scalars may not leave. method, uniform_pixels, "
          "edge_samples, camera_samples, shadow_samples: of the gradient, see limn.backward.\n"
          "points: \"faces\", with the method analytic: losses and gradients of images made of "
          "their "
          "visible faces, without samples; lbfgs gets farthest with them.")
      .def("step", &step, nb::arg("progress") = nb::none(),
           nb::sig("def step(self, progress: collections.abc.Callable[[float], object] | None = "
                   "None) -> FitRecord"),
           "One step; Ctrl-C leaves the fit as it was before, or in a step's last moments as it is "
           "after it, with the step in `history`. Meanwhile other threads may not use the fit.")
      .def("run", &run, nb::arg("steps"), nb::arg("callback") = nb::none(),
           nb::sig("def run(self, steps: int, callback: collections.abc.Callable[[FitRecord], "
                   "object] | None = None) -> None"),
           "Several steps; callback(record) after each.")
      .def("__repr__",
           [](const FitHandle& handle) {
             const std::vector<FitRecord>& done = handle.history;
             if (done.empty()) return std::string("<limn.Fit: no steps>");
             return fmt::format("<limn.Fit: {} step{}, loss {:.4g} +- {:.2g}>", done.size(),
                                done.size() == 1 ? "" : "s", done.back().loss, done.back().error);
           })
      .def_ro("history", &FitHandle::history, "A FitRecord for each step that was done.")
      .def_prop_ro(
          "scenes",
          [](const FitHandle& h) {
            h.check_idle();
            nb::list scenes;
            for (const FitView& view : h.fit.views()) {
              scenes.append(nb::cast(SceneHandle(deep_copy(view.scene))));
            }
            return scenes;
          },
          nb::sig("def scenes(self) -> list[Scene]"),
          "Copies of the scenes as they are now, the first one first.")
      .def_prop_ro(
          "values",
          [](const FitHandle& h) {
            h.check_idle();
            std::map<std::string, std::vector<double>> numbers;
            for (const FitScalar& s : h.fit.scalars()) numbers[s.parameter].push_back(s.value);
            nb::dict values;
            for (const FitScalar& s : h.fit.scalars()) {
              const std::vector<double>& all = numbers[s.parameter];
              values[nb::cast(s.parameter)] =
                  all.size() == 1 ? nb::cast(all[0]) : as_array(nb::cast(all), "float64");
            }
            return values;
          },
          nb::sig("def values(self) -> dict[str, float | numpy.ndarray]"),
          "What is fitted, but for arrays (vertices, texels: see scenes): numbers, colours (3,), "
          "and for "
          "motions the sum of all steps.");
}

}  // namespace limn::python
