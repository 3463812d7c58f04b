// Views whose environment can be replaced.
#include "limn/integrators/bake.h"

#include "limn/core/parallel.h"
#include "tools/python/arguments.h"

namespace limn::python {
namespace {

struct BakeCall : RunCall {
  RenderOptions options;

  void take(Arguments& a) {
    add_scene(a, scene);
    add_run(a, request, progress);
    a(options.lines, kBakedLinesOption);
  }
  BakedView run(const Arguments&) const {
    auto made = result_of([&](const Scene& of, const RunSettings& settings) {
      return BakedView::make(of, settings, options.lines);
    });
    if (made.non_finite.count > 0) check_finite(made.non_finite, nb::cast(std::move(made.view)));
    return std::move(made.view);
  }
};

int checked_threads(int threads) {
  if (threads < 0) throw InputError("threads must not be below 0");
  return thread_count(threads);
}

SkyMap to_map(nb::handle sky, double scale, double rotate) {
  return {to_image(sky), scale, rotate};
}

Image without_gil(const std::function<Image()>& compute) {
  const nb::gil_scoped_release release;
  return compute();
}

}  // namespace

void bind_bake(nb::module_& m) {
  nb::class_<BakedView>(m, "Baked",
                        "What each point of an image sees of the sky, and so the image under any "
                        "environment map, which is linear in the texels. Pickles.")
      .def(
          "__init__",
          [](BakedView* self, const nb::bytes& data) {
            new (self) BakedView(BakedView::of_bytes({data.c_str(), data.size()}, "data"));
          },
          nb::arg("data"), "From the bytes of a file of `limn bake`.")
      .def_prop_ro(
          "data",
          [](const BakedView& view) {
            const std::string bytes = view.bytes();
            return nb::bytes(bytes.data(), bytes.size());
          },
          "The bytes of a file for `limn relight`.")
      .def(
          "__reduce__",
          [](const nb::object& self) {
            return nb::make_tuple(self.type(), nb::make_tuple(self.attr("data")));
          },
          nb::sig("def __reduce__(self) -> tuple[type, tuple[bytes]]"))
      .def(
          "relight",
          [](const BakedView& view, nb::handle sky, double scale, double rotate, int threads) {
            const SkyMap map = to_map(sky, scale, rotate);
            const int count = checked_threads(threads);
            return to_picture(without_gil([&] { return view.relight(map, count); }), "Picture");
          },
          nb::arg("sky"), nb::arg("scale") = 1.0, nb::arg("rotate") = 0.0, nb::arg("threads") = 0,
          nb::sig("def relight(self, sky: numpy.typing.ArrayLike, scale: float = 1.0, rotate: "
                  "float = 0.0, threads: int = 0) -> numpy.ndarray"),
          "The image, float32, under a map of texels, (H, W, 3) or (H, W), times scale. rotate: as "
          "<rotate y=\"1\"/> [degrees], within the to_world of the scene's envmap, if it had one.")
      .def(
          "adjoint",
          [](const BakedView& view, nb::handle image, nb::handle sky, double scale, double rotate) {
            const SkyMap map = to_map(sky, scale, rotate);
            const Image adjoint = to_image(image);
            return to_array(without_gil([&] { return view.texel_adjoint(map, adjoint); }));
          },
          nb::arg("image"), nb::arg("sky"), nb::arg("scale") = 1.0, nb::arg("rotate") = 0.0,
          nb::sig("def adjoint(self, image: numpy.typing.ArrayLike, sky: numpy.typing.ArrayLike, "
                  "scale: float = 1.0, rotate: float = 0.0) -> numpy.ndarray"),
          "dLoss/dtexels, float32, (H, W, 3), from dLoss/dimage: the transpose of relight. Of sky "
          "only the size counts.");
  def<BakeCall>(m, "bake", "Baked",
                "Keeps what each point of an image sees of the sky: direct light "
                "on diffuse surfaces (max_depth 2), as the method lines:azimuths=uniform.");
}

}  // namespace limn::python
