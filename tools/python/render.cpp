// Estimates, and images of scenes.
#include "limn/integrators/render.h"

#include <fmt/format.h>

#include "limn/core/error.h"
#include "limn/core/names.h"
#include "tools/python/bindings.h"

namespace limn::python {

Estimate to_estimate(const Moments& moments, const Film& film, int64_t spp, double seconds) {
  return {Array(to_array(mean_image(moments, film.crop_width, film.crop_height))),
          Array(to_array(standard_error_image(moments, film.crop_width, film.crop_height))),
          spp,
          seconds,
          {}};
}

bool is_exact(const std::string& film) {
  if (film != "rays" && film != "exact") {
    throw InputError(unknown_name("film", film, {"exact", "rays"}));
  }
  return film == "exact";
}

namespace {

// numpy's protocol: the values themselves unless another type or a copy is asked for.
nb::object to_numpy(const Estimate& e, const nb::object& dtype, const nb::object& copy) {
  nb::object value = nb::cast(e.value);
  if (!dtype.is_none()) value = value.attr("astype")(dtype, nb::arg("copy") = false);
  return copy.is_none() || !nb::cast<bool>(copy) ? value : value.attr("copy")();
}

void show(const std::string& what, std::shared_ptr<const Scene>& scene, RenderOptions& options) {
  if (what == "ao") {
    options.what = RenderWhat::kAmbientOcclusion;
  } else if (what == "openness") {
    options.what = RenderWhat::kOpenness;
  } else if (what == "direct") {
    auto direct = std::make_shared<Scene>(*scene);
    direct->max_depth = 2;
    scene = std::move(direct);
  } else if (what != "image") {
    throw InputError(unknown_name("what", what, {"image", "direct", "ao", "openness"}));
  }
}

Estimate render_scene(const SceneHandle& handle, std::optional<int> spp,
                      std::optional<uint64_t> seed, int threads, const nb::object& progress,
                      const std::string& method, const std::string& film,
                      const std::string& generator, const std::string& what, int lines,
                      double tolerance, int rays, const std::string& points, BatchStore* store,
                      const nb::object& sampler) {
  refuse_sampler(sampler, "generator: \"sobol\" or \"independent\"");
  RenderOptions options;
  options.points = to_points(
      points, {{"spp", spp.has_value()}, {"generator", generator != RenderOptions().generator}});
  options.method = to_method(method, Task::kImage);
  options.exact_film = is_exact(film);
  options.generator = generator;
  options.lines = lines;
  options.tolerance = tolerance;
  options.rays = rays;
  auto scene = handle.share();
  show(what, scene, options);
  RenderResult result;
  run_job(make_settings(*scene, {spp, seed, 0, threads, store}), progress,
          [&](const RunSettings& settings) { result = render(*scene, settings, options); });
  Estimate image = to_estimate(result.radiance, scene->film, result.spp, result.seconds);
  image.warnings = result.warnings;
  warn_all(result.warnings);
  check_finite(result.non_finite, nb::cast(image));
  return image;
}

// What arrays do, done to the value: an Estimate may stand wherever its mean is meant.
struct Operator {
  const char *name, *signature;
};
#define BINARY(name) \
  { name, "def " name "(self, other: numpy.typing.ArrayLike) -> numpy.ndarray" }
constexpr Operator kBinary[] = {BINARY("__add__"),  BINARY("__radd__"),    BINARY("__sub__"),
                                BINARY("__rsub__"), BINARY("__mul__"),     BINARY("__rmul__"),
                                BINARY("__pow__"),  BINARY("__truediv__"), BINARY("__rtruediv__"),
                                BINARY("__lt__"),   BINARY("__le__"),      BINARY("__gt__"),
                                BINARY("__ge__")};
#undef BINARY
constexpr Operator kUnary[] = {{"__neg__", "def __neg__(self) -> numpy.ndarray"},
                               {"__abs__", "def __abs__(self) -> numpy.ndarray"},
                               {"__bool__", "def __bool__(self) -> bool"},
                               {"__float__", "def __float__(self) -> float"},
                               {"__len__", "def __len__(self) -> int"}};

void bind_operators(nb::class_<Estimate>& estimate) {
  for (const Operator& op : kBinary) {
    estimate.def(
        op.name,
        [name = op.name](const Estimate& e, const nb::object& other) {
          return nb::cast(e.value).attr(name)(other);
        },
        nb::arg("other"), nb::sig(op.signature));
  }
  for (const Operator& op : kUnary) {
    estimate.def(
        op.name, [name = op.name](const Estimate& e) { return nb::cast(e.value).attr(name)(); },
        nb::sig(op.signature));
  }
  estimate
      .def(
          "__getitem__",
          [](const Estimate& e, const nb::object& key) {
            return nb::object(nb::cast(e.value)[key]);
          },
          nb::arg("key"), nb::sig("def __getitem__(self, key: object) -> numpy.ndarray"))
      .def_prop_ro(
          "shape", [](const Estimate& e) { return nb::cast(e.value).attr("shape"); },
          nb::sig("def shape(self) -> tuple[int, ...]"), "That of the value.")
      .def_prop_ro(
          "dtype", [](const Estimate& e) { return nb::cast(e.value).attr("dtype"); },
          nb::sig("def dtype(self) -> numpy.dtype"), "That of the value.");
}

}  // namespace

void bind_render(nb::module_& m) {
  nb::class_<Estimate> estimate(
      m, "Estimate",
      "A mean over samples with its standard error. It computes like its value, and "
      "numpy takes it for that.");
  bind_operators(estimate);
  estimate
      .def_prop_ro(
          "value", [](const Estimate& e) { return e.value; }, nb::rv_policy::reference,
          nb::sig("def value(self) -> numpy.ndarray"),
          "The mean: float32, (H, W, 3), row 0 on top, of an image; float64 of parameters.")
      .def_prop_ro(
          "stderr", [](const Estimate& e) { return e.error; }, nb::rv_policy::reference,
          nb::sig("def stderr(self) -> numpy.ndarray"),
          "Its standard error, of the same shape; NaN with fewer than two batches (spp = 1).")
      .def_ro("spp", &Estimate::spp, "Samples per pixel that were made.")
      .def_ro("seconds", &Estimate::seconds, "Seconds that the run took, set-up included.")
      .def_prop_ro(
          "warnings", [](const Estimate& e) { return e.warnings; },
          "What the run had to say; Python's warnings told it, too.")
      .def("__array__", to_numpy, nb::arg("dtype") = nb::none(), nb::arg("copy") = nb::none(),
           nb::sig("def __array__(self, dtype: object = None, copy: bool | None = None) -> "
                   "numpy.ndarray"))
      .def("__repr__", [](const Estimate& e) {
        std::string shape;
        if (e.value.ndim() == 0) {
          return fmt::format("<limn.Estimate: {:.6g} +- {:.2g}, {} spp, {:.3g} s>",
                             *static_cast<const double*>(e.value.data()),
                             *static_cast<const double*>(e.error.data()), e.spp, e.seconds);
        }
        for (size_t k = 0; k < e.value.ndim(); ++k) {
          shape += fmt::format("{}{}", k > 0 ? ", " : "", e.value.shape(k));
        }
        return fmt::format("<limn.Estimate: ({}), {} spp, {:.3g} s>", shape, e.spp, e.seconds);
      });
  m.def(
      "render", render_scene, nb::arg("scene"), nb::arg("spp") = nb::none(),
      nb::arg("seed") = nb::none(), nb::arg("threads") = 0, nb::arg("progress") = nb::none(),
      nb::arg("method") = "path", nb::arg("film") = "rays",
      nb::arg("generator") = RenderOptions().generator, nb::arg("what") = "image",
      nb::arg("lines") = 64, nb::arg("tolerance") = 0.0, nb::arg("rays") = 4,
      nb::arg("points") = "random", nb::arg("_store").none() = nb::none(),
      nb::arg("sampler") = nb::none(),
      nb::sig(
          "def render(scene: Scene, spp: int | None = None, seed: int | None = None, threads: "
          "int = 0, progress: collections.abc.Callable[[float], object] | None = None, method: "
          "str = 'path', film: str = 'rays', generator: str = 'independent', what: str = 'image', "
          "lines: int = 64, tolerance: float = 0.0, rays: int = 4, points: str = 'random') -> "
          "Estimate"),
      "The image of a scene: linear RGB radiance, (H, W, 3).\n\n"
      "spp, seed: of the scene's file if None. threads: 0 for all cores; they change no bit.\n"
      "progress: called with the fraction done. Ctrl-C raises KeyboardInterrupt; samples that are "
      "not finite raise limn.NonFiniteError.\n"
      "method: \"path\", or \"analytic\": direct light of flat lamps on diffuse surfaces in closed "
      "form; \"lines\" and \"rays\": what the camera sees looks around, by lines between "
      "silhouettes or by rays; \"silhouettes\": by what a pilot finds to be better, part by part "
      "of "
      "the image.\n"
      "what: \"image\", \"direct\" (direct light alone), \"ao\" and \"openness\" (of the sky; "
      "silhouettes, lines and rays). lines, tolerance: of lines and silhouettes, through the sky "
      "(a "
      "quarter through a lamp), doubled until halves differ by twice this part of the result (0: "
      "never; above it silhouettes takes lines alone). rays: of the method rays, from each point "
      "for "
      "each lamp and the sky.\n"
      "film: \"rays\", or \"exact\": what every pixel sees by its exact visible regions (box "
      "filter).\n"
      "generator: \"independent\", or \"sobol\", Owen-scrambled Sobol' points: a third of the "
      "squared error, "
      "mostly, but stderr is then neither the error nor a bound of it (compare images of several "
      "seeds instead). silhouettes, lines and rays always have even numbers.\n"
      "points: of analytic, \"random\", or \"faces\": a pixel is made of the faces that it shows, "
      "without samples and noise (stderr is 0), and its image has an exact derivative: that of "
      "limn.gradient, limn.image_loss, limn.backward and limn.Fit with the same points (box "
      "filter).");
}

}  // namespace limn::python
