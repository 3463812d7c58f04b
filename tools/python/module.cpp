// The module limn._limn: its groups, and limn's errors as Python's.
#include "limn/core/error.h"
#include "tools/python/bindings.h"

namespace limn::python {
namespace {

void set_error(const char* type, const char* message) {
  const nb::object error = nb::module_::import_("limn.errors").attr(type);
  PyErr_SetString(error.ptr(), message);
}

void translate(const std::exception_ptr& thrown, void*) {
  try {
    std::rethrow_exception(thrown);
  } catch (const UnknownParameter& error) {
    set_error("UnknownParameterError", error.what());
  } catch (const InputError& error) {
    set_error("InputError", error.what());
  }
}

}  // namespace
}  // namespace limn::python

NB_MODULE(_limn, m) {
  namespace py = limn::python;
  m.doc() = "Bindings of limn's library; import limn instead.";
  m.attr("version") = LIMN_VERSION;
  nanobind::register_exception_translator(py::translate);
  auto scene = py::bind_scene(m);
  py::bind_parameters(m, scene);
  py::bind_geometry(scene);
  py::bind_parts(m);
  py::bind_render(m);
  py::bind_gradient(m);
  py::bind_backward(m);
  py::bind_bake(m);
  py::bind_fit(m);
  py::bind_check(m);
  py::bind_compare(m);
  py::bind_info(m);
  py::bind_images(m);
  py::bind_meshes(m);
}
