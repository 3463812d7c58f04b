// Parameters of a scene by name, their values in and out.
#include "limn/core/parameter.h"

#include <fmt/format.h>

#include <algorithm>

#include "limn/core/error.h"
#include "limn/core/texel_map.h"
#include "tools/python/bindings.h"

namespace limn::python {

namespace {

// A parameter of a scene as it was when it was asked for.
struct ParameterView {
  std::shared_ptr<const Scene> scene;
  Parameter parameter;
  std::optional<double> moved;  // of a translation
};

// All of a scene, as it is.
struct ParametersView {
  SceneHandle* scene;  // kept alive by Python
};

ParameterView find(const SceneHandle& scene, const std::string& name) {
  ParameterView view{scene.share(), find_parameter_or_array(scene.get(), name), std::nullopt};
  if (!is_translation(view.parameter.name)) return view;
  if (!view.parameter.value(*view.scene).empty()) return view;  // a place, as the camera's
  const auto moved = scene.history.moved.find(view.parameter.name);
  view.moved = moved == scene.history.moved.end() ? 0 : moved->second;
  return view;
}

// The shape whose positions the parameter is; none of another parameter.
std::optional<ShapeId> shape_of(const ParameterView& view) {
  if (view.parameter.array.size() != 2) return std::nullopt;
  const std::string& name = view.parameter.name;
  return find_shape(*view.scene, name.substr(0, name.rfind('.')));
}

// The same memory as limn.arrays.Array, which cannot be written.
nb::object locked(const nb::object& array) {
  nb::object view = array.attr("view")(nb::module_::import_("limn.arrays").attr("Array"));
  view.attr("setflags")(nb::arg("write") = false);
  return view;
}

nb::object value_of(const ParameterView& view) {
  if (view.moved) return nb::cast(*view.moved);
  if (const auto shape = shape_of(view))
    return locked(nb::cast(view_positions(view.scene, *shape)));
  if (view.parameter.array.size() == 3) {
    return locked(nb::cast(to_array(view.parameter.texel_map(*view.scene)->texels())));
  }
  const std::vector<double> value = view.parameter.value(*view.scene);
  if (value.empty()) return nb::none();
  return value.size() == 1 ? nb::cast(value[0]) : locked(as_array(nb::cast(value), "float64"));
}

nb::tuple shape_tuple(const ParameterView& view) {
  return nb::tuple(nb::cast(view.parameter.shape()));
}

std::string shape_text(const std::vector<size_t>& shape) {
  return fmt::format("({}{})", fmt::join(shape, ", "), shape.size() == 1 ? "," : "");
}

// SHAPE of SHAPE.scale and SHAPE.rotate.x.
std::string object_of(const std::string& name) {
  const std::string whole = name.substr(0, name.rfind('.'));
  return name.ends_with(".scale") ? whole : whole.substr(0, whole.rfind('.'));
}

nb::object get(const SceneHandle& scene, const std::string& name) {
  if (!names_place(scene.get(), name)) return value_of(find(scene, name));
  return locked(to_array(to_world(scene.get(), scene.history, name)));
}

void set_place(SceneHandle& scene, const std::string& name, nb::handle value) {
  const Matrix4 matrix = to_matrix(value, name);
  std::vector<std::string> warnings;
  place(scene.edit(), scene.history, name, matrix, &warnings);
  warn_all(warnings);
}

void assign(SceneHandle& scene, const std::string& name, nb::handle value) {
  if (names_place(scene.get(), name)) return set_place(scene, name, value);
  std::vector<double> numbers;
  Parameter parameter;
  std::optional<double> moved;
  {
    const ParameterView view = find(scene, name);
    moved = view.moved;
    numbers = to_numbers(scene.get(), view.parameter, view.parameter.array, value);
    parameter = view.parameter;
  }
  if (moved) {
    if (numbers.size() != 1) {
      throw InputError({scene.get().file}, fmt::format("parameter \"{}\" is one number, not {}",
                                                       parameter.name, numbers.size()));
    }
    parameter.move_checked(scene.edit(), numbers[0] - *moved);
    scene.history.moved[parameter.name] = numbers[0];
    return;
  }
  if (parameter.array.empty() && parameter.value(scene.get()).empty()) {
    throw InputError(
        {scene.get().file},
        fmt::format("parameter \"{0}\" moves things from where they are and has no "
                    "value to set: scene.move(\"{0}\", step), or scene[\"{1}.to_world\"]",
                    parameter.name, object_of(parameter.name)));
  }
  std::vector<std::string> warnings;
  parameter.assign(scene.edit(), numbers, &warnings);
  warn_all(warnings);
}

std::vector<std::string> names_of(const ParametersView& view) {
  std::vector<std::string> names;
  for (const Parameter& p : list_parameters(view.scene->get())) names.push_back(p.name);
  return names;
}

bool has(const SceneHandle& scene, nb::handle name) {
  if (!nb::isinstance<nb::str>(name)) return false;
  try {
    find(scene, nb::cast<std::string>(name));
  } catch (const InputError&) {
    return false;
  }
  return true;
}

std::string repr(const ParameterView& view) {
  const Parameter& p = view.parameter;
  return fmt::format("<limn.Parameter \"{}\"{}{}>", p.name, p.unit.empty() ? "" : ", " + p.unit,
                     p.shape().empty() ? "" : ", shape " + shape_text(p.shape()));
}

nb::object view_of(const char* kind, nb::handle self) {
  return nb::module_::import_("collections.abc").attr(kind)(self);
}

void bind_parameter(nb::module_& m) {
  nb::class_<ParameterView>(m, "Parameter", "What a name stands for, as it was when asked for.")
      .def_prop_ro(
          "name", [](const ParameterView& v) { return v.parameter.name; }, "Its name.")
      .def_prop_ro(
          "unit", [](const ParameterView& v) { return v.parameter.unit; },
          "Its unit: \"scene units\", \"radians\", ...; \"\" for plain numbers.")
      .def_prop_ro("shape", shape_tuple, nb::sig("def shape(self) -> tuple[int, ...]"),
                   "Of limn.backward's derivative and of directions in limn.gradient: () for a "
                   "number, (3,) for a colour, (V, 3) for "
                   "vertex positions, (V,) for displacements, (H, W, 3) for the texels of an "
                   "envmap or bitmap, (1, N, 3) for an attribute of a mesh. By its name alone, "
                   "limn.gradient moves all channels of a colour alike (grey); NAME.r, NAME.g, "
                   "NAME.b move one of them.")
      .def_prop_ro(
          "natural_step", [](const ParameterView& v) { return v.parameter.natural_step; },
          "A small step: about a hundredth of what changes the picture a lot.")
      .def_prop_ro(
          "value", value_of, nb::sig("def value(self) -> float | numpy.ndarray | None"),
          "The value: a number, or an array that cannot be written: float32 (V, 3) in the "
          "scene's memory, a copy of others: float64 (3,) of a colour, float32 (H, W, 3) of "
          "texels. Of a translation how far it has been moved since the scene was read. None of "
          "rotations and scales "
          "(Scene.move).")
      .def("__repr__", repr);
}

void bind_mapping(nb::module_& m) {
  nb::class_<ParametersView>(m, "Parameters", "Mapping of names to limn.Parameter.")
      .def("__getitem__",
           [](const ParametersView& v, const std::string& name) { return find(*v.scene, name); })
      .def(
          "__iter__", [](const ParametersView& v) { return nb::iter(nb::cast(names_of(v))); },
          nb::sig("def __iter__(self) -> collections.abc.Iterator[str]"))
      .def("__len__",
           [](const ParametersView& v) { return list_parameters(v.scene->get()).size(); })
      .def("__contains__",
           [](const ParametersView& v, nb::handle name) { return has(*v.scene, name); })
      .def(
          "get",
          [](nb::handle self, const std::string& name, nb::handle otherwise) {
            const nb::object mapping = nb::module_::import_("collections.abc").attr("Mapping");
            return nb::object(mapping.attr("get")(self, name, otherwise));
          },
          nb::arg("name"), nb::arg("default") = nb::none(),
          nb::sig("def get(self, name: str, default: object = None) -> Parameter | object"),
          "The parameter, or `default` if there is none of this name.")
      .def(
          "keys", [](nb::handle self) { return view_of("KeysView", self); },
          nb::sig("def keys(self) -> collections.abc.KeysView[str]"))
      .def(
          "values", [](nb::handle self) { return view_of("ValuesView", self); },
          nb::sig("def values(self) -> collections.abc.ValuesView[Parameter]"))
      .def(
          "items", [](nb::handle self) { return view_of("ItemsView", self); },
          nb::sig("def items(self) -> collections.abc.ItemsView[str, Parameter]"))
      .def("__repr__", [](const ParametersView& v) {
        std::string text = "limn.Parameters:";
        for (const std::string& name : names_of(v)) text += "\n  " + name;
        return text;
      });
}

}  // namespace

std::vector<double> to_numbers(const Scene& scene, const Parameter& parameter,
                               const std::vector<size_t>& shape, nb::handle value) {
  const auto array = nb::cast<nb::ndarray<const double, nb::c_contig, nb::device::cpu>>(
      as_array(value, "float64"));
  const std::vector<double> numbers(array.data(), array.data() + array.size());
  std::vector<size_t> given;
  for (size_t k = 0; k < array.ndim(); ++k) given.push_back(array.shape(k));
  if (shape.empty() || given == shape) return numbers;
  const bool flat = given.size() == 2 && shape.size() == 3 && shape[0] == 1;
  if (flat && std::equal(given.begin(), given.end(), shape.begin() + 1)) return numbers;
  if (parameter.colour && given == std::vector<size_t>{1})
    return std::vector<double>(3, numbers[0]);
  throw InputError({scene.file}, fmt::format("parameter \"{}\" has shape {}, not {}",
                                             parameter.name, shape_text(shape), shape_text(given)));
}

bool is_translation(const std::string& name) {
  for (const char* end : {".translate.x", ".translate.y", ".translate.z"}) {
    if (name.ends_with(end)) return true;
  }
  return false;
}

void bind_parameters(nb::module_& m, nb::class_<SceneHandle>& scene) {
  bind_parameter(m);
  bind_mapping(m);
  scene
      .def_prop_ro(
          "parameters", [](SceneHandle& s) { return ParametersView{&s}; }, nb::keep_alive<0, 1>(),
          "All that can be differentiated: a mapping of names to limn.Parameter. Parts "
          "(\"object.vertex_positions.7.x\", \"clay.reflectance.r\", \"sky.data.0.5.g\") are "
          "found, too, but not "
          "listed.")
      .def("__getitem__", get, nb::arg("name"),
           nb::sig("def __getitem__(self, name: str) -> float | numpy.ndarray | None"),
           "The value of a parameter, see limn.Parameter.value. Arrays cannot be written, but "
           "assigned: scene[name] += x; for parts of one change a copy. \"ID.to_world\" of "
           "shapes, delta lights and environment maps: (4, 4), float64, the to_world that a file "
           "would have for "
           "where they are now; \"sensor.to_world\", or that of its id, is sensor_to_world.")
      .def(
          "__contains__",
          [](const SceneHandle& s, nb::handle name) {
            return has(s, name) || (nb::isinstance<nb::str>(name) &&
                                    names_place(s.get(), nb::cast<std::string>(name)));
          },
          nb::arg("name"), nb::sig("def __contains__(self, name: object) -> bool"),
          "Is scene[name] known?")
      .def(
          "__iter__",
          [](SceneHandle& s) { return nb::iter(nb::cast(names_of(ParametersView{&s}))); },
          nb::sig("def __iter__(self) -> collections.abc.Iterator[str]"),
          "Over the names of all parameters.")
      .def("__setitem__", assign, nb::arg("name"), nb::arg("value"),
           nb::sig("def __setitem__(self, name: str, value: numpy.typing.ArrayLike) -> None"),
           "Sets the value of a parameter: checked, copied; views that were taken stay as they "
           "are. \"ID.to_world\": a matrix or limn.Transform in place of the file's; "
           "T @ scene[\"ID.to_world\"] adds T. It must not mirror the object as the file has it, "
           "nor scale spots and projectors unevenly; environment maps turn about y. "
           "limn.InputError for shapes that move while a shutter is open.");
}

}  // namespace limn::python
