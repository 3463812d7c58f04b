// Which scenes have direct light of regions alone.
#include "integrators/lights/direct_light_check.h"

#include <fmt/format.h>

namespace limn {

void refuse_light(const std::string& method, const SourceLocation& where, const std::string& what) {
  throw InputError(where, fmt::format("the method \"{}\": {}", method, what));
}

std::string quoted_name(const std::string& kind, const std::string& id) {
  return id.empty() ? kind : fmt::format("{} \"{}\"", kind, id);
}

std::string shape_in_text(const Shape& shape) { return quoted_name("shape", shape.id); }

void check_plain_emitters(const Scene& scene, const std::string& method) {
  for (const Shape& shape : scene.shapes) {
    if (!shape.radiance_texture) continue;
    refuse_light(
        method, shape.where,
        fmt::format("{}: the light of its emitter is textured: use another method (render: "
                    "path)",
                    shape_in_text(shape)));
  }
}

void check_direct_light(const Scene& scene, const std::string& method) {
  const SourceLocation whole{scene.file};
  check_plain_emitters(scene, method);
  if (scene.max_depth != 2) {
    refuse_light(method, whole,
                 fmt::format("it knows direct light alone: ask for that (what: direct), or set the "
                             "integrator's max_depth to 2 (it is {})",
                             scene.max_depth));
  }
  for (const auto& light : scene.delta_lights) {
    refuse_light(method, whole,
                 fmt::format("{}: only emitters with an area and environments are known: use the "
                             "method path",
                             quoted_name("emitter", light->id)));
  }
  if (const Shape* shape = find_smooth(scene)) {
    refuse_light(method, shape->where,
                 fmt::format("{}: smooth and transparent surfaces are not known, this is {}: use "
                             "the method path",
                             shape_in_text(*shape), shape->bsdf->describe()));
  }
  if (scene.shading != ShadingModel::kMitsuba) return;
  for (const Shape& shape : scene.shapes) {
    if (shape.mesh.normal_source == NormalSource::kFace) continue;
    refuse_light(method, shape.where,
                 fmt::format("{}: its interpolated normals need the shading \"continuous\"",
                             shape_in_text(shape)));
  }
}

}  // namespace limn
