// Estimates, and images of scenes.
#include "limn/integrators/render.h"

#include <fmt/format.h>

#include "limn/core/names.h"
#include "limn/integrators/layers.h"
#include "tools/python/arguments.h"

namespace limn::python {

Estimate to_estimate(const Moments& moments, const Film& film, int64_t spp, double seconds) {
  return {Array(to_array(mean_image(moments, film.crop_width, film.crop_height))),
          Array(to_array(standard_error_image(moments, film.crop_width, film.crop_height))),
          spp,
          seconds,
          {},
          false};
}

namespace {

// numpy's protocol: the values themselves unless another type or a copy is requested.
nb::object to_numpy(const Estimate& e, const nb::object& dtype, const nb::object& copy) {
  nb::object value = nb::cast(e.value);
  if (!dtype.is_none()) value = value.attr("astype")(dtype, nb::arg("copy") = false);
  return copy.is_none() || !nb::cast<bool>(copy) ? value : value.attr("copy")();
}

struct RenderCall : RunCall {
  RenderOptions options;

  void take(Arguments& a) {
    add_scene(a, scene);
    add_run(a, request, progress);
    visit_options(options, a);
    a.add_former("sampler", "generator: \"sobol\" or \"independent\"");
    add_store(a, request);
  }

  Estimate run(const Arguments& given) const {
    given.refuse_samples(options.points, {"spp"});
    const RenderResult result = result_of([&](const Scene& of, const RunSettings& settings) {
      return limn::render(of, settings, options);
    });
    Estimate image = to_estimate(result.radiance, film(), result.spp, result.seconds);
    image.warnings = result.warnings;
    warn_all(result.warnings);
    check_finite(result.non_finite, nb::cast(image));
    return image;
  }
};

struct LayersCall : RunCall {
  Names names;

  void take(Arguments& a) {
    add_scene(a, scene);
    a.add("names", kNamesType, "", names, ("of " + join(layer_names()) + ".").c_str());
    add_run(a, request, progress);
  }

  nb::dict run(const Arguments&) {
    LayersResult result = result_of([&](const Scene& of, const RunSettings& settings) {
      return render_layers(of, to_list(names), settings);
    });
    nb::dict layers;
    for (ImageLayer& layer : result.layers) {
      layers[nb::cast(layer.name)] = to_picture(std::move(layer.image), "Layer");
    }
    check_finite(result.non_finite, layers);
    return layers;
  }
};

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
  // mean(), sum(), reshape(), ...
  estimate
      .def(
          "__getattr__",
          [](const Estimate& e, const nb::str& name) {
            return nb::object(nb::cast(e.value).attr(name));
          },
          nb::arg("name"), nb::sig("def __getattr__(self, name: str) -> typing.Any"),
          "What else numpy's arrays have, of the value: mean, sum, reshape, ...")
      .def(
          "__getitem__",
          [](const Estimate& e, const nb::object& key) {
            return nb::object(nb::cast(e.value)[key]);
          },
          nb::arg("key"), nb::sig("def __getitem__(self, key: object) -> numpy.ndarray"))
      .def_prop_ro(
          "shape", [](const Estimate& e) { return nb::object(nb::cast(e.value).attr("shape")); },
          nb::sig("def shape(self) -> tuple[int, ...]"), "That of the value.")
      .def_prop_ro(
          "dtype", [](const Estimate& e) { return nb::object(nb::cast(e.value).attr("dtype")); },
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
      .def_ro("is_derivative", &Estimate::is_derivative,
              "Whether it is of a derivative, which notebooks show red where it is positive and "
              "blue where it is negative.")
      .def_ro("seconds", &Estimate::seconds, "Seconds that the run took, set-up included.")
      .def_prop_ro(
          "warnings", [](const Estimate& e) { return e.warnings; },
          "What the run had to say; Python's warnings told it, too.")
      .def_prop_ro(
          "settings",
          [](const Estimate& e) {
            nb::typed<nb::dict, std::string, std::variant<double, std::string>> settings;
            for (const MethodSetting& s : e.settings)
              settings[nb::cast(s.name)] = nb::cast(s.value);
            return settings;
          },
          "How the method was set up, the same for all parameters of a run: of limn.gradient what "
          "`limn gradient --json` calls settings, as \"step\" of \"fd\" (in the parameter's unit) "
          "and a bound on its bias; of limn.backward the method that ran and what its pilot found. "
          "Empty of images.")
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
  def<RenderCall>(
      m, "render", "Estimate",
      "The image of a scene: linear RGB radiance, (H, W, 3).\n\n"
      "Samples that are not finite raise limn.NonFiniteError. With the generator \"sobol\" stderr "
      "is "
      "neither the error nor a bound of it: compare images of several seeds instead. With points "
      "\"faces\" an image has no noise (stderr is 0) and an exact derivative: that of "
      "limn.gradient, "
      "limn.image_loss, limn.backward and limn.Fit with the same points.");
  def<LayersCall>(
      m, "layers", "dict[str, numpy.ndarray]",
      "What the camera sees besides light: float32, (H, W, 1), (H, W, 2) or (H, W, 3), by name.\n\n"
      "\"normals\": unit shading normal, world axes (\"sh_normal\", as Mitsuba calls it, is the "
      "same); \"depth\": distance along the camera's ray, "
      "scene units; \"position\": world space; \"uv\": texture coordinates, of shapes that have "
      "textures; \"albedo\": share of light from the camera's direction that is scattered; "
      "\"alpha\": 1; \"shape_index\": number in scene.shapes plus 1. Means over each pixel's "
      "filter; all are 0 where the camera sees no surface.");
}

}  // namespace limn::python
