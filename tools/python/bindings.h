#pragma once
// What the groups of bindings share. This folder is the one door to nanobind; it holds no logic
// but that of places (to_world.h): all else is computed by limn/...
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/function.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "limn/core/scene.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/film_points.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/method.h"
#include "limn/integrators/moments.h"
#include "limn/integrators/parts.h"
#include "limn/integrators/run.h"
#include "tools/python/to_world.h"

namespace limn::python {

namespace nb = nanobind;

// A scene as Python holds it. Runs, views and parameters keep the state they were made with: a
// change while others hold that state is made to a copy. Used with the GIL held.
class SceneHandle {
 public:
  explicit SceneHandle(Scene scene)
      : history(scene), scene_(std::make_shared<Scene>(std::move(scene))) {}
  const Scene& get() const { return *scene_; }
  std::shared_ptr<const Scene> share() const { return scene_; }
  Scene& edit() {
    if (scene_.use_count() > 1) scene_ = std::make_shared<Scene>(deep_copy(*scene_));
    return *scene_;
  }

  History history;

 private:
  std::shared_ptr<Scene> scene_;
};

// Does a parameter of this name move something along an axis?
bool is_translation(const std::string& name);

// The numbers of an array for a parameter, row by row. shape: that it must have, {} for any; an
// attribute (1, N, 3) may be (N, 3), and a colour one number. InputError for another shape.
std::vector<double> to_numbers(const Scene& scene, const Parameter& parameter,
                               const std::vector<size_t>& shape, nb::handle array);

// Each group adds its names to the module.
nb::class_<SceneHandle> bind_scene(nb::module_& m);
void bind_parameters(nb::module_& m, nb::class_<SceneHandle>& scene);
void bind_geometry(nb::class_<SceneHandle>& scene);
void bind_parts(nb::module_& m);
void bind_render(nb::module_& m);
void bind_gradient(nb::module_& m);
void bind_backward(nb::module_& m);
void bind_bake(nb::module_& m);
void bind_fit(nb::module_& m);
void bind_check(nb::module_& m);
void bind_compare(nb::module_& m);
void bind_info(nb::module_& m);
void bind_images(nb::module_& m);
void bind_meshes(nb::module_& m);

// The shape called `id`; InputError that lists the known ones.
ShapeId find_shape(const Scene& scene, const std::string& id);

// Of a str or an os.PathLike; TypeError that names the argument.
std::string to_path(const char* argument, nb::handle path);

using Pixels = nb::ndarray<nb::numpy, float, nb::shape<-1, -1, -1>, nb::c_contig>;
using Positions = nb::ndarray<nb::numpy, const float, nb::shape<-1, 3>, nb::c_contig>;

// A copy; H by W by C, or H by W for one channel. Estimates are taken for their values. InputError.
Image to_image(nb::handle array);
// H by W by C, the image's memory with it.
Pixels to_array(Image image);
// The same, of a type of limn.images that notebooks show.
nb::object to_picture(Image image, const char* type);
// (4, 4) of float64, and back; InputError, which says what it is, for another shape.
nb::object to_array(const Matrix4& matrix);
Matrix4 to_matrix(nb::handle array, const std::string& what);
// A view of a shape's vertices that keeps the scene's state alive.
Positions view_positions(std::shared_ptr<const Scene> scene, ShapeId shape);
// Copies of (V, 3) vertices and (F, 3) indices of corners; InputError for other shapes.
std::vector<Vec3f> to_positions(nb::handle array);
std::vector<FaceIndices> to_faces(nb::handle array);
// numpy.ascontiguousarray(value, dtype), of whatever numpy takes; numpy's errors, and a TypeError
// for complex numbers.
nb::object as_array(nb::handle value, const char* dtype);

// A mean with its standard error, as Python sees it.
using Array = nb::ndarray<nb::numpy>;
struct Estimate {
  Array value, error;
  int64_t spp = 0;
  double seconds = 0;
  std::vector<std::string> warnings;
  bool is_derivative = false;
  std::vector<MethodSetting> settings = {};
};
Estimate to_estimate(const Moments& moments, const Film& film, int64_t spp, double seconds);
// The derivative image of one parameter of the result.
Estimate to_estimate(const ParameterGradient& g, const GradientResult& result, const Film& film);

using Names = std::variant<std::string, std::vector<std::string>>;
std::vector<std::string> to_list(const Names& names);

// Runs job(settings) on a thread of its own without the GIL, while this one looks for signals and
// calls progress(fraction) every 50 ms. Ctrl-C, or an exception of `progress`, interrupts the job
// and is raised when it has ended.
void run_job(RunSettings settings, const nb::object& progress,
             const std::function<void(const RunSettings&)>& job);

// Issues Python's warnings.
void warn_all(const std::vector<std::string>& warnings);
// Raises limn.NonFiniteError, which carries the result, if there is a reason to.
void check_finite(const NonFinite& bad, const nb::object& result);

}  // namespace limn::python
