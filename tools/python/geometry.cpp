// The camera's pose, and rays of the caller.
#include "limn/core/camera_pose.h"
#include "limn/core/error.h"
#include "limn/core/ray_tracer.h"
#include "limn/core/texture.h"
#include "tools/python/bindings.h"

namespace limn::python {

namespace {

using Doubles = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Vectors = nb::ndarray<nb::numpy, double, nb::c_contig>;
using Indices = nb::ndarray<nb::numpy, int64_t, nb::c_contig>;

Doubles doubles(nb::handle array) { return nb::cast<Doubles>(as_array(array, "float64")); }

// A numpy array of its own memory.
template <class T>
nb::ndarray<nb::numpy, T, nb::c_contig> owned(std::vector<T> values,
                                              std::initializer_list<size_t> shape) {
  auto* kept = new std::vector<T>(std::move(values));
  const nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return nb::ndarray<nb::numpy, T, nb::c_contig>(kept->data(), shape, owner);
}

nb::object get_pose(const SceneHandle& scene) { return to_array(camera_to_world(scene.get())); }

void set_pose(SceneHandle& scene, nb::handle value) {
  const Camera camera = place_camera(scene.get(), to_matrix(value, "sensor_to_world"));
  scene.edit().camera = camera;
}

std::vector<Vec3d> vectors(const char* what, nb::handle array) {
  const Doubles rows = doubles(array);
  if (rows.ndim() != 2 || rows.shape(1) != 3) {
    throw InputError(std::string(what) + " have shape (N, 3), one row each");
  }
  std::vector<Vec3d> list(rows.shape(0));
  for (size_t i = 0; i < list.size(); ++i) {
    list[i] = {rows.data()[3 * i], rows.data()[3 * i + 1], rows.data()[3 * i + 2]};
  }
  return list;
}

nb::dict intersect(const SceneHandle& scene, nb::handle origins, nb::handle directions,
                   int threads) {
  const std::vector<Vec3d> from = vectors("origins", origins);
  const std::vector<Vec3d> along = vectors("directions", directions);
  const auto shared = scene.share();
  std::vector<FirstHit> hits;
  {
    const nb::gil_scoped_release release;
    hits = first_hits(*shared, from, along, threads);
  }
  const size_t count = hits.size();
  std::vector<int64_t> shape(count, -1), face(count, -1);
  std::vector<double> t(count), normal(3 * count), uv(2 * count), places(3 * count),
      texture(2 * count);
  for (size_t i = 0; i < count; ++i) {
    const FirstHit& hit = hits[i];
    t[i] = hit.t;
    if (!hit.face.face.valid()) continue;
    shape[i] = hit.face.shape.index();
    face[i] = hit.face.face.index();
    for (int k = 0; k < 3; ++k) normal[3 * i + k] = hit.normal[k];
    const Mesh& mesh = shared->shape(hit.face.shape).mesh;
    const FaceIndices& corners = mesh.faces[hit.face.face.index()];
    const double weights[] = {1 - hit.uv[0] - hit.uv[1], hit.uv[0], hit.uv[1]};
    for (int corner = 0; corner < 3; ++corner) {
      const Vec3f& p = mesh.positions[corners[corner]];
      for (int k = 0; k < 3; ++k) places[3 * i + k] += weights[corner] * p[k];
    }
    for (int k = 0; k < 2; ++k) uv[2 * i + k] = hit.uv[k];
    if (!mesh.textured) continue;
    const auto mapped = texture_point<double>(mesh, hit.face.face, {hit.uv[0], hit.uv[1]});
    for (int k = 0; k < 2; ++k) texture[2 * i + k] = mapped.uv[k];
  }
  nb::dict result;
  result["t"] = owned(std::move(t), {count});
  result["shape"] = owned(std::move(shape), {count});
  result["face"] = owned(std::move(face), {count});
  result["normal"] = owned(std::move(normal), {count, 3});
  result["barycentric"] = owned(std::move(uv), {count, 2});
  result["position"] = owned(std::move(places), {count, 3});
  result["uv"] = owned(std::move(texture), {count, 2});
  return result;
}

}  // namespace

nb::object to_array(const Matrix4& matrix) {
  return nb::cast(owned<double>({&matrix.m[0][0], &matrix.m[0][0] + 16}, {4, 4}),
                  nb::rv_policy::move);
}

Matrix4 to_matrix(nb::handle array, const std::string& what) {
  const Doubles rows = doubles(array);
  if (rows.ndim() != 2 || rows.shape(0) != 4 || rows.shape(1) != 4) {
    throw InputError(what + " has shape (4, 4)");
  }
  Matrix4 matrix;
  std::copy(rows.data(), rows.data() + 16, &matrix.m[0][0]);
  return matrix;
}

void bind_geometry(nb::class_<SceneHandle>& scene) {
  scene
      .def_prop_rw("sensor_to_world", get_pose, set_pose,
                   nb::for_getter(nb::sig("def sensor_to_world(self) -> numpy.ndarray")),
                   nb::for_setter(nb::sig("def sensor_to_world(self, value: "
                                          "numpy.typing.ArrayLike, /) -> None")),
                   "The camera's pose, a copy: float64, (4, 4), from camera space (+X to the left "
                   "of the image, +Y up, +Z along the view) to the world. Assigning it places the "
                   "camera; limn.InputError for scales and shears.")
      .def(
          "intersect", intersect, nb::arg("origins"), nb::arg("directions"), nb::arg("threads") = 0,
          nb::sig("def intersect(self, origins: numpy.typing.ArrayLike, directions: "
                  "numpy.typing.ArrayLike, threads: int = 0) -> dict[str, numpy.ndarray]"),
          "What N rays hit first. origins, directions: (N, 3), scene units, world space; "
          "directions need not be unit.\n\n"
          "\"t\": distances (N,), infinite for a miss; \"shape\": numbers in `shapes` (N,), -1 "
          "for a miss; \"face\": rows of mesh(shape).faces (N,); \"normal\": of the face, unit, on "
          "its outer side (N, 3); \"barycentric\": (N, 2), weights of the face's second and third "
          "corner; \"position\": (N, 3), world space; \"uv\": texture coordinates (N, 2), of "
          "shapes "
          "that have textures. The last four are 0 for a miss. Every call builds a ray tracer.");
}

}  // namespace limn::python
