// Fits: parameters of scenes from target images.
#include "limn/integrators/fit.h"

#include <fmt/format.h>
#include <nanobind/stl/map.h>

#include <map>

#include "limn/core/error.h"
#include "limn/core/parallel.h"
#include "limn/integrators/mesh_distance.h"
#include "tools/python/arguments.h"

namespace limn::python {

namespace {

constexpr const char* kTargetType =
    "numpy.typing.ArrayLike | collections.abc.Sequence[numpy.typing.ArrayLike]";

struct FitHandle {
  Fit fit;
  std::vector<FitRecord> history;
  std::vector<History> histories;  // SceneHandle's, of each view at the start
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

struct FitCall {
  const SceneHandle* scene = nullptr;
  nb::object target, mask = nb::none(), first;
  Names names;
  nb::object views = nb::make_tuple();
  std::map<std::string, std::pair<double, double>> bounds;
  FitOptions options;
  RunRequest request;

  void take(Arguments& a) {
    add_scene(a, scene);
    a.add("target", kTargetType, "", target,
          "(H, W, 3) or (H, W); of a scene with several sensors a list, one for each.");
    a.add("names", kNamesType, "", names, "scalars and arrays, as \"object.vertex_positions\".");
    a.add("mask", kArrayOrNoneType, "None", mask, "weights of the pixels, (H, W).");
    a.add("views", "collections.abc.Sequence[tuple[object, ...]]", "()", views,
          "further (scene, target) or (scene, target, mask) that share the parameters.");
    a.end_positional();
    a.add("bounds", "collections.abc.Mapping[str, tuple[float, float]]", "{}", bounds,
          "{name: (least, most)} that scalars and texels may not leave.");
    visit_options(request, all_but({"seconds"}, a));
    visit_options(options, a);
    a.add_former("sampler", "method");
  }

  // A list of images, or an array of them: each is the target of a sensor, the first of `scene`.
  void spread_targets() {
    const bool stacked =
        nb::hasattr(target, "shape") && nb::len(nb::object(target.attr("shape"))) == 4;
    if (!stacked && !nb::isinstance<nb::list>(target) && !nb::isinstance<nb::tuple>(target)) return;
    const nb::list images(target);
    for (nb::handle image : images) {
      if (!nb::hasattr(image, "shape")) return;
      const nb::object shape = image.attr("shape");
      if (nb::len(nb::handle(shape)) != 3) return;
    }
    const size_t sensors = scene->get().sensors.size();
    if (images.size() != sensors) {
      throw InputError(fmt::format("target: {} images for {} sensors", images.size(), sensors));
    }
    const nb::object whole = nb::cast(*scene);
    nb::list all;
    for (size_t i = 1; i < sensors; ++i) {
      all.append(nb::make_tuple(whole.attr("view")(i), images[i]));
    }
    all.extend(views);
    views = all;
    target = images[0];
    first = whole.attr("view")(0);
    scene = &nb::cast<const SceneHandle&>(first);
  }

  // SceneHandle's, of each view.
  std::vector<History> histories() const {
    std::vector<History> all{scene->history};
    for (nb::handle view : views) all.push_back(nb::cast<const SceneHandle&>(view[0]).history);
    return all;
  }

  Fit make(const Arguments& given) {
    given.refuse_samples(options.backward.points, {"spp"});
    spread_targets();
    const Scene& seen = scene->get();
    if (seen.sensors.size() > 1 && !scene->history.sensor_chosen && nb::len(views) == 0) {
      warn_all(
          {fmt::format("the target is that of the first of {} sensors, the others take no part: "
                       "give a list of targets, one for each",
                       seen.sensors.size())});
    }
    for (const auto& [name, range] : bounds) {
      options.bounds.push_back({name, range.first, range.second});
    }
    options.parameters = to_list(names);
    Fit fit(to_views(*scene, target, mask, nb::cast<nb::sequence>(views)), options,
            settings_of(request, scene->get()));
    warn_all(fit.warnings());
    return fit;
  }
};

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

nb::list scenes_of(const FitHandle& h) {
  h.check_idle();
  nb::list scenes;
  for (size_t i = 0; i < h.fit.views().size(); ++i) {
    SceneHandle scene(deep_copy(h.fit.views()[i].scene));
    scene.history = h.histories[i];
    for (const FitScalar& s : h.fit.scalars()) {
      if (is_translation(s.parameter)) scene.history.moved[s.parameter] += s.value;
    }
    scenes.append(nb::cast(std::move(scene)));
  }
  return scenes;
}

nb::dict values_of(const FitHandle& h) {
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
      .def_ro("sigma", &FitRecord::sigma, "Of the blurred faces of its gradient; 0: it was exact.")
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
  FitCall example;
  Arguments arguments("Fit");
  example.take(arguments);
  nb::class_<FitHandle>(m, "Fit", "Parameters of scenes, moved until images meet their targets.")
      .def(
          "__init__",
          [](FitHandle* self, const nb::args& positional, const nb::kwargs& named) {
            FitCall call;
            Arguments given("Fit");
            call.take(given);
            given.read(positional, named);
            Fit fit = call.make(given);
            new (self) FitHandle{std::move(fit), {}, call.histories(), false};
          },
          nb::sig(arguments.method_signature("__init__", "None").c_str()),
          ("Copies the scene; it stays as it is.\n\n" + arguments.documentation()).c_str())
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
      .def_prop_ro("scenes", &scenes_of, nb::sig("def scenes(self) -> list[Scene]"),
                   "Copies of the scenes as they are now, the first one first.")
      .def_prop_ro(
          "values", &values_of, nb::sig("def values(self) -> dict[str, float | numpy.ndarray]"),
          "What is fitted, but for arrays (vertices, texels: see scenes): numbers, colours (3,), "
          "and for "
          "motions the sum of all steps.");
}

}  // namespace limn::python
