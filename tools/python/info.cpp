// What a scene holds, as `limn info --json` writes it.
#include "limn/core/parallel.h"
#include "limn/integrators/scene_info.h"
#include "tools/python/bindings.h"

namespace limn::python {

void bind_info(nb::module_& m) {
  m.def(
      "info",
      [](const SceneHandle& scene, int threads) {
        const std::string info = scene_info(scene.get(), thread_count(threads));
        return nb::module_::import_("json").attr("loads")(info);
      },
      nb::arg("scene"), nb::arg("threads") = 0,
      nb::sig("def info(scene: Scene, threads: int = 0) -> dict[str, typing.Any]"),
      "What a scene holds: shapes with their edges, lights, where surfaces cross, parameters; as "
      "limn info --json writes it.");
}

}  // namespace limn::python
