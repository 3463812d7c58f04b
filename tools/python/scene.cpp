// Scenes: read, changed, their meshes as arrays.
#include "limn/core/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>

#include "limn/core/coverage.h"
#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/core/parameter.h"
#include "tools/python/bindings.h"

namespace limn::python {

ShapeId find_shape(const Scene& scene, const std::string& id) {
  std::vector<std::string> known;
  for (uint32_t i = 0; i < scene.shapes.size(); ++i) {
    if (scene.shapes[i].id == id) return ShapeId(i);
    known.push_back(scene.shapes[i].id);
  }
  throw InputError({scene.file}, unknown_name("shape", id, known));
}

namespace {

using Kept = std::shared_ptr<const Scene>;

template <class T>
nb::ndarray<const T, nb::c_contig, nb::device::cpu> rows_of_three(nb::handle array,
                                                                  const char* dtype,
                                                                  const char* what) {
  auto rows = nb::cast<nb::ndarray<const T, nb::c_contig, nb::device::cpu>>(as_array(array, dtype));
  if (rows.ndim() == 2 && rows.shape(1) == 3) return rows;
  throw InputError(std::string(what) + " have shape (" + what[0] + ", 3), one row each");
}

// Keeps a state of the scene alive for a view of it.
nb::capsule keeper(Kept scene) {
  return nb::capsule(new Kept(std::move(scene)),
                     [](void* p) noexcept { delete static_cast<Kept*>(p); });
}

// The mesh of a shape as it was when it was asked for.
struct MeshView {
  Kept scene;
  ShapeId shape;
  const Mesh& mesh() const { return scene->shape(shape).mesh; }
};

using Faces = nb::ndarray<nb::numpy, const uint32_t, nb::shape<-1, 3>, nb::c_contig>;
using Indices = nb::ndarray<nb::numpy, const uint32_t, nb::shape<-1>, nb::c_contig>;

Faces view_faces(const MeshView& view) {
  const SharedVector<FaceIndices>& faces = view.mesh().faces;
  return Faces(faces.front().data(), {faces.size(), 3}, keeper(view.scene));
}

Indices view_weld(const MeshView& view) {
  const SharedVector<uint32_t>& weld = view.mesh().weld;
  return Indices(weld.data(), {weld.size()}, keeper(view.scene));
}

// Values of $names as text; booleans as XML writes them.
std::map<std::string, std::string> to_defines(const nb::kwargs& substitutions) {
  std::map<std::string, std::string> defines;
  for (const auto& [name, value] : substitutions) {
    const std::string text = nb::isinstance<nb::bool_>(value)
                                 ? (nb::cast<bool>(value) ? "true" : "false")
                                 : nb::cast<std::string>(nb::str(value));
    defines[nb::cast<std::string>(name)] = text;
  }
  return defines;
}

template <class Read>
SceneHandle read(const Read& read_it) {
  std::vector<std::string> warnings;
  std::optional<SceneHandle> scene;
  {
    const nb::gil_scoped_release release;
    scene.emplace(read_it(&warnings));
  }
  warn_all(warnings);
  return std::move(*scene);
}

SceneHandle load(nb::handle file, double smooth_as, const nb::kwargs& substitutions) {
  const std::string path = to_path("file", file);
  if (smooth_as != 0 && !(smooth_as >= 1e-4 && smooth_as <= 1)) {
    throw FieldError("smooth_as", "must be 0, or lie between 0.0001 and 1");
  }
  const auto defines = to_defines(substitutions);
  return read([&](std::vector<std::string>* warnings) {
    return read_scene(path, defines, warnings, {}, smooth_as);
  });
}

// The scene of a dictionary: places[i] is what line i + 1 came from, for later messages.
SceneHandle load_placed(const std::string& xml, nb::handle folder,
                        const std::vector<std::string>& places) {
  const std::string path = to_path("folder", folder);
  return read([&](std::vector<std::string>* warnings) {
    Scene scene = read_scene_text(xml, path, {}, warnings);
    scene.file = places.at(0);
    for (Shape& shape : scene.shapes) {
      const auto line = static_cast<size_t>(shape.where.line);
      if (line > 0) shape.where = {places.at(line - 1)};
    }
    return scene;
  });
}

SceneHandle load_string(const std::string& xml, nb::handle folder,
                        const nb::kwargs& substitutions) {
  const std::string path = to_path("folder", folder);
  const auto defines = to_defines(substitutions);
  return read([&](std::vector<std::string>* warnings) {
    return read_scene_text(xml, path, defines, warnings);
  });
}

std::string shading_name(const SceneHandle& scene) {
  return scene.get().shading == ShadingModel::kMitsuba ? "mitsuba" : "continuous";
}

void set_shading(SceneHandle& scene, const std::string& name) {
  if (name != "mitsuba" && name != "continuous") {
    throw InputError(unknown_name("shading", name, {"continuous", "mitsuba"}));
  }
  limn::set_shading(scene.edit(),
                    name == "mitsuba" ? ShadingModel::kMitsuba : ShadingModel::kContinuous);
}

constexpr int kMostInt = std::numeric_limits<int>::max();

void set_max_depth(SceneHandle& scene, int64_t depth) {
  if (depth < -1 || depth == 0 || depth > kMostInt) throw FieldError("max_depth", kDepthRange);
  scene.edit().max_depth = static_cast<int>(depth);
}

void set_rr_depth(SceneHandle& scene, int64_t depth) {
  if (depth < 1 || depth > kMostInt)
    throw FieldError("rr_depth", fmt::format("must lie between 1 and {}", kMostInt));
  scene.edit().rr_depth = static_cast<int>(depth);
}

// Applies `set` to the scene and to its selected sensor in `sensors`, so that view() keeps it.
template <class Set>
void set_sampler(Scene& scene, const Set& set) {
  set(scene);
  if (scene.sensor < scene.sensors.size()) set(scene.sensors[scene.sensor]);
}

void set_spp(SceneHandle& scene, int64_t spp) {
  constexpr int kMost = kMostInt / 2;
  if (spp < 1 || spp > kMost)
    throw FieldError("spp", fmt::format("must lie between 1 and {}", kMost));
  set_sampler(scene.edit(), [=](auto& sampled) { sampled.sample_count = static_cast<int>(spp); });
}

void set_seed(SceneHandle& scene, int64_t seed) {
  if (seed < 0) throw FieldError("seed", "must not be negative");
  set_sampler(scene.edit(), [=](auto& sampled) { sampled.seed = static_cast<uint64_t>(seed); });
}

[[noreturn]] void refuse_pickle(const SceneHandle&) {
  throw nb::type_error(
      "a limn.Scene cannot be pickled: load it in each process, then set there what was changed");
}

void bind_settings(nb::class_<SceneHandle>& scene) {
  scene
      .def(
          "resize",
          [](SceneHandle& s, int64_t width, int64_t height) {
            const auto pixels = [](int64_t n) {
              return static_cast<int>(std::clamp(n, int64_t{-1}, int64_t{kMostInt}));
            };
            resize_film(s.edit(), pixels(width), pixels(height));
          },
          nb::arg("width"), nb::arg("height"),
          "Gives the scene's sensor a film of width x height pixels, as a change of Mitsuba's "
          "film.size does.\n\n"
          "The horizontal field of view stays, the vertical one follows. Where the file's fov_axis "
          "is \"x\" (the default), images are those of the file with this size, to the bit. "
          "limn.InputError, and nothing changes, for crop windows and sizes that the file could "
          "not have.")
      .def_prop_rw(
          "max_depth", [](const SceneHandle& s) { return s.get().max_depth; }, set_max_depth,
          "The longest paths in segments, as in Mitsuba: 1 emission alone, 2 direct light as well, "
          "-1 no limit. limn.InputError for others below 1.")
      .def_prop_rw(
          "rr_depth", [](const SceneHandle& s) { return s.get().rr_depth; }, set_rr_depth,
          "The depth of paths from which Russian roulette may end them: at least 1.")
      .def_prop_rw(
          "hide_emitters", [](const SceneHandle& s) { return s.get().hide_emitters; },
          [](SceneHandle& s, bool hide) { s.edit().hide_emitters = hide; },
          "True if the camera looks through shapes that emit, and sees black in place of the "
          "environment.")
      .def_prop_rw(
          "spp", [](const SceneHandle& s) { return s.get().sample_count; }, set_spp,
          "Samples per pixel where a call gives no spp: at least 1.")
      .def_prop_rw(
          "seed", [](const SceneHandle& s) { return s.get().seed; }, set_seed,
          "The seed where a call gives none: at least 0.")
      .def("__reduce__", refuse_pickle,
           nb::sig("def __reduce__(self) -> str | tuple[typing.Any, ...]"),
           "Raises TypeError: scenes do not pickle. Load them in each process.");
}

std::vector<std::string> shape_ids(const SceneHandle& scene) {
  std::vector<std::string> ids;
  for (const Shape& shape : scene.get().shapes) ids.push_back(shape.id);
  return ids;
}

std::string repr(const SceneHandle& handle) {
  const Scene& scene = handle.get();
  size_t faces = 0;
  for (const Shape& shape : scene.shapes) faces += shape.mesh.faces.size();
  return fmt::format("<limn.Scene \"{}\": {} x {} pixels, {} shapes, {} faces>", scene.file,
                     scene.film.crop_width, scene.film.crop_height, scene.shapes.size(), faces);
}

void bind_mesh(nb::module_& m) {
  nb::class_<MeshView>(m, "Mesh", "The mesh of a shape as it was when it was asked for.")
      .def_prop_ro(
          "positions", [](const MeshView& v) { return view_positions(v.scene, v.shape); },
          nb::rv_policy::reference,
          "Vertices in world space: float32, (V, 3), scene units; a view that cannot be written.")
      .def_prop_ro(
          "faces", view_faces, nb::rv_policy::reference,
          "Indices of corners, counter-clockwise from outside: uint32, (F, 3); a view that "
          "cannot be written.")
      .def_prop_ro("weld", view_weld, nb::rv_policy::reference,
                   "For each vertex the first one at its place: uint32, (V,). Copies of a vertex "
                   "(seams) move together in derivatives: positions[weld] keeps a mesh whole.")
      .def("__repr__", [](const MeshView& v) {
        return fmt::format("<limn.Mesh: {} vertices, {} faces>", v.mesh().positions.size(),
                           v.mesh().faces.size());
      });
}

void bind_changes(nb::class_<SceneHandle>& scene) {
  scene
      .def(
          "mesh",
          [](const SceneHandle& s, const std::string& shape) {
            return MeshView{s.share(), find_shape(s.get(), shape)};
          },
          nb::arg("shape"), "The mesh of the shape of this id.")
      .def(
          "set_mesh",
          [](SceneHandle& s, const std::string& shape, nb::handle positions, nb::handle faces) {
            const ShapeId id = find_shape(s.get(), shape);
            std::vector<std::string> warnings;
            set_mesh(s.edit(), id, to_positions(positions), to_faces(faces), &warnings);
            s.history.forget(s.get(), id.index());
            warn_all(warnings);
          },
          nb::arg("shape"), nb::arg("positions"), nb::arg("faces"),
          nb::sig("def set_mesh(self, shape: str, positions: numpy.typing.ArrayLike, faces: "
                  "numpy.typing.ArrayLike) -> None"),
          "Gives a shape another mesh, in world space: (V, 3) positions and (F, 3) indices.\n\n"
          "Flat shapes stay flat; all others get computed normals. The mesh is mended as one from "
          "a "
          "file, with warnings.")
      .def(
          "move",
          [](SceneHandle& s, const std::string& name, double step) {
            const Parameter parameter = find_parameter(s.get(), name);
            parameter.move_checked(s.edit(), step);
            if (is_translation(parameter.name)) s.history.moved[parameter.name] += step;
          },
          nb::arg("name"), nb::arg("step"),
          "Moves a parameter by `step`, in its unit, from where it is; exact for large steps.\n\n"
          "Rotations and scales go about the center of the shape's bounds as it was read, which "
          "translations move along: steps add up, of rotations about one axis. Raises "
          "limn.InputError, and moves nothing, for a step that is not finite or leads where "
          "no scene can be.")
      .def(
          "view",
          [](const SceneHandle& s, const std::variant<int, std::string>& sensor) {
            SceneHandle other(s);
            use_sensor(other.edit(), std::holds_alternative<int>(sensor)
                                         ? std::to_string(std::get<int>(sensor))
                                         : std::get<std::string>(sensor));
            other.history.sensor_chosen = true;
            return other;
          },
          nb::arg("sensor"), nb::sig("def view(self, sensor: int | str) -> Scene"),
          "A copy that is seen by another sensor of the file, by number (see `sensors`) or id.")
      .def(
          "copy", [](const SceneHandle& s) { return SceneHandle(s); },
          "A scene of its own; what both share is copied when one of them changes.")
      .def("__copy__", [](const SceneHandle& s) { return SceneHandle(s); })
      .def(
          "__deepcopy__", [](const SceneHandle& s, const nb::dict&) { return SceneHandle(s); },
          nb::arg("memo"), nb::sig("def __deepcopy__(self, memo: dict[int, object]) -> Scene"));
}

}  // namespace

std::vector<Vec3f> to_positions(nb::handle array) {
  const auto rows = rows_of_three<float>(array, "float32", "Vertices");
  std::vector<Vec3f> positions(rows.shape(0));
  for (size_t i = 0; i < positions.size(); ++i) {
    positions[i] = {rows.data()[3 * i], rows.data()[3 * i + 1], rows.data()[3 * i + 2]};
  }
  return positions;
}

std::vector<FaceIndices> to_faces(nb::handle array) {
  const auto rows = rows_of_three<int64_t>(array, "int64", "Faces");
  std::vector<FaceIndices> faces(rows.shape(0));
  for (size_t i = 0; i < rows.size(); ++i) {
    const int64_t v = rows.data()[i];
    if (v < 0 || v > UINT32_MAX) {
      throw InputError(fmt::format("Faces hold indices of vertices, from 0 on, not {}", v));
    }
    faces[i / 3][i % 3] = static_cast<uint32_t>(v);
  }
  return faces;
}

Positions view_positions(Kept scene, ShapeId shape) {
  const SharedVector<Vec3f>& positions = scene->shape(shape).mesh.positions;
  static_assert(sizeof(Vec3f) == 3 * sizeof(float));
  const float* first = &positions.front().x;
  const size_t count = positions.size();
  return Positions(first, {count, 3}, keeper(std::move(scene)));
}

nb::class_<SceneHandle> bind_scene(nb::module_& m) {
  bind_mesh(m);
  nb::class_<SceneHandle> scene(
      m, "Scene",
      "A scene: its parameters by name, and what is needed to render it.\n\n"
      "scene[name] reads a parameter's value, scene[name] = value sets it; see `parameters`. Runs "
      "that "
      "were started keep the state they were started with.");
  bind_changes(scene);
  bind_settings(scene);
  scene
      .def_prop_ro(
          "file", [](const SceneHandle& s) { return s.get().file; }, "Its XML file.")
      .def_prop_ro(
          "width", [](const SceneHandle& s) { return s.get().film.crop_width; },
          "Pixels of a row of its images.")
      .def_prop_ro(
          "height", [](const SceneHandle& s) { return s.get().film.crop_height; },
          "Rows of its images.")
      .def_prop_ro(
          "smooth_as", [](const SceneHandle& s) { return s.get().smooth_as; },
          "The roughness that its smooth conductors, dielectrics and plastics were given, see "
          "load(); 0: none.")
      .def_prop_ro(
          "sensors",
          [](const SceneHandle& s) {
            std::vector<std::string> ids;
            for (const Sensor& sensor : s.get().sensors) ids.push_back(sensor.id);
            return ids;
          },
          "Ids of the sensors of the file, \"\" where it gives none; the first is the scene's, "
          "see view().")
      .def_prop_ro("shapes", shape_ids, "Ids of all shapes, \"\" where the file gives none.")
      .def_prop_rw("shading", shading_name, set_shading,
                   "How interpolated normals shade: \"continuous\", or \"mitsuba\", whose "
                   "discontinuities are missing from gradients.")
      .def("__repr__", repr);
  m.def("load", load, nb::arg("file"), nb::kw_only(), nb::arg("smooth_as") = 0.0,
        nb::arg("substitutions"),
        nb::sig("def load(file: str | os.PathLike[str], *, smooth_as: float = 0, **substitutions: "
                "object) -> Scene"),
        "Reads a scene file, the subset of Mitsuba 3's XML that scenes/README.md describes.\n\n"
        "Keywords give values to its $names, as -D does: limn.load(\"demo.xml\", width=64). "
        "smooth_as: the roughness (GGX) that smooth conductors, dielectrics and plastics get, so "
        "that derivatives have all edges (0.003), plastics a few percent darker; 0: they stay "
        "smooth. Raises limn.InputError with file, line and column.");
  m.def(
      "coverage",
      [](const SceneHandle& s) {
        Scene coverage = coverage_of(s.get());
        for (Shape& shape : coverage.shapes) {
          shape.to_world = to_world(s.get(), s.history, shape.id + ".to_world");
        }
        return SceneHandle(std::move(coverage));
      },
      nb::arg("scene"), nb::sig("def coverage(scene: Scene) -> Scene"),
      "A scene whose image is the coverage (alpha) of `scene` less 1: for derivatives of coverage, "
      "and losses against masks less 1. It has the parameters of shapes and cameras; every surface "
      "covers, whatever its material.");
  m.def("advice_on", advice_on, nb::arg("type"),
        "\"; \" and what to write in place of a type of Mitsuba's that limn lacks, or \"\".");
  m.def("load_placed", load_placed, nb::arg("xml"), nb::arg("folder"), nb::arg("places"),
        nb::sig("def load_placed(xml: str, folder: str, places: list[str]) -> Scene"),
        "load_string of a scene whose lines came from other places, for load_dict.");
  m.def("load_string", load_string, nb::arg("xml"), nb::arg("folder") = "",
        nb::arg("substitutions"),
        nb::sig("def load_string(xml: str, folder: str | os.PathLike[str] = '', **substitutions: "
                "object) -> Scene"),
        "Reads a scene from its XML; files that it names are looked for in `folder`.");
  return scene;
}

}  // namespace limn::python
