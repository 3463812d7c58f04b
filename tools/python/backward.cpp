// Reverse mode: losses, and derivatives of a loss for every parameter at once.
#include "limn/integrators/backward.h"

#include <fmt/format.h>

#include <cmath>

#include "limn/core/error.h"
#include "tools/python/bindings.h"

namespace limn::python {

namespace {

using Numbers = std::vector<double>;

Array to_array(Numbers numbers, const std::vector<size_t>& shape) {
  auto* owned = new Numbers(std::move(numbers));
  const nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<Numbers*>(p); });
  return Array(nb::ndarray<nb::numpy, double>(owned->data(), shape.size(), shape.data(), owner));
}

Estimate to_estimate(const ParameterAdjoint& adjoint, const BackwardResult& result) {
  Numbers errors = variances(adjoint.moments);
  for (double& e : errors) e = std::sqrt(e);
  return {to_array(means(adjoint.moments), adjoint.shape),
          to_array(std::move(errors), adjoint.shape), result.spp, result.seconds, result.warnings};
}

nb::dict backward_of(const SceneHandle& handle, const Image& adjoint,
                     const BackwardOptions& options, const RunArguments& run,
                     const nb::object& progress) {
  const auto scene = handle.share();
  BackwardResult result;
  run_job(make_settings(*scene, run), progress, [&](const RunSettings& settings) {
    result = backward(*scene, adjoint, options, settings);
  });
  nb::dict estimates;
  for (const ParameterAdjoint& a : result.parameters) {
    estimates[nb::cast(a.name)] = nb::cast(to_estimate(a, result));
  }
  check_finite(result.non_finite, estimates);
  warn_all(result.warnings);
  return estimates;
}

void bind_loss(nb::module_& m) {
  nb::class_<LossResult>(m, "Loss", "How far the image of a scene is from a target.")
      .def_ro("value", &LossResult::value,
              "A mean over pixels and channels; unbiased, hence below zero now and then near zero, "
              "but for l1.")
      .def_ro("stderr", &LossResult::error, "Its standard error; NaN with spp = 1.")
      .def_ro("spp", &LossResult::spp, "Samples per pixel of each of the two images.")
      .def_prop_ro(
          "adjoint", [](const LossResult& r) { return python::to_array(r.adjoint); },
          nb::rv_policy::reference, "dLoss/dImage, for limn.backward: float32, (H, W, 3).")
      .def("__repr__", [](const LossResult& r) {
        return fmt::format("<limn.Loss: {:.4g} +- {:.2g}>", r.value, r.error);
      });
  m.def(
      "image_loss",
      [](const SceneHandle& handle, nb::handle target, const std::string& kind,
         std::optional<int> spp, std::optional<uint64_t> seed, int threads,
         const nb::object& progress, nb::handle mask, int pyramid, const std::string& method,
         const std::string& points) {
        const auto scene = handle.share();
        const LossImages images{method, to_points(points, {{"spp", spp.has_value()}})};
        const Image image = to_image(target);
        const LossKind loss = loss_kind(kind);
        const Image weights = mask.is_none() ? Image{} : to_image(mask);
        LossResult result;
        run_job(make_settings(*scene, {spp, seed, 0, threads}), progress,
                [&](const RunSettings& settings) {
                  result = image_loss(*scene, image, loss, settings, weights, pyramid, images);
                });
        return result;
      },
      nb::arg("scene"), nb::arg("target"), nb::arg("kind") = "l2", nb::arg("spp") = nb::none(),
      nb::arg("seed") = nb::none(), nb::arg("threads") = 0, nb::arg("progress") = nb::none(),
      nb::arg("mask") = nb::none(), nb::arg("pyramid") = 1, nb::arg("method") = "path",
      nb::arg("points") = "random",
      nb::sig(
          "def image_loss(scene: Scene, target: numpy.typing.ArrayLike, kind: str = 'l2', spp: "
          "int | None = None, seed: int | None = None, threads: int = 0, progress: "
          "collections.abc.Callable[[float], object] | None = None, mask: "
          "numpy.typing.ArrayLike | None = None, pyramid: int = 1, method: str = 'path', points: "
          "str = 'random') -> Loss"),
      "Renders the scene twice, independently, and compares with a target, (H, W, 3) or (H, W).\n\n"
      "kind: \"l2\", \"relative-l2\" or \"l1\". limn.backward with the same seed and the adjoint "
      "found "
      "here gives an unbiased gradient of l2 and relative-l2.\n"
      "mask: what pixels weigh, (H, W). pyramid: levels, the mean over the loss of the image as it "
      "is, at half its size, a quarter, ....\n"
      "method, points: of the images, \"path\" or \"analytic\", see limn.render. With points "
      "\"faces\" there is one image, the loss is a function without noise, and limn.backward with "
      "the same points gives its gradient.");
}

}  // namespace

FilmPoints to_points(const std::string& name, const BackwardOptions& options,
                     std::vector<SampleKeyword> samples) {
  const BackwardOptions unasked;
  samples.insert(samples.end(),
                 {{"uniform_pixels", options.uniform_pixels},
                  {"edge_samples", options.edge_samples != unasked.edge_samples},
                  {"camera_samples", options.camera_samples != unasked.camera_samples},
                  {"shadow_samples", options.shadow_samples != unasked.shadow_samples}});
  return to_points(name, samples);
}

void bind_backward(nb::module_& m) {
  bind_loss(m);
  m.def(
      "backward",
      [](const SceneHandle& scene, nb::handle adjoint, const std::optional<Names>& names,
         std::optional<int> spp, std::optional<uint64_t> seed,
         const std::vector<std::string>& terms, bool uniform_pixels, int edge_samples,
         double camera_samples, double shadow_samples, int batches, double seconds, int threads,
         const nb::object& progress, const std::string& method, const std::string& points,
         BatchStore* store, const nb::object& sampler) {
        refuse_sampler(sampler, "method");
        BackwardOptions options;
        options.method = to_method(method, Task::kBackward);
        if (names) options.parameters = to_list(*names);
        if (names && options.parameters.empty()) {
          throw InputError("names: none are given; None stands for all parameters");
        }
        options.terms = terms;
        options.uniform_pixels = uniform_pixels;
        options.edge_samples = edge_samples;
        options.camera_samples = camera_samples;
        options.shadow_samples = shadow_samples;
        options.batches = batches;
        options.points = to_points(
            points, options,
            {{"spp", spp.has_value()}, {"seconds", seconds != 0}, {"batches", batches != 16}});
        if (batches < 1) throw InputError("batches must be 1 or more");
        return backward_of(scene, to_image(adjoint), options, {spp, seed, seconds, threads, store},
                           progress);
      },
      nb::arg("scene"), nb::arg("adjoint"), nb::arg("names") = nb::none(),
      nb::arg("spp") = nb::none(), nb::arg("seed") = nb::none(),
      nb::arg("terms") = nb::make_tuple(), nb::arg("uniform_pixels") = false,
      nb::arg("edge_samples") = 1, nb::arg("camera_samples") = BackwardOptions{}.camera_samples,
      nb::arg("shadow_samples") = BackwardOptions{}.shadow_samples, nb::arg("batches") = 16,
      nb::arg("seconds") = 0.0, nb::arg("threads") = 0, nb::arg("progress") = nb::none(),
      nb::arg("method") = Method(Task::kBackward).name(), nb::arg("points") = "random",
      nb::arg("_store").none() = nb::none(), nb::arg("sampler") = nb::none(),
      nb::sig(
          "def backward(scene: Scene, adjoint: numpy.typing.ArrayLike, names: str | "
          "collections.abc.Sequence[str] | None = None, spp: int | None = None, seed: int | None "
          "= None, terms: collections.abc.Sequence[str] = (), uniform_pixels: bool = False, "
          "edge_samples: int = 1, camera_samples: float = 0, shadow_samples: float = 1, "
          "batches: int = 16, seconds: float = 0, threads: int = 0, progress: "
          "collections.abc.Callable[[float], object] | None = None, "
          "method: str = 'forest', points: str = 'random') -> dict[str, Estimate]"),
      "Reverse mode: dLoss/dparameter of every parameter at once, from dLoss/dImage.\n\n"
      "adjoint: (H, W, 3), or (H, W) of the luminance; independent of the samples made here "
      "(another "
      "seed than that of the image it came from), else the gradient is biased.\n"
      "names: arrays as well (\"object.vertex_positions\"); None for all parameters but "
      "displacements, which repeat them; limn.InputError if there are none in it.\n"
      "Values are float64: (V, 3) of an array, (3,) of a colour, () of a number, of the loss per "
      "unit of the parameter. "
      "Copies of a vertex have equal shares. Pixels are sampled in proportion to the adjoint "
      "unless uniform_pixels. edge_samples: boundary samples per path vertex; camera_samples: "
      "boundary samples on the film per path (0: a quarter, one with \"analytic\"); "
      "shadow_samples: on the edges of shadows there. method: \"forest\"; \"silhouettes\", which "
      "has less noise where shadows are soft; \"analytic\": the light of flat area lights in "
      "closed "
      "form; or to compare with them \"quadric\", \"li2019\", \"uniform\", \"brute\". batches: at "
      "most, for standard errors.\n"
      "points: \"faces\", with the method analytic: of the image that limn.render makes with "
      "these "
      "points, exactly, without samples. The rest as limn.gradient.");
}

}  // namespace limn::python
