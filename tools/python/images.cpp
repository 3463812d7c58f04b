// Images as arrays, and as files.
#include "limn/core/image.h"

#include <cstring>
#include <filesystem>

#include "limn/core/error.h"
#include "tools/python/bindings.h"

namespace limn::python {

std::string to_path(const char* argument, nb::handle path) {
  const nb::object text = nb::module_::import_("os").attr("fspath")(path);
  if (nb::isinstance<nb::str>(text)) return nb::cast<std::string>(text);
  throw nb::type_error(
      (std::string(argument) + ": a path is a str or an os.PathLike of one, not bytes").c_str());
}

Image to_image(nb::handle array) {
  const auto pixels =
      nb::cast<nb::ndarray<const float, nb::c_contig, nb::device::cpu>>(as_array(array, "float32"));
  const size_t channels = pixels.ndim() == 3 ? pixels.shape(2) : 1;
  if (pixels.ndim() < 2 || pixels.ndim() > 3 || (channels != 1 && channels != 3) ||
      pixels.size() == 0 || pixels.size() / channels > static_cast<size_t>(kMaxPixels)) {
    throw InputError("an image has shape (H, W, 3), (H, W, 1) or (H, W)");
  }
  Image image(static_cast<int>(pixels.shape(1)), static_cast<int>(pixels.shape(0)),
              static_cast<int>(channels));
  std::memcpy(image.data.data(), pixels.data(), pixels.size() * sizeof(float));
  return image;
}

nb::object as_array(nb::handle value, const char* dtype) {
  const nb::module_ numpy = nb::module_::import_("numpy");
  if (nb::cast<bool>(numpy.attr("iscomplexobj")(value))) {
    throw nb::type_error("expected real numbers, not complex ones");
  }
  return numpy.attr("ascontiguousarray")(value, dtype);
}

Pixels to_array(Image image) {
  auto kept = std::make_unique<Image>(std::move(image));
  const size_t shape[3] = {static_cast<size_t>(kept->height), static_cast<size_t>(kept->width),
                           static_cast<size_t>(kept->channels)};
  Image* owned = kept.release();
  const nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<Image*>(p); });
  return Pixels(owned->data.data(), 3, shape, owner);
}

nb::object to_picture(Image image, const char* type) {
  const nb::object shown = nb::module_::import_("limn.images").attr(type);
  return nb::cast(to_array(std::move(image))).attr("view")(shown);
}

namespace {

// A file's path that ends in `ending`; InputError for another one.
std::string to_file(nb::handle path, const std::string& ending) {
  std::string file = to_path("file", path);
  const std::string last = std::filesystem::path(file).extension().string();
  if (last == ending) return file;
  throw InputError({file}, "the name of a file of this format ends in " + ending +
                               "; limn.write_image chooses the format by the ending");
}

}  // namespace

void bind_images(nb::module_& m) {
  m.def(
      "read_image", [](nb::handle file) { return to_array(read_image(to_path("file", file))); },
      nb::arg("file"), nb::sig("def read_image(file: str | os.PathLike[str]) -> numpy.ndarray"),
      "Pixels of an EXR, PNG, JPEG, Radiance RGBE (.hdr) or BMP image, linear: float32, (H, W, 3) "
      "or (H, W, 1). "
      "Images of eight bits are decoded from sRGB; alpha is dropped.");
  m.def(
      "read_alpha",
      [](nb::handle file) -> nb::object {
        Image alpha = read_alpha(to_path("file", file));
        if (alpha.data.empty()) return nb::none();
        return nb::cast(to_array(std::move(alpha))).attr("squeeze")(2);
      },
      nb::arg("file"),
      nb::sig("def read_alpha(file: str | os.PathLike[str]) -> numpy.ndarray | None"),
      "The alpha channel of a PNG or EXR image: float32, (H, W), 1 where it is opaque. None where "
      "the file has none.");
  m.def(
      "read_exr", [](nb::handle file) { return to_array(read_exr(to_path("file", file))); },
      nb::arg("file"), nb::sig("def read_exr(file: str | os.PathLike[str]) -> numpy.ndarray"),
      "Pixels of an OpenEXR image: float32, (H, W, 3), or (H, W, 1) if it has channel Y alone.");
  m.def(
      "write_exr",
      [](nb::handle file, nb::handle image, bool half) {
        write_exr(to_file(file, ".exr"), to_image(image), half, {});
      },
      nb::arg("file"), nb::arg("image"), nb::arg("half") = false,
      nb::sig("def write_exr(file: str | os.PathLike[str], image: numpy.typing.ArrayLike, half: "
              "bool = False) -> None"),
      "Writes (H, W, 3), (H, W, 1) or (H, W) pixels as OpenEXR, in half precision if asked to.");
  m.def(
      "write_png",
      [](nb::handle file, nb::handle image, double exposure) {
        write_png(to_file(file, ".png"), to_image(image), exposure);
      },
      nb::arg("file"), nb::arg("image"), nb::arg("exposure") = 1.0,
      nb::sig(
          "def write_png(file: str | os.PathLike[str], image: numpy.typing.ArrayLike, exposure: "
          "float = 1.0) -> None"),
      "Writes radiance times `exposure` as an 8-bit sRGB picture, clamped to [0, 1].");
  m.def(
      "write_signed_png",
      [](nb::handle file, nb::handle image, std::optional<double> scale) {
        const Image picture = to_image(image);
        write_signed_png(to_file(file, ".png"), picture, scale.value_or(signed_scale(picture)));
      },
      nb::arg("file"), nb::arg("image"), nb::arg("scale") = nb::none(),
      nb::sig("def write_signed_png(file: str | os.PathLike[str], image: numpy.typing.ArrayLike, "
              "scale: float | None = None) -> None"),
      "Writes a derivative image, mean over channels: red above zero, blue below, white at "
      "zero.\n\n"
      "scale: the value of the full colour; None: the 99.5th percentile of what is not zero.");
}

}  // namespace limn::python
