// Meshes of arrays: triangles of one size, and steps that spread over a surface.
#include "limn/core/error.h"
#include "limn/core/mesh.h"
#include "limn/integrators/large_steps.h"
#include "limn/integrators/remesh.h"
#include "tools/python/bindings.h"

namespace limn::python {

namespace {

Mesh to_mesh(nb::handle positions, nb::handle faces) {
  return make_mesh(to_positions(positions), to_faces(faces), false, {"mesh"}, nullptr);
}

// A numpy array of its own, (rows, 3).
template <class T>
nb::object rows_of_three(const T* data, size_t rows) {
  return nb::cast(nb::ndarray<nb::numpy, const T>(data, {rows, 3}, {}), nb::rv_policy::copy);
}

nb::tuple remeshed(nb::handle positions, nb::handle faces, double length) {
  if (!(length > 0)) throw InputError("length must be above 0");
  const Remeshed after = remesh(to_mesh(positions, faces), length, {"mesh"});
  static_assert(sizeof(Vec3f) == 3 * sizeof(float));
  return nb::make_tuple(rows_of_three(&after.positions.front().x, after.positions.size()),
                        rows_of_three(after.faces.front().data(), after.faces.size()));
}

nb::object solve(const LargeSteps& steps, nb::handle values) {
  const nb::object array = as_array(values, "float64");
  const auto numbers = nb::cast<nb::ndarray<const double, nb::c_contig, nb::device::cpu>>(array);
  if (numbers.size() != 3 * steps.size()) {
    throw InputError("values have shape (V, 3), of a mesh without copies of vertices");
  }
  const std::vector<double> solved = steps.solve({numbers.data(), numbers.data() + numbers.size()});
  return rows_of_three(solved.data(), steps.size());
}

}  // namespace

void bind_meshes(nb::module_& m) {
  m.def("remesh", remeshed, nb::arg("positions"), nb::arg("faces"), nb::arg("length"),
        nb::sig("def remesh(positions: numpy.typing.ArrayLike, faces: numpy.typing.ArrayLike, "
                "length: float) -> tuple[numpy.ndarray, numpy.ndarray]"),
        "The same surface by triangles of one size (Botsch and Kobbelt 2004): positions (V, 3), "
        "float32, and faces (F, 3), uint32.\n\n"
        "length: of the edges, scene units; most end within 4/5 to 4/3 of it. Border vertices stay "
        "where they are. limn.InputError for meshes that are not manifold, or where limn was "
        "built without OpenMesh.");
  nb::class_<LargeSteps>(m, "LargeSteps",
                         "(I + lambda L)^-1 over a mesh, L its uniform Laplacian (Nicolet, "
                         "Jacobson, Jakob 2021): what spreads steps over it.")
      .def(
          "__init__",
          [](LargeSteps* self, nb::handle positions, nb::handle faces, double lambda) {
            if (!(lambda >= 0)) throw InputError("weight must not be below 0");
            new (self) LargeSteps(to_mesh(positions, faces), lambda);
          },
          nb::arg("positions"), nb::arg("faces"), nb::arg("weight"),
          nb::sig("def __init__(self, positions: numpy.typing.ArrayLike, faces: "
                  "numpy.typing.ArrayLike, weight: float) -> None"),
          "weight: lambda, at least 0.")
      .def("solve", solve, nb::arg("values"),
           nb::sig("def solve(self, values: numpy.typing.ArrayLike) -> numpy.ndarray"),
           "(I + lambda L)^-1 values, (V, 3). The matrix is symmetric: it takes gradients, too.");
}

}  // namespace limn::python
