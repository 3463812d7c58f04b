// Reverse mode: losses, and derivatives of a loss for every parameter at once.
#include "limn/integrators/backward.h"

#include <fmt/format.h>

#include <cmath>

#include "limn/core/error.h"
#include "tools/python/arguments.h"

namespace limn::python {

namespace {

using Numbers = std::vector<double>;

Array to_array(Numbers numbers, const std::vector<size_t>& shape) {
  auto* owned = new Numbers(std::move(numbers));
  const nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<Numbers*>(p); });
  return Array(nb::ndarray<nb::numpy, double>(owned->data(), shape.size(), shape.data(), owner));
}

std::vector<MethodSetting> settings_of(const BackwardResult& result) {
  if (result.decision.empty()) return {};
  return {{"method", result.method}, {"pilot", result.decision}};
}

Estimate to_estimate(const ParameterAdjoint& adjoint, const BackwardResult& result) {
  Numbers errors = variances(adjoint.moments);
  for (double& e : errors) e = std::sqrt(e);
  return {to_array(means(adjoint.moments), adjoint.shape),
          to_array(std::move(errors), adjoint.shape),
          result.spp,
          result.seconds,
          result.warnings,
          true,
          settings_of(result)};
}

struct BackwardCall : RunCall {
  nb::object adjoint;
  std::optional<Names> names;
  BackwardOptions options;

  void take(Arguments& a) {
    add_scene(a, scene);
    a.add("adjoint", kArrayType, "", adjoint, "dLoss/dImage, (H, W, 3) or (H, W).");
    a.add("names", kNamesOrNoneType, "None", names,
          "of numbers and arrays, as \"object.vertex_positions\" (V, 3); None: all but "
          "displacements.");
    add_run(a, request, progress, true);
    visit_options(options, a);
    a.add_former("sampler", "method");
    add_store(a, request);
  }

  nb::dict run(const Arguments& given) {
    given.refuse_samples(options.points, {"spp", "seconds"});
    if (names) options.parameters = to_list(*names);
    if (names && options.parameters.empty()) {
      throw InputError("names: none are given; None stands for all parameters");
    }
    const Image image = to_image(adjoint);
    const BackwardResult result = result_of([&](const Scene& of, const RunSettings& settings) {
      return backward(of, image, options, settings);
    });
    nb::dict estimates;
    for (const ParameterAdjoint& parameter : result.parameters) {
      estimates[nb::cast(parameter.name)] = nb::cast(to_estimate(parameter, result));
    }
    check_finite(result.non_finite, estimates);
    warn_all(result.warnings);
    return estimates;
  }
};

struct LossCall : RunCall {
  nb::object target, mask = nb::none();
  LossOptions options;

  void take(Arguments& a) {
    add_scene(a, scene);
    a.add("target", kArrayType, "", target, "(H, W, 3) or (H, W).");
    Option row = kLossOption;
    row.name = "kind";
    a(options.kind, row);
    add_run(a, request, progress);
    a.add("mask", kArrayOrNoneType, "None", mask, "weights of the pixels, (H, W).");
    visit_options(options, all_but({"loss"}, a));
  }

  LossResult run(const Arguments& given) const {
    given.refuse_samples(options.points, {"spp"});
    const Image wanted = to_image(target);
    const Image weights = mask.is_none() ? Image{} : to_image(mask);
    return result_of([&](const Scene& of, const RunSettings& settings) {
      return image_loss(of, wanted, options, settings, weights);
    });
  }
};

void bind_loss(nb::module_& m) {
  nb::class_<LossResult>(m, "Loss", "How far the image of a scene is from a target.")
      .def_ro("value", &LossResult::value,
              "A mean over pixels and channels; unbiased, hence below zero now and then near zero, "
              "but for l1, l1-srgb and smape.")
      .def_ro("stderr", &LossResult::error, "Its standard error; NaN with spp = 1.")
      .def_ro("spp", &LossResult::spp, "Samples per pixel of each of the two images.")
      .def_prop_ro(
          "adjoint", [](const LossResult& r) { return python::to_array(r.adjoint); },
          nb::rv_policy::reference, "dLoss/dImage, for limn.backward: float32, (H, W, 3).")
      .def("__repr__", [](const LossResult& r) {
        return fmt::format("<limn.Loss: {:.4g} +- {:.2g}>", r.value, r.error);
      });
  def<LossCall>(
      m, "image_loss", "Loss",
      "Renders the scene twice, independently, and compares with a target.\n\n"
      "Values of l2 and relative-l2 are unbiased: near zero, individual estimates are negative "
      "about as often as positive. limn.backward with the same seed and the adjoint found here "
      "gives an unbiased gradient of l2 and relative-l2. With points \"faces\" there is one image, "
      "the loss is a function without "
      "noise, and limn.backward with the same points gives its gradient.");
}

}  // namespace

void bind_backward(nb::module_& m) {
  bind_loss(m);
  def<BackwardCall>(
      m, "backward", "dict[str, Estimate]",
      "Reverse mode: dLoss/dparameter of every parameter at once, from dLoss/dImage.\n\n"
      "The adjoint must be independent of the samples made here (of another seed than that of the "
      "image it came from), else the gradient is biased. Values are float64: (V, 3) of an array, "
      "(3,) of a colour, () of a number, of the loss per unit of the parameter. Copies of a vertex "
      "have equal shares. With points \"faces\" of the image that limn.render makes with them, "
      "exactly. The rest as limn.gradient.");
}

}  // namespace limn::python
